"""Sensors of the truth that err, on its own fine steps; see :class:`diagnosis.blind.truth.Fault`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.blind.truth import Fault
from diagnosis.effects.kinds import lagged
from diagnosis.recording import DAY, HOUR


def erring(
    fault: Fault,
    size: float,
    y: np.ndarray,
    time: np.ndarray,
    followed: Mapping[str, np.ndarray | Piecewise],
    path: Piecewise,
) -> np.ndarray:
    """What a sensor with a fault shows, shape (steps,) [unit of the output].

    Parameters
    ----------
    size
        Amplitude * ``amount``.
    y
        What is there, shape (steps,) [unit of the output].
    time
        Ends of the steps [s].
    followed
        States of the FMU (steps,), inputs and weather columns by name.
    path
        The fault's wander: see :func:`diagnosis.blind.processes.wandering`.
    """
    step, elapsed = float(time[1] - time[0]), time - time[0]
    match fault.kind:
        case "wander":
            return np.asarray(y + size * (1.0 + fault.sd * path.at(time)))
        case "walk":
            days = elapsed / DAY
            trend = (1.0 - np.exp(-days / 15.0)) / (1.0 - np.exp(-2.0))
            hourly = time[0] + HOUR * np.arange(np.ceil(elapsed[-1] / HOUR) + 1)
            unit = np.sqrt(2.0 * fault.hours * 30.0 * 24.0)  # the standard deviation after thirty days
            walk = np.cumsum(path.at(hourly)) / unit
            return y + size * (trend + fault.sd * np.interp(time, hourly, walk))
        case "curve":
            away = y - fault.about
            return np.asarray(y + size * away * np.abs(away) / fault.span)
        case "slow":
            return lagged(lagged(y, size / 2.0, step), size / 2.0, step)
        case "clock":
            return np.interp(time + size * (0.5 + elapsed / elapsed[-1]), time, y)
        case "state":
            return np.asarray(y + size * (followed[fault.series] - y))
        case "series":
            series = followed[fault.series]
            x = series.at(time) if isinstance(series, Piecewise) else series
            return np.asarray(y + size * (x - fault.origin) / fault.reference)
