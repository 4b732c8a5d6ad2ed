"""Linearising anew: at other unknowns, and at the nuisance that is most likely there."""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.leaps import joint_cost, leapt
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

SHARES = (1.0, 0.5, 0.2)


def renewed(problem: Problem, z: np.ndarray, around: Linearisation, *, leaps: bool = False) -> Linearisation:
    """Linearise a problem at ``z`` and at the nuisance that is most likely there.

    Of the way from the old nuisance to the new one only as much is gone as makes the measurements more plausible: a
    controller that saturates bends the straight line. With ``leaps`` what the line cannot see is tried as well.
    """
    target = problem.likely_nuisance(z, around)
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for share in SHARES:
        nuisance = around.nuisance + share * (target - around.nuisance)
        try:
            outputs = problem.simulate(z, problem.nuisance.heights(nuisance))
        except FAILURES:
            continue
        cost = joint_cost(problem, nuisance, outputs)
        if best is not None and cost > best[0]:
            break
        best = cost, nuisance, outputs
    if best is None:
        return problem.linearise(z, around.nuisance)
    _, nuisance, outputs = best
    return problem.linearise(z, leapt(problem, z, nuisance, outputs) if leaps else nuisance)
