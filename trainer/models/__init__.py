"""The estimators. Each is one file and one line here.

The lines are text, so that the names can be listed without importing torch.
"""

from __future__ import annotations

import inspect
import math
from importlib import import_module
from typing import TYPE_CHECKING, Any

from shared.errors import EstimatorError, OptionsError
from shared.refused import meant
from trainer.memory import memory_for

if TYPE_CHECKING:
    from trainer.models.base import Estimator, Shape

ESTIMATORS: dict[str, str] = {
    "patch-transformer": "trainer.models.patch_transformer:PatchTransformer",
    "lstm": "trainer.models.lstm:Lstm",
    "tcn": "trainer.models.tcn:Tcn",
    "multiscale-transformer": "trainer.models.multiscale_transformer:MultiscaleTransformer",
    "regression-transformer": "trainer.models.regression_transformer:RegressionTransformer",
    "summary-mlp": "trainer.models.summary_mlp:SummaryMlp",
    "ridge": "trainer.models.ridge:Ridge",
    "mean": "trainer.models.mean:Mean",
}
LARGEST = 2**31 - 1
"""Of an option; torch's sizes are not much larger."""


def estimator_class(name: str) -> type[Estimator]:
    """The class behind a name; an EstimatorError if there is none."""
    if name not in ESTIMATORS:
        raise EstimatorError(
            f"model: {name!r} is not an estimator; found {', '.join(ESTIMATORS)}{meant(name, ESTIMATORS)}"
        )
    module, attribute = ESTIMATORS[name].split(":")
    found: type[Estimator] = getattr(import_module(module), attribute)
    return found


def option_defaults(name: str) -> dict[str, Any]:
    """Options that an estimator takes, with their defaults."""
    signature = inspect.signature(estimator_class(name).__init__)
    return {key: p.default for key, p in signature.parameters.items() if p.default is not inspect.Parameter.empty}


def build(name: str, shape: Shape, options: dict[str, Any]) -> tuple[Estimator, dict[str, Any]]:
    """Make an untrained estimator; returns it with all its options, defaults included.

    Raises EstimatorError if the name is unknown; OptionsError if an option is unknown, has the wrong type, or does not
    fit the context.
    """
    known = option_defaults(name)
    for key, value in options.items():
        if key not in known:
            raise OptionsError(f"{name}: no option {key!r}; found {', '.join(known) or 'none'}")
        number = isinstance(value, int | float) and math.isfinite(value)
        if isinstance(known[key], float) and not number:
            raise OptionsError(f"{name}: option {key!r} is {value!r}; expected a number")
        if isinstance(known[key], int) and (not number or value != int(value) or value < 1):
            raise OptionsError(f"{name}: option {key!r} is {value!r}; expected a whole number of at least 1")
        if isinstance(known[key], int) and value > LARGEST:
            raise OptionsError(f"{name}: option {key!r} is {value:g}; expected at most {LARGEST}")
    merged = {key: type(default)(options.get(key, default)) for key, default in known.items()}
    given = ", ".join(f"{key} {merged[key]:g}" for key in options) or "its defaults"
    try:
        with memory_for(f"a {name} of {given}", kind=OptionsError):
            network = estimator_class(name)(shape, **merged)
            network.static, network.known = shape.static, shape.known
            return network, merged
    except ValueError as error:  # torch's own, of a dropout that is no share
        raise OptionsError(f"{name}: {error}") from None
