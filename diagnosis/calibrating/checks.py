"""A system and a recording, read and held against each other before a simulation."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from diagnosis.fitting.noise import errors_under
from diagnosis.physics import check_recording
from diagnosis.recording import HOUR, Recording, check_warm_up, read_recording
from shared.errors import RecordingError
from shared.stretches import LONGEST, Stretch
from shared.system import System, load_system


def opened(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
    *,
    noise: str,
    warm_up: float,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
) -> tuple[System, Recording]:
    """A system with the experiment of a recording, and the recording: whatever is wrong is said before a simulation.

    Parameters
    ----------
    noise
        A noise preset of the description.
    warm_up
        The recording's first day is repeated this long before its start [h].
    replay, occupancy, stretch
        As of :func:`diagnosis.recording.read_recording`.

    Raises
    ------
    SystemDescriptionError
        If the description cannot be used, or has no such preset.
    RecordingError
        If the recording cannot be read or calibrated on, or there is no warm-up.
    """
    described = system if isinstance(system, System) else load_system(system)
    errors_under(described, noise)
    record = taken(described, recording, replay=replay, occupancy=occupancy, stretch=stretch)
    check_recording(record, described)
    check_warm_up(record, warm_up * HOUR)
    return described.with_experiment(step=record.step, hours=len(record.time) * record.step / HOUR), record


def taken(
    system: System,
    recording: Recording | Path | str | xr.Dataset,
    *,
    replay: bool,
    occupancy: str | None,
    stretch: Stretch | None,
) -> Recording:
    """A recording as it is, or the stretch of one that is read from a file.

    Raises
    ------
    RecordingError
        If it cannot be read, or is in memory and a stretch of it is asked for.
    """
    if not isinstance(recording, Recording):
        return read_recording(recording, system, replay=replay, occupancy=occupancy, stretch=stretch)
    if stretch not in (None, LONGEST):
        raise RecordingError(
            f"{recording.path}: stretch is given with a recording that has been read; expected it of read_recording"
        )
    return recording
