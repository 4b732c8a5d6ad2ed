"""How outputs answer to the pulses of a nuisance: differences of whole simulations, many pulses in each.

A pulse is followed until the next one of its simulation begins, so how long it has to be followed decides how many
simulations that takes. Those that turn are thousands where steps are long, and how long they are felt depends on the
building and on the effects in it: four hours do in the default room, but not in a house that forgets within three, nor
behind a sensor that lags (sizes of effects were wrong there). So a sample of them is followed longer, and tells.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from datagen.driving.tables import SNAP
from diagnosis.fitting.differences import either_way
from diagnosis.fitting.nuisance import Nuisance

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
    nuisance: Nuisance, simulate: SimulateMany, base: np.ndarray, time: np.ndarray, observed: np.ndarray, noise: np.ndarray
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
