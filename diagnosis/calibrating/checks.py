"""What a recording must be for a calibration: long enough, moving, and in the units that it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from diagnosis.fitting.noise import errors_under
from diagnosis.recording import DAY, HOUR, Recording, check_warm_up, read_recording
from shared.errors import RecordingError
from shared.stretches import LONGEST, Stretch
from shared.system import System, load_system
from shared.units import ABSOLUTE, spelled
from shared.variables import ConstantInput, ExcitationInput, Input, MeasuredInput, ScheduleInput


def opened(
    system: System | Path | str,
    recording: Recording | Path | str,
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
    recording: Recording | Path | str,
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


def check_recording(recording: Recording, system: System) -> None:
    """Refuse what cannot be calibrated on.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day, or an output is constant or impossible for its unit.
    """
    span = recording.stop - recording.start
    if span < DAY:
        raise RecordingError(
            f"{recording.path}: is {span / HOUR:g} h long; expected at least a day, better a week or more"
        )
    for output, values in zip(system.outputs, recording.outputs, strict=True):
        seen = values[np.isfinite(values)]
        if len(seen) and (seen == seen[0]).all() and output.name not in _replayed(system):
            raise RecordingError(
                f"{recording.path}: {output.name!r} is {seen[0]:g} {output.unit} throughout; expected a reading that"
                " moves: drop the column if the sensor was stuck"
            )
        check_unit(recording, output.name, output.unit, seen)
    for one in system.inputs:
        if one.name in recording.inputs and not _is_difference(one, system):
            check_unit(recording, one.name, one.unit, recording.inputs[one.name])


def check_unit(recording: Recording, name: str, unit: str, values: np.ndarray) -> None:
    """Refuse values that cannot be in their unit: a temperature declared in kelvin that is in degrees Celsius.

    Raises
    ------
    RecordingError
        Naming the variable.
    """
    if spelled(unit) == "K" and len(values) and float(np.median(values)) < ABSOLUTE:
        raise RecordingError(
            f"{recording.path}: {name!r} is declared in K but is {np.median(values):.3g} at the median; expected"
            " kelvin: these look like degC, convert them"
        )
    if spelled(unit) == "degC" and len(values) and float(np.median(values)) > ABSOLUTE:
        raise RecordingError(
            f"{recording.path}: {name!r} is declared in degC but is {np.median(values):.3g} at the median; expected"
            " degrees Celsius: these look like K, convert them"
        )


def _is_difference(one: Input, system: System) -> bool:
    """Whether an input in K is a difference of temperature by its description: an excitation, or values near 0 K."""
    if isinstance(one, ExcitationInput):
        return True
    said: list[float] = []
    if isinstance(one, ConstantInput):
        said = [one.value]
    elif isinstance(one, MeasuredInput):
        said = [one.value] if one.value else []  # 0 is what stands there where none was given
    elif isinstance(one, ScheduleInput):
        hours = system.schedules[one.schedule]
        said = [value for _, value in [*hours.weekday, *(hours.weekend or [])]]
    return spelled(one.unit) == "K" and bool(said) and max(abs(value) for value in said) < ABSOLUTE


def _replayed(system: System) -> set[str]:
    """Outputs that may be replayed: an actuator may well stand still."""
    return {one.column for one in system.inputs if one.source == "measured"}
