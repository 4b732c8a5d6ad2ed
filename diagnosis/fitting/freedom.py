"""How many courses of the nuisance the readings leave, and how that changes with the unknowns.

With the nuisance integrated out, a reading is the more likely the fewer courses of the nuisance were possible: the log
density holds minus half the log determinant of the nuisance's posterior precision, :func:`half_logdet`. It changes with
the unknowns, as the response to the nuisance does. In a small room each person moves the CO2 more, so that the readings
tell better who came; a fit that leaves that out makes rooms too small where nobody counted.

On a straight line the response is fixed. So the derivative, the *slope*, is worked out where the line is drawn, from
the response anew on both sides of each unknown z,

    d/dz 0.5 log |1 + R' N^-1 R| = trace((1 + R' N^-1 R)^-1 R' N^-1 dR/dz)

R: response to the nuisance, N: covariance of noise. Pulses some hours apart share a simulation, with random signs, so
that what one does to the readings of another cancels on average (Hutchinson 1990, Communications in Statistics
19:433). Where a line is drawn further on, the slope is corrected by how much the determinant itself has changed
(Broyden 1965, Mathematics of Computation 19:577).

It is that of persons whom nobody counted. How many come is estimated with them (:class:`.nuisance.Level`); a prior that
is too wide, as that of what happens within the steps of a meter, would pull parameters. A diagnosis goes without: its
priors are wider still, lest a rare course of persons pass for a gap, and with the slopes of parameters and candidates
more recordings without a gap seemed to hold one.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve

from diagnosis.fitting.grams import Colour, Grams
from diagnosis.fitting.linear import HEIGHT
from diagnosis.fitting.problem import STEP
from diagnosis.recording import HOUR
from shared.errors import SimulationError

APART = 2 * HOUR
"""Pulses so far apart share a simulation [s]."""
Slope = Mapping[str, tuple[float, float]]


def half_logdet(grams: Grams, colours: dict[int, Colour]) -> float:
    """Half the log determinant of the nuisance's posterior precision, in units of its prior's."""
    return float(np.sum(np.log(np.diag(grams.without_nuisance(colours).root))))


def slope_of(grams: Grams, colours: dict[int, Colour]) -> Slope:
    """The derivative of :func:`half_logdet` by each unknown, and where it was taken, by the unknown's name.

    It is zero for an unknown whose simulations fail, and empty where occupants were counted or no simulation succeeds.
    """
    lin, problem, n = grams.lin, grams.lin.problem, grams.n_nuisance
    nuisance = problem.nuisance
    places = np.flatnonzero(nuisance.guessed)
    if not len(places) or not n:
        return {}
    length = float(np.median((nuisance.end - nuisance.begin)[places]))
    runs = int(np.ceil(APART / length))
    together = np.rint(nuisance.begin[places] / length) % runs == np.arange(runs)[:, None]
    signs = together * np.random.default_rng(0).choice([-1.0, 1.0], len(places))
    root = grams.without_nuisance(colours).root
    by_height = signs @ nuisance.factor[places] @ lin.turn
    weights = {
        k: by_height @ cho_solve((root, True), grams.whitened_columns(k, colours[k])[:, :n].T) for k in grams.channels
    }
    size = HEIGHT * nuisance.sd[places].max()
    heights = np.tile(lin.around.heights, (1 + len(signs), 1))
    heights[1:, places] += size * signs

    def told(z: np.ndarray) -> float:
        """How much there is at ``z`` of the response that the readings tell where the line was drawn."""
        base, *others = problem.simulate_all([(z, one) for one in heights])
        moved = (np.stack(others, axis=-1) - base[..., None]) / size
        return sum(float(np.sum(one.T * grams.whitened(k, colours[k], moved[k]))) for k, one in weights.items())

    try:
        here = told(lin.z)
    except SimulationError:
        return {}
    slope, (low, high) = {}, problem.bounds
    for k, name in enumerate(problem.names):
        up, down = lin.z.copy(), lin.z.copy()
        up[k], down[k] = min(lin.z[k] + STEP, high[k]), max(lin.z[k] - STEP, low[k])
        if k in problem.unknown.places_of_constants:  # they hardly change it: one side is enough
            (up if lin.z[k] > 0 else down)[k] = lin.z[k]
        found = 0.0
        with suppress(SimulationError):
            ends = [here if np.array_equal(z, lin.z) else told(z) for z in (up, down)]
            found = (ends[0] - ends[1]) / (up[k] - down[k])
        slope[name] = (found, float(lin.z[k]))
    return slope


def corrected(before: Grams, after: Grams, colours: dict[int, Colour]) -> Grams:
    """A line drawn further on, with the slope of the one before corrected by how much the determinant has changed."""
    way = after.lin.z - before.lin.z
    if not before.lin.slope or not way.any():
        return after
    slopes, _ = before.lin.slopes
    missed = half_logdet(after, colours) - half_logdet(before, colours) - slopes @ way
    pairs = zip((slopes + missed * way / (way @ way)).tolist(), after.lin.z.tolist(), strict=True)
    slope = dict(zip(after.lin.problem.names, pairs, strict=True))
    return Grams(replace(after.lin, slope=slope), after.observed, after)
