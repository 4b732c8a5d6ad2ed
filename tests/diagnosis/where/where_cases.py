"""Residuals with a known null, for the tests of where the gap lies."""

import numpy as np
from scipy.signal import lfilter

from diagnosis.where import Operator, Residuals

HOUR = 3600.0


def wander(rng, shape, phi=0.97):
    """Stationary AR(1) series of unit variance along the last axis."""
    noise = rng.normal(size=shape) * np.sqrt(1 - phi**2)
    noise[..., 0] = rng.normal(size=shape[:-1])
    return lfilter([1.0], [1.0, -phi], noise, axis=-1)


def twins(seed=0, *, outputs=2, steps=672, twins=99, step=HOUR, phi=0.97, names=None):
    """A recording without a gap and its twins; time zero is a Monday."""
    rows = wander(np.random.default_rng(seed), (twins + 1, outputs, steps), phi)
    return Residuals(
        time=(np.arange(steps) + 1) * step,
        observed=rows[0],
        replicates=rows[1:],
        names=names or [f"y{k}" for k in range(outputs)],
        units=["K", "ppm", "W", "kg/s"][:outputs],
    )


def with_observed(residuals, observed):
    return Residuals(
        residuals.time,
        observed,
        residuals.replicates,
        residuals.names,
        residuals.units,
        residuals.labels,
    )


def first_order(steps, time_constant, gain, outputs=1, output=0, per=1):
    """Response of ``output`` to unit pulses of a source through a first-order lag; times in steps."""
    ages = np.arange(steps)[:, None] - np.arange(steps)
    response = np.zeros((outputs, steps, steps))
    response[output] = np.where(ages >= 0, gain * np.exp(-np.maximum(ages, 0) / time_constant), 0.0)
    return response.reshape(outputs, steps, steps // per, per).sum(axis=3)


def heat(response, step=HOUR):
    pulses = response.shape[2]
    edges = np.linspace(0, response.shape[1] * step, pulses + 1)
    return Operator("heat", "missing heat", "W", response, edges)
