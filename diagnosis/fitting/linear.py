"""The simulation around a point, as far as a nuisance is concerned: a straight line, and the nuisance integrated out.

Where many unknowns move few readings, most of their directions move nothing: :func:`principal` keeps the others.

Differences of simulations that do without those which fail: one bad point must not cost a whole recording.

A derivative whose simulation fails on one side is taken from the other; where both fail, the direction is left at zero
by whoever asked, so that the prior alone decides it.

How outputs answer to the pulses of a nuisance: differences of whole simulations, many pulses in each.

A pulse is followed until the next one of its simulation begins, so how long it has to be followed decides how many
simulations that takes. Those that turn are thousands where steps are long, and how long they are felt depends on the
building and on the effects in it: four hours do in the default room, but not in a house that forgets within three, nor
behind a sensor that lags (sizes of effects were wrong there). So a sample of them is followed longer, and tells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from datagen.driving.tables import SNAP
from diagnosis.fitting.nuisance import Nuisance
from shared.errors import SimulationError


def principal(columns: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thin singular value decomposition of columns (rows, n), from the smaller of its two products.

    Parameters
    ----------
    least
        Squared length from which a direction is kept.

    Returns
    -------
    tuple
        Squared lengths (k,), increasing, directions among the columns (n, k) and among the rows (rows, k), both
        orthonormal.
    """
    rows, count = columns.shape
    if not columns.size:
        return np.empty(0), np.empty((count, 0)), np.empty((rows, 0))
    wide = count > rows
    # all vectors are asked for, which divide and conquer gives fastest
    values, vectors = eigh(columns @ columns.T if wide else columns.T @ columns, driver="evd")
    keep = values > least
    values, vectors = values[keep], vectors[:, keep]
    scaled = vectors / np.sqrt(values)
    return (values, columns.T @ scaled, vectors) if wide else (values, vectors, columns @ scaled)


UNFELT = 1e-6
"""Eigenvalue up to which a direction is left out."""


class Marginal:
    """Standardised residuals with the nuisance integrated out.

    With iid N(0, 1) errors and ``by_unknown`` (rows, unknowns) the standardised outputs by standard normal unknowns,
    the covariance of the residual is S = I + B B'. :meth:`root` applies S^(-1/2).
    """

    def __init__(self, by_unknown: np.ndarray | Callable[[], np.ndarray]) -> None:
        """``by_unknown`` may be a function that gives it: it is asked when it is first needed."""
        self._given = by_unknown

    @cached_property
    def by_unknown(self) -> np.ndarray:
        """B, shape (rows, unknowns)."""
        return self._given() if callable(self._given) else self._given

    @cached_property
    def _decomposed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Eigenvalues and vectors of B'B, and an orthonormal basis of B; made when first asked for."""
        return principal(self.by_unknown, UNFELT)

    @property
    def logdet(self) -> float:
        """Of S."""
        return float(np.sum(np.log1p(self._decomposed[0])))

    def root(self, rows: np.ndarray) -> np.ndarray:
        """S^(-1/2) applied to standardised rows, shape (rows,) or (rows, n)."""
        values, _, basis = self._decomposed
        shrink = 1 - 1 / np.sqrt(1 + values)
        return np.asarray(rows - basis @ (shrink * (basis.T @ rows).T).T)

    def unknowns(self, residual: np.ndarray) -> np.ndarray:
        """Posterior mean of the unknowns given a standardised residual (rows,), shape (unknowns,)."""
        values, vectors, _ = self._decomposed
        return np.asarray(vectors @ ((vectors.T @ (self.by_unknown.T @ residual)) / (1 + values)))


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


SimulateOne = Callable[[np.ndarray], np.ndarray]


def one_sided(
    simulate: SimulateOne, z: np.ndarray, k: int, bounds: tuple[np.ndarray, np.ndarray], step: float
) -> np.ndarray | None:
    """Derivative of the outputs by unknown ``k`` from whichever side can be simulated.

    Parameters
    ----------
    simulate
        Outputs (outputs, steps) for unknowns (unknowns,); raises SimulationError where it cannot.
    z
        Where, shape (unknowns,); it must be possible to simulate it.
    bounds
        Of the unknowns, each (unknowns,).
    step
        Width of the difference.

    Returns
    -------
    numpy.ndarray or None
        Shape (outputs, steps); None if neither side can be simulated.
    """
    here = simulate(z)
    low, high = bounds
    for side in (step, -step):
        there = z.copy()
        there[k] = min(max(z[k] + side, low[k]), high[k])
        if there[k] == z[k]:
            continue
        try:
            return np.asarray((simulate(there) - here) / (there[k] - z[k]))
        except SimulationError:
            continue
    return None


def either_way(
    simulate: Callable[[list[np.ndarray]], list[np.ndarray]], runs: Sequence[np.ndarray]
) -> list[tuple[float, np.ndarray | None]]:
    """Outputs of runs, each as it is (1) or, where that fails, with its sign turned (-1); None where both fail.

    Parameters
    ----------
    simulate
        Outputs of several runs; raises SimulationError if one of them fails.
    runs
        What is added to the base, each (pulses,).
    """
    try:
        return [(1.0, one) for one in simulate(list(runs))]
    except SimulationError:
        pass
    found: list[tuple[float, np.ndarray | None]] = []
    for run in runs:
        for sign in (1.0, -1.0):
            try:
                found.append((sign, simulate([sign * run])[0]))
                break
            except SimulationError:
                continue
        else:
            found.append((1.0, None))
    return found


HEIGHT = 0.5
"""Height of a pulse in the difference, in prior standard deviations."""
SAMPLE = 4
"""Simulations, or one more, that tell how long pulses that turn are felt."""
LOST = 2e-4
"""Of the mean square of what they do to an output, in units of its noise and with the noise's own: what comes later
than half of the time for which they are then followed, and before they would have been given up anyway. Set by
hand, as :data:`WORTH`, on the default room and the houses of the tests, on no set that is scored."""
WORTH = 0.5
"""Of the time for which they are followed otherwise: for less than that to be spared nothing is given up."""

SimulateMany = Callable[[list[np.ndarray]], list[np.ndarray]]


def responses(nuisance: Nuisance, simulate: SimulateMany, base: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Outputs by heights of pulses, by differences of whole simulations, several pulses in each.

    Pulses that are followed until the next one begins share a simulation, and each is followed as long as that.
    Pulses whose simulation fails whichever way they point are taken to do nothing.

    Parameters
    ----------
    simulate
        Outputs (outputs, steps) for pulses of given heights (pulses,) on top of the base.
    base
        Outputs without, shape (outputs, steps).
    time
        Ends of the steps, shape (steps,) [s].

    Returns
    -------
    numpy.ndarray
        Shape (outputs, steps, pulses) [unit of the output per unit of the input].
    """
    result = np.zeros((*base.shape, nuisance.size))
    height = HEIGHT * nuisance.sd
    combs = _combs(nuisance)
    runs = []
    for comb in combs:
        heights = np.zeros(nuisance.size)
        heights[comb] = height[comb]
        runs.append(heights)
    for comb, (sign, outputs) in zip(combs, either_way(simulate, runs), strict=True):
        if outputs is None:
            continue
        moved = sign * (outputs - base)
        starts = [*nuisance.begin[comb], np.inf]
        for i, k in enumerate(comb):
            rows = (time > starts[i] + SNAP) & (time <= starts[i + 1] + SNAP)
            result[:, rows, k] = moved[:, rows] / height[k]
    return result


def lasting(
    nuisance: Nuisance,
    simulate: SimulateMany,
    base: np.ndarray,
    time: np.ndarray,
    observed: np.ndarray,
    noise: np.ndarray,
) -> float:
    """For how long pulses that turn have to be followed [s]; infinite where it is not worth asking.

    Parameters
    ----------
    simulate, base, time
        As of :func:`responses`.
    observed
        Readings that count, shape (outputs, steps).
    noise
        Standard deviation of a reading, shape (outputs,) [unit of each].
    """
    places, used = np.flatnonzero(nuisance.turns), observed.any(axis=1)
    if not len(places) or not used.any():
        return np.inf
    step = time[-1] - time[-2]
    share = SAMPLE / (np.sum(nuisance.followed[places]) / (time[-1] - time[0] + step))
    if share > 1 / 3:
        return np.inf
    sample = np.zeros(nuisance.size, dtype=bool)
    sample[places[:: round(1 / share)]] = True
    some = nuisance.only(sample)

    def of_all(runs: list[np.ndarray]) -> list[np.ndarray]:
        full = []
        for one in runs:
            heights = np.zeros(nuisance.size)
            heights[sample] = one
            full.append(heights)
        return simulate(full)

    answers = responses(some, of_all, base, time)[used] * some.sd / noise[used, None, None]
    age = time[:, None] - some.begin
    squares = np.where(age <= some.followed, answers**2, 0.0)
    ages = np.arange(1, int(some.followed.max() / step) + 2) * step
    later = np.stack([np.sum(squares, axis=(1, 2), where=age > one) for one in ages])
    allowed = LOST * (np.sum(squares, axis=(1, 2)) + share * observed[used].sum(axis=1))
    long = 2.0 * float(ages[np.argmax((later <= allowed).all(axis=1))])
    return long if long <= WORTH * some.followed.min() else np.inf


def _combs(nuisance: Nuisance) -> list[list[int]]:
    """Pulses that share a simulation, in the order in which they begin."""
    combs: list[list[int]] = []
    over: list[float] = []  # when the last pulse of each has been followed for long enough
    for k in np.argsort(nuisance.begin, kind="stable").tolist():
        until = nuisance.begin[k] + max(nuisance.followed[k], 2 * (nuisance.end[k] - nuisance.begin[k]))
        for c, earliest in enumerate(over):
            if nuisance.recorded[k] and nuisance.begin[k] >= earliest - SNAP:
                combs[c].append(k)
                over[c] = until
                break
        else:
            combs.append([k])
            over.append(until if nuisance.recorded[k] else np.inf)
    return combs
