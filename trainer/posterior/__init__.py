"""Posteriors: what a recording says of the parameters, as a distribution, by a normalising flow on a fitted run.

    fit_posterior   run folder and dataset folder -> posterior.safetensors and posterior.json in the run folder
    load_posterior  run -> a Posterior that samples, or None
    calibration     run and dataset -> coverage, rank histograms, scores against simpler laws, on unseen systems

The names are looked up when first used: they import torch, and the command line's ``--help`` must not wait for it.
"""

from __future__ import annotations

from shared.lazy import lazily

__all__ = ["Posterior", "calibration", "fit_posterior", "load_posterior"]

_HOMES = {
    "Posterior": "trainer.posterior.inference",
    "calibration": "trainer.posterior.assessment",
    "fit_posterior": "trainer.posterior.fitting",
    "load_posterior": "trainer.posterior.checkpoint",
}

__getattr__ = lazily(__name__, _HOMES)
