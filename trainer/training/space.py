"""Where a search looks for the options of an estimator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from optuna.trial import Trial

from shared.errors import EstimatorError
from trainer.models import estimator_class, option_defaults

Suggest = Callable[[Trial, str, Any], Any]


def _times(*factors: float) -> Suggest:
    """Whole numbers around the default."""

    def suggest(trial: Trial, name: str, default: Any) -> Any:
        return trial.suggest_categorical(name, sorted({max(1, round(default * factor)) for factor in factors}))

    return suggest


def _among(*values: Any) -> Suggest:
    def suggest(trial: Trial, name: str, default: Any) -> Any:
        return trial.suggest_categorical(name, sorted({*values, default}))

    return suggest


SPACE: dict[str, Suggest] = {
    "patch": _among(4, 6, 12, 24),
    "width": _times(0.5, 1, 2),
    "feedforward": _times(0.5, 1, 2),
    "layers": lambda trial, name, default: trial.suggest_int(name, 1, 2 * default),
    "heads": _among(1, 2, 4, 8),
    "kernel": _among(2, 3, 5, 7),
    "dropout": lambda trial, name, default: trial.suggest_float(name, 0.0, 0.5),
    "batch_size": _times(0.5, 1, 2, 4),
    "lr": lambda trial, name, default: trial.suggest_float(name, default / 10, 10 * default, log=True),
}
"""Where an option is looked for, by its name: an estimator's search space is those of its options that are here, and
batch size and learning rate. An estimator may have a class attribute ``space`` of the same kind, which comes first."""


def space_of(model: str) -> dict[str, tuple[Suggest, Any]]:
    """What is searched for an estimator: by option, how it is suggested and its default.

    Raises EstimatorError if the estimator is unknown, or nothing about it can be searched.
    """
    kind = estimator_class(model)
    if not kind.iterates:
        raise EstimatorError(f"model: {model} is solved, not trained: there is nothing to search")
    known = SPACE | getattr(kind, "space", {})
    defaults = option_defaults(model) | {"batch_size": kind.recipe.batch_size, "lr": kind.recipe.lr}
    return {name: (known[name], default) for name, default in defaults.items() if name in known}
