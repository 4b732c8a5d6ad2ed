"""What happened within a long step of which only the mean is known: when people came, when the heater was on.

Persons who were counted come and go within a step as the description's random occupancy says they do where the means of
that step and of the two on either side are such: mean and covariance over the nearest of many draws
(k-nearest-neighbour regression; Stone 1977, Annals of Statistics 5:595). Were they held at the mean, a room would seem
to follow people faster than it does, because there are more of them at the end of an hour in which they come. Of a
replayed actuator nothing is known but how much the steps beside it differ.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from datagen.driving.occupancy import occupancy_prior
from datagen.driving.tables import SNAP, Piecewise
from diagnosis.fitting.nuisance import Nuisance, no_nuisance
from diagnosis.recording import DAY, Recording
from shared.signals import Occupancy

LONG = 2700.0
"""Steps at least so long have something within them that matters [s]."""
BESIDE = 2
"""Steps on either side that tell how a step went."""
ROOMS = 1000
"""Drawn for a week each."""
NEAREST, WIDER = 40, 1000
RARE = 0.1
"""Share of the covariance that is that of the wider neighbours: what happens rarely is not among the nearest few."""
LEFT_OUT = 1e-3
"""Share of the signal's standard deviation below which what happens within a step is left out."""
HAAR = np.array([[0.5, 0.5, 0.0, 0.0], [0.5, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]])
"""Heights of the pulses of :func:`_pulses` that make given deviations of quarters from their mean."""


def counted(spec: Occupancy, place: int, recording: Recording, signal: Piecewise) -> tuple[Nuisance, Piecewise]:
    """How persons who were counted as means over long steps came and went within them.

    Parameters
    ----------
    place
        Of the input among the system's.
    signal
        The means, and what stands in for them before the recording.

    Returns
    -------
    tuple
        What is not known of the quarters of steps, and the signal with their expected values; before the recording, and
        with short steps, as it was.
    """
    if recording.step < LONG:
        return no_nuisance(), signal
    step = recording.step
    middles = recording.time - 0.5 * step
    means = signal.at(middles)
    beside = np.stack([signal.at(middles + k * step) for k in range(-BESIDE, BESIDE + 1)], axis=1)
    mean, covariance = _expected(spec, step, beside)
    quarters = (means[:, None] + mean).ravel()
    begins = (recording.time[:, None] - step * np.array([1.0, 0.75, 0.5, 0.25])).ravel()
    past = signal.times < begins[0] - SNAP
    shown = Piecewise(np.append(signal.times[past], begins), np.append(signal.values[past], quarters), "previous")
    return _pulses(place, recording, HAAR @ covariance @ HAAR.T, float(means.std())), shown


def replayed(place: int, recording: Recording, signal: Piecewise) -> Nuisance:
    """Means over long steps: the halves of a step may differ as much as its neighbours do, and so may its quarters.

    What changes once, at any time of a step with equal probability, changes within each half of it with half the
    probability, but then as much: the spread of a half's halves is sqrt(1/2) of that of the step's. An actuator that
    never ran backwards did not within a step either: a heater that gave next to nothing in an hour did not give much in
    one half of it, and what a model made of less than nothing would be no answer to a change within the step.
    """
    if recording.step < LONG:
        return no_nuisance()
    values = signal.at(recording.time - 0.5 * recording.step)
    change = np.abs(np.diff(values))
    spread = 0.5 * np.maximum(np.append(0.0, change), np.append(change, 0.0))
    spread = np.minimum(spread, values - min(values.min(), 0.0))
    covariance = spread[:, None, None] ** 2 * np.diag([1.0, 0.5, 0.5])
    return _pulses(place, recording, covariance, float(values.std()))


def _pulses(place: int, recording: Recording, covariance: np.ndarray, size: float) -> Nuisance:
    """Differences between halves of steps, and between the halves of each half, with covariances (steps, 3, 3)."""
    spread = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    some = np.flatnonzero(spread > LEFT_OUT * max(size, 1e-12))
    if not len(some):
        return no_nuisance()
    values, vectors = np.linalg.eigh(covariance[some])
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    count = 3 * len(some)
    factor = np.zeros((count, count))
    for k, root in enumerate(roots):
        factor[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = root
    half = 0.5 * recording.step
    begin = (recording.time[some, None] - np.array([2 * half, 2 * half, half])).ravel()
    pulses = Nuisance(
        column=np.full(count, place),
        begin=begin,
        end=begin + np.tile([2 * half, half, half], len(some)),
        turns=np.ones(count, dtype=bool),
        recorded=np.ones(count, dtype=bool),
        mean=np.zeros(count),
        factor=factor,
    )
    return pulses.only(pulses.sd > 0.1 * LEFT_OUT * size)


def _expected(spec: Occupancy, step: float, means: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of a step's quarters from its mean, given those of the steps around it (steps, around) [persons].

    Returns
    -------
    tuple
        Mean (steps, 4) [persons] and covariance (steps, 4, 4) [persons²]; nothing where the means do not differ. Steps
        that are like no draw are less certain: a quarter of the squared distance of the nearest is added.
    """
    tree, shapes = _draws(spec, step)
    mean, covariance = np.zeros((len(means), 4)), np.zeros((len(means), 4, 4))
    most = np.abs(means).max(axis=1)
    some = np.flatnonzero(np.ptp(means, axis=1) > LEFT_OUT * most)
    if tree is None or not len(some):
        return mean, covariance
    distance, places = tree.query(means[some] / most[some, None], k=np.arange(1, min(WIDER, len(shapes)) + 1))
    near = shapes[places[:, :NEAREST]]
    middle = near.mean(axis=1, keepdims=True)
    mean[some] = most[some, None] * middle[:, 0]
    apart = np.mean(distance[:, :NEAREST] ** 2, axis=1)
    unlike = 0.25 * apart[:, None, None] * (np.eye(4) - 0.25)
    spread = (1 - RARE) * _second_moment(near - middle) + RARE * _second_moment(shapes[places] - middle)
    covariance[some] = most[some, None, None] ** 2 * (spread + unlike)
    return mean, covariance


def _second_moment(values: np.ndarray) -> np.ndarray:
    """Mean product of values (n, draws, k) with themselves, shape (n, k, k)."""
    return np.asarray(np.matmul(values.transpose(0, 2, 1), values) / values.shape[1])


@lru_cache(maxsize=4)
def _draws(spec: Occupancy, step: float) -> tuple[cKDTree | None, np.ndarray]:
    """Steps of random rooms in which, or beside which, persons come or go, in shares of the most that are there.

    Returns
    -------
    tuple
        Their means and those of the steps around them, to be searched, and the deviations of their quarters (draws, 4).
    """
    steps = max(round(7 * DAY / step), 1)
    quarters = occupancy_prior(spec, 0.25 * step * np.arange(4 * (steps + 2 * BESIDE) + 1), ROOMS, seed=0)
    quarters = quarters.reshape(ROOMS, -1, 4)
    means = quarters.mean(axis=2)
    around = np.lib.stride_tricks.sliding_window_view(means, 2 * BESIDE + 1, axis=1).reshape(-1, 2 * BESIDE + 1)
    shapes = (quarters - means[..., None])[:, BESIDE:-BESIDE].reshape(-1, 4)
    some = np.ptp(around, axis=1) > 0
    if not some.any():
        return None, shapes[:0]
    most = around[some].max(axis=1, keepdims=True)
    return cKDTree(around[some] / most), shapes[some] / most
