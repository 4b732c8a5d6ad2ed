"""The simulation around a point, as far as a nuisance is concerned: a straight line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.marginal import Marginal


@dataclass(frozen=True)
class Linearisation:
    """The simulation around some unknowns and a nuisance.

    ``z`` (unknowns,); ``nuisance`` standard normal, shape (nuisance unknowns,), and its ``heights`` (pulses,);
    ``outputs`` (outputs, steps) simulated with both; ``response`` (outputs, steps, pulses) by heights [unit of output
    per unit of input]; ``marginal`` integrates the nuisance out of standardised rows of observed readings; pulses that
    turn were followed for ``lasting`` [s] at most.
    """

    z: np.ndarray
    nuisance: np.ndarray
    heights: np.ndarray
    outputs: np.ndarray
    response: np.ndarray
    marginal: Marginal
    lasting: float = np.inf
