"""Estimators: fit one to a dataset, evaluate it, use it on a recording.

    fit        dataset folder -> run folder (weights.safetensors, estimator.json, curve.csv, curve.png)
    tune       dataset folder -> the options of an estimator that are best on validation systems
    evaluate   run folder and dataset folder -> R2 under the protocols "paper" and "unseen", tables, scatter figure
    predict    run folder and recording (NetCDF) -> parameter estimates, with their validation error if it is known
    benchmark  dataset folder -> the paper's tables and figures, and more, under many conditions

The names are looked up when first used: they import torch, and the command line's ``--help`` must not wait for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shared.lazy import lazily

if TYPE_CHECKING:
    from trainer.benchmarking.running import benchmark as benchmark
    from trainer.evaluating.evaluation import evaluate as evaluate
    from trainer.predicting.prediction import predict as predict
    from trainer.runs.checkpoint import load_run as load_run
    from trainer.training.fitting import fit as fit
    from trainer.training.tuning import tune as tune

__all__ = ["benchmark", "evaluate", "fit", "load_run", "predict", "tune"]

_HOMES = {
    "benchmark": "trainer.benchmarking.running",
    "evaluate": "trainer.evaluating.evaluation",
    "fit": "trainer.training.fitting",
    "load_run": "trainer.runs.checkpoint",
    "predict": "trainer.predicting.prediction",
    "tune": "trainer.training.tuning",
}

__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
