"""A problem without the part of its nuisance that no reading feels: the far past, and changes that leave no trace."""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

UNFELT = 0.1
"""What moves no reading by more than this share of its noise, with its whole prior spread, is no longer followed."""


def pruned(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """The same problem without history and changes within steps that no reading feels, and its linearisation."""
    nuisance = problem.nuisance
    moved = np.abs(around.response) * nuisance.sd / problem.noise.sd[:, None, None]
    keep = nuisance.guessed | (moved.max(axis=(0, 1), initial=0.0) > UNFELT)
    other = problem.with_effects(problem.effects)
    other.nuisance = nuisance.only(keep)
    used = np.abs(nuisance.factor[keep]).any(axis=0)
    response = around.response[:, :, keep]
    return other, Linearisation(
        around.z,
        around.nuisance[used],
        around.heights[keep],
        around.outputs,
        response,
        other.marginal(response),
        around.lasting,
    )
