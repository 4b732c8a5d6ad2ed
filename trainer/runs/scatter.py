"""How far answers scatter about the truth, condition by condition, and the factors that make means of them.

Estimators are trained on the logarithm of parameters, as the paper's are, so that their answer is the mean of the
logarithm. Taken back by the exponential it is a geometric mean: too low on average, by the more the less a recording
tells of a parameter, and what is too low on average has a larger squared error than it need have. Of errors that are
normal in the logarithm with variance s2 the mean is exp(s2 / 2) times as large (Baskerville 1972, Canadian Journal of
Forest Research 2: 49-53; Miller 1984, The American Statistician 38: 124-126). s2 is measured on validation systems.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from pydantic import BaseModel


class Errors(BaseModel, extra="forbid"):
    """Root mean square errors on validation systems under one condition, readings without gaps."""

    length: int
    """samples of a window"""
    absent: list[str]
    """recorded channels that it lacks"""
    noise: str
    """sensor preset"""
    windows: int
    systems: int
    rmse: dict[str, float]
    """of each parameter [its own unit]"""
    scatter: dict[str, float] | None = None
    """of ln(answer / truth) of each parameter [1]; None where answers are not made means, and in cards of old"""


def factors_of(
    errors: Sequence[Errors], parameters: Sequence[str], length: int, absent: Collection[str]
) -> np.ndarray | None:
    """What answers to windows of a length that lack some channels are multiplied by (parameters,) [1].

    None where it is not known how far answers to windows of this length scatter. Nobody knows the noise of a recording,
    so that the presets of the training count alike. Of channels that lack in a combination that was not measured, the
    one that lacks most of those measured stands for it.
    """
    found = [one for one in errors if one.length == length and one.scatter is not None]
    if not found:
        return None
    exact = [one for one in found if {*one.absent} == {*absent}]
    most = max(len(one.absent) for one in found)
    alike = exact or [one for one in found if len(one.absent) == most]
    scatters = [[one.scatter[name] for name in parameters] for one in alike if one.scatter is not None]
    return means_from(np.array(scatters))


def means_from(scatter: np.ndarray) -> np.ndarray:
    """Factors (parameters,) from root mean square errors of the logarithm (conditions, parameters)."""
    return np.exp(0.5 * np.mean(scatter**2, axis=0))
