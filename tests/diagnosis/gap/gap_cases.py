"""Candidates for the small house, and changes of its recordings."""

import xarray as xr

from diagnosis.effects import build
from shared.effects import InputEffect, SensorEffect


def candidates(system):
    """Errors of the room sensor, and of the outdoor temperature."""
    common, swing = {"outputs": ["room"], "kind": "sensor"}, {"form": "diurnal", "peak": 3.0}
    drift = {"name": "drift", "unit": "K", "scale": 1.0, "lower": -8.0, "upper": 8.0, "description": "It drifts"}
    daily = {"name": "swing", "unit": "K", "scale": 1.0, "lower": -5.0, "upper": 5.0, "kind": "input", "input": "To"}
    specs = [
        SensorEffect(operation="drift", **drift, **common),
        SensorEffect(name="lag", unit="h", operation="lag", factor=3600.0, scale=1.0, lower=0.0, upper=8.0, **common),
        SensorEffect(name="gain", unit="1", operation="gain", about=20.0, scale=0.1, lower=-0.6, upper=0.6, **common),
        InputEffect(operation="add", shape=[swing], **daily),
    ]
    return [build(one, system) for one in specs]


def changed(path, change):
    """The recording with its room temperature changed by a function of time [s] and values."""
    data = xr.load_dataset(path, decode_times=False)
    data["room"].values[:] = change(data["time"].values, data["room"].values)
    path.unlink()
    data.to_netcdf(path)
    return path


def drifting(path, by=3.0):
    """The recording with a room sensor that drifts by so much in thirty days [K]."""
    return changed(path, lambda t, y: y + by * (t - t[0]) / (30 * 86400.0))
