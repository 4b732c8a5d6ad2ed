"""The error of a measurement beside a model: white noise of the sensor, and a slow part of what the model lacks.

For each output the error is white noise plus an Ornstein-Uhlenbeck process (Rasmussen and Williams, Gaussian Processes
for Machine Learning, 2006, section 4.2: exponential covariance). Its covariance is whitened by a scalar Kalman filter,
whose gains do not depend on the data: exact also across gaps, and linear in the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log

import numpy as np
from scipy.optimize import minimize

from shared.system import System

HOUR = 3600.0
LONGEST = 3000.0
"""Correlation time of a slow error at most [h]."""


def errors_under(system: System, preset: str) -> np.ndarray:
    """Standard deviations of the outputs' errors under a noise preset [unit of each], shape (outputs,).

    ``sensor``, which is the default everywhere, is the numerical floor where the description has no such preset.

    Raises
    ------
    SystemDescriptionError
        If there is no preset of that name.
    """
    plain = preset == "sensor" and preset not in system.noise_presets
    return system.noise_sd("none" if plain else preset)


def undeclared(system: System, preset: str, readings: np.ndarray) -> dict[str, str]:
    """Outputs with readings (outputs, steps) that have no noise under a preset, and as how exact they are taken [unit].

    None under ``none``: who asks for that knows it.
    """
    if preset == "none":
        return {}
    return {
        output.name: f"{output.accuracy:g} {output.unit}"
        for output, seen in zip(system.outputs, np.isfinite(readings).any(axis=1), strict=True)
        if seen and preset not in output.noise
    }


@dataclass(frozen=True)
class NoiseModel:
    """Error of each output.

    ``white`` (outputs,) standard deviation of each reading [unit of the output]; ``slow`` (outputs,) that of the slow
    part [unit of the output], 0 for none; ``time`` (outputs,) its correlation time [s].
    """

    white: np.ndarray
    slow: np.ndarray
    time: np.ndarray

    @classmethod
    def white_only(cls, sd: np.ndarray) -> NoiseModel:
        """White noise alone."""
        sd = np.asarray(sd, dtype=float)
        return cls(sd, np.zeros_like(sd), np.full_like(sd, 24 * HOUR))

    @property
    def sd(self) -> np.ndarray:
        """Standard deviation of one reading, shape (outputs,) [unit of the output]."""
        return np.asarray(np.hypot(self.white, self.slow))

    def whiten(self, values: np.ndarray, observed: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Rows of observed readings, decorrelated and standardised.

        Parameters
        ----------
        values
            Shape (outputs, steps) or (outputs, steps, n) [unit of the output].
        observed
            Readings that count, shape (outputs, steps).
        time
            Times of the steps, shape (steps,) [s].

        Returns
        -------
        numpy.ndarray
            Shape (readings,) or (readings, n), output by output.
        """
        parts = []
        for k, seen in enumerate(observed):
            rows = values[k, seen]
            if self.slow[k] <= 0 or not len(rows):
                parts.append(rows / self.white[k])
                continue
            gains, sds, decay = self._filter(k, time[seen])
            made, state = np.empty_like(rows), np.zeros(rows.shape[1:])
            for i in range(len(rows)):
                state = decay[i] * state
                innovation = rows[i] - state
                made[i] = innovation / sds[i]
                state = state + gains[i] * innovation
            parts.append(made)
        return np.concatenate(parts)

    def logdet(self, observed: np.ndarray, time: np.ndarray) -> float:
        """Logarithm of the determinant of the covariance of the observed readings."""
        total = 0.0
        for k, seen in enumerate(observed):
            if self.slow[k] <= 0:
                total += 2 * np.log(self.white[k]) * int(seen.sum())
            elif seen.any():
                total += 2 * float(np.sum(np.log(self._filter(k, time[seen])[1])))
        return total

    def _filter(self, k: int, time: np.ndarray) -> tuple[list[float], list[float], list[float]]:
        """Gains, standard deviations of innovations and decays of one output's filter, each (steps,)."""
        decay = np.exp(-np.diff(time, prepend=time[0]) / self.time[k]).tolist()
        noise, stationary = float(self.white[k]) ** 2, float(self.slow[k]) ** 2
        variance, gains, sds = stationary, [], []
        for i, phi in enumerate(decay):
            if i:
                variance = phi * phi * variance + (1 - phi * phi) * stationary
            total = variance + noise
            gain = variance / total
            gains.append(gain)
            sds.append(total**0.5)
            variance *= 1 - gain
        return gains, sds, decay

    def draw(self, rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
        """One draw of the error at all times, shape (outputs, steps) [unit of the output]."""
        count = len(time)
        made = self.white[:, None] * rng.standard_normal((len(self.white), count))
        decay = np.exp(-np.diff(time)[None] / self.time[:, None])
        steps = rng.standard_normal((len(self.white), count))
        state = self.slow * steps[:, 0]
        made[:, 0] += state
        for i in range(1, count):
            phi = decay[:, i - 1]
            state = phi * state + np.sqrt(1 - phi**2) * self.slow * steps[:, i]
            made[:, i] += state
        return made


def estimated(noise: NoiseModel, residual: np.ndarray, observed: np.ndarray, time: np.ndarray) -> NoiseModel:
    """Most likely noise of residuals (outputs, steps) [unit of the output], never below the given white noise.

    What has more parameters must earn more than they cost (Akaike's criterion): the given white noise has none, a
    larger one has one, and one with a slow error has three. Both are in each other's reach: an error that is slow over
    one step is nearly white. So the third is looked for from a slow and from a white beginning.
    """
    white, slow, spans = noise.white.copy(), noise.slow.copy(), noise.time.copy()
    step = float(np.median(np.diff(time)))
    for k, seen in enumerate(observed):
        if seen.sum() < 10:
            continue
        floor, rows, at = float(noise.white[k]), residual[k, seen], time[seen]
        larger = max(floor, float(np.sqrt(np.mean(rows**2))))
        models = [(floor, 0.0, float(spans[k])), (larger, 0.0, float(spans[k])), _slower(floor, larger, rows, at, step)]
        costs = [_deviance(one, rows, at) + cost for one, cost in zip(models, (0, 2, 6), strict=True)]
        white[k], slow[k], spans[k] = models[int(np.argmin(costs))]
    return replace(noise, white=white, slow=slow, time=spans)


def _slower(floor: float, spread: float, rows: np.ndarray, at: np.ndarray, step: float) -> tuple[float, float, float]:
    """Most likely white noise, at least ``floor``, size and correlation time [s] of a slow error of readings (n,)."""

    def sizes(x: np.ndarray) -> tuple[float, float, float]:
        one, two, three = (float(np.exp(min(size, 20.0))) for size in x)
        return floor * float(np.hypot(1, one)), floor * two, step + HOUR * min(three, LONGEST)

    whole, little, hours = np.log(max(spread / floor, 0.3)), -2.0, np.log(12.0)
    best = [
        minimize(
            lambda x: _deviance(sizes(x), rows, at),
            begin,
            method="Nelder-Mead",
            # the usual first simplex is a twentieth of each number: too small to leave where it begins
            options={
                "maxiter": 200,
                "xatol": 0.02,
                "fatol": 0.05,
                "initial_simplex": np.vstack([begin, begin + np.eye(3)]),
            },
        )
        for begin in (np.array([little, whole, hours]), np.array([whole, little, hours]))
    ]
    return sizes(min(best, key=lambda one: one.fun).x)


def _deviance(noise: tuple[float, float, float], rows: np.ndarray, at: np.ndarray) -> float:
    """Twice the negative log likelihood, without its constant, of readings (n,) of one output at times (n,) [s].

    ``noise`` are its white noise, and size and correlation time [s] of its slow error: :class:`NoiseModel`'s filter,
    without its gains.
    """
    white, slow, memory = noise
    if slow <= 0:
        return float(rows @ rows) / white**2 + 2 * len(rows) * float(np.log(white))
    state, variance, found = 0.0, slow**2, 0.0
    decays = np.exp(-np.diff(at, prepend=at[0]) / memory).tolist()
    for phi, reading in zip(decays, rows.tolist(), strict=True):
        state *= phi
        variance = phi * phi * variance + (1 - phi * phi) * slow**2
        total, innovation = variance + white**2, reading - state
        found += innovation * innovation / total + log(total)
        gain = variance / total
        state += gain * innovation
        variance *= 1 - gain
    return found
