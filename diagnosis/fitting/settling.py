"""Coming to rest: rounds of a fit that go back and forth between two ways of explaining the same readings.

Where nobody counted the persons, each round draws its straight lines about other histories of the room, and a fit may
swing for ever: small room and many persons, large room and few. From some round on lines are drawn about the mean of
the last optima (averaged fixed-point iteration: Krasnoselskii, Uspekhi Mat. Nauk 10, 1955); what still moves in the end
is not known better than by how much it moves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SWINGING = 6
"""Rounds after which a fit that has not come to rest is taken to swing."""
LAST = 4
"""Optima that are averaged."""


def between(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Where to draw the next lines (unknowns,): at the last optimum ``z``, or between those of a fit that swings."""
    return np.asarray(np.mean(path[-LAST:], axis=0)) if round_ >= SWINGING and path else z


def swung(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Covariance (unknowns, unknowns) about ``z`` of the last optima of a fit that still swings; zero before that."""
    if round_ < SWINGING or len(path) < 2:
        return np.zeros((len(z), len(z)))
    off = np.array(path[-LAST:]) - z
    return np.asarray(off.T @ off / len(off))
