"""How the truth is measured: noise with colour, rounding, lost readings; and the file that is published."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from diagnosis.blind.generator import Made
from diagnosis.blind.processes import autoregressive
from diagnosis.blind.truth import Truth
from diagnosis.recording import HOUR
from shared.errors import RecordingError
from shared.schema import EPOCH, methods_of
from shared.store import write_atomically
from shared.system import System
from shared.variables import Noise

_FORMAT: Literal["NETCDF3_64BIT"] = "NETCDF3_64BIT"
"""A format without time stamps, compression or creation order: equal contents give equal bytes and sizes."""


def measured(made: Made, system: System, truth: Truth) -> tuple[np.ndarray, dict[str, dict[str, float]]]:
    """The outputs as measured, shape (outputs, steps) [unit of each], NaN where lost; and each sensor's noise.

    A part of the noise's variance is white, the rest an AR(1) process; then come rounding and losses.
    """
    campaign, rng = truth.measuring, made.case.rng("noise")
    step = float(made.time[1] - made.time[0])
    shown, noises = made.clean.copy(), {}
    for k, output in enumerate(system.outputs):
        sensor = output.noise.get(campaign.noise, Noise())
        hours = float(np.exp(rng.uniform(*np.log(campaign.hours))))
        white = rng.standard_normal(len(made.time)) * sensor.sd * np.sqrt(1.0 - campaign.slow)
        slow = autoregressive(rng, len(made.time), hours * HOUR / step) * sensor.sd * np.sqrt(campaign.slow)
        shown[k] += white + slow
        if sensor.quantum:
            shown[k] = np.round(shown[k] / sensor.quantum) * sensor.quantum
        shown[k, rng.random(len(made.time)) < sensor.dropout] = np.nan
        noises[output.name] = {"sd": sensor.sd, "slow_share": campaign.slow, "hours": hours}
    return shown, noises


def published(made: Made, outputs: np.ndarray, system: System, truth: Truth) -> xr.Dataset:
    """The recording as the diagnosis gets it: variables and attributes depend on the public conditions alone."""
    rng = made.case.rng("inputs")
    variables: dict[str, Any] = {}
    methods = methods_of(system)
    for k, output in enumerate(system.outputs):
        attrs = {"long_name": output.long_name or output.name, "units": output.unit, "role": "output"}
        attrs["cell_methods"] = f"time: {methods[output.name]}"
        variables[output.name] = (("time",), outputs[k].astype(np.float32), attrs)
    for one in system.inputs:
        error = rng.standard_normal(len(made.time)) * truth.measuring.inputs.get(one.name, 0.0)
        if one.name not in made.inputs:
            continue
        attrs = {"long_name": f"input {one.name}", "units": one.unit, "role": "input"}
        attrs["cell_methods"] = f"time: {methods[one.name]}"
        variables[one.name] = (("time",), (made.inputs[one.name] + error).astype(np.float32), attrs)
    clock = {"long_name": "end of the step", "units": f"seconds since {EPOCH}", "calendar": "standard"}
    attrs = {
        "Conventions": "CF-1.11",
        "title": "Recording of a blind check",
        "system_name": system.name,
        "occupancy": "unknown" if made.case.unknown_occupancy else "measured",
        "actuators": "replayed" if made.case.replay else "controlled",
    }
    return xr.Dataset(variables, {"time": (("time",), made.time, clock)}, attrs)


def write(path: Path, recording: xr.Dataset) -> None:
    """Write a recording whole.

    Raises
    ------
    RecordingError
        If it cannot be written; what was there is as it was.
    """
    encoding = {str(name): {"_FillValue": None} for name in recording.variables}
    # in memory: where a disk is full, the C library loses its hold of a file of this format, and later the process
    content = recording.to_netcdf(None, engine="scipy", format=_FORMAT, encoding=encoding)
    try:
        write_atomically(path, bytes(content))
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be written ({error.strerror or error}); expected a place with free space; the same call"
            " goes on from there"
        ) from None
