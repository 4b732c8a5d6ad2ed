"""Estimators: fit one to a dataset, evaluate it, use it on a recording.

    fit        dataset folder -> run folder (weights.safetensors, estimator.json, curve.csv, curve.png)
    evaluate   run folder and dataset folder -> R2 under the protocols "paper" and "unseen", tables, scatter figure
    predict    run folder and recording (NetCDF) -> parameter estimates with their validation error

The names are looked up when first used: they import torch, and the command line's ``--help`` must not wait for it.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["evaluate", "fit", "load_run", "predict"]

_HOMES = {
    "evaluate": "trainer.evaluation",
    "fit": "trainer.fitting",
    "load_run": "trainer.checkpoint",
    "predict": "trainer.prediction",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'trainer' has no attribute {name!r}")
