"""Recordings: outputs and inputs over time, as measured or as ``datagen simulate`` wrote them."""

from __future__ import annotations

from collections.abc import Container, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from datagen.driving.tables import Piecewise
from shared.errors import RecordingError
from shared.reading import shown
from shared.schema import ASSUMED, COMPUTED, EPOCH, method_fault, methods_of, of_another
from shared.stretches import Steps, Stretch, chosen
from shared.system import System
from shared.times import read_recorded, recorded_begins, recorded_times, time_zero
from shared.variables import WeatherInput

HOUR = 3600.0
DAY = 24 * HOUR
WEEK, YEAR = np.timedelta64(7, "D"), np.timedelta64(372, "D")
ZERO = np.datetime64(EPOCH, "s")
"""Time zero of simulated years."""
ROUNDED = 0.1
"""By how much the end of a recording may move where its step is taken for a whole number of milliseconds [s]."""


@dataclass(frozen=True)
class Recording:
    """What was measured on a regular grid.

    ``time`` (steps,) ends of the steps [s since time zero of the year]; ``outputs`` (outputs, steps) in the order and
    units of the system description, NaN where nothing was measured; ``inputs`` by name, each (steps,). ``zero`` is the
    date from which time runs: that of simulated years if the recording names none. ``assumed`` says of inputs that an
    import filled in altogether what stands in for them; ``computed`` says of those that it worked out of others how.
    ``given`` are the description's given facts that it brings, by name [unit of the description].
    ``data`` is the whole Dataset that it was taken from, where that was in memory and not in the file at ``path``.
    """

    path: Path
    step: float
    time: np.ndarray
    outputs: np.ndarray
    inputs: dict[str, np.ndarray]
    zero: np.datetime64 = ZERO
    assumed: dict[str, str] = field(default_factory=dict)
    computed: dict[str, str] = field(default_factory=dict)
    given: dict[str, float] = field(default_factory=dict)
    data: xr.Dataset | None = field(default=None, repr=False, compare=False)

    @property
    def start(self) -> float:
        """Start of the first step [s]."""
        return float(self.time[0] - self.step)

    @property
    def stop(self) -> float:
        """End of the last step [s]."""
        return float(self.time[-1])

    @property
    def began(self) -> str:
        """When it began, to the minute, by its own clock."""
        begin = self.zero + np.timedelta64(round(self.start), "s")
        return str(begin.astype("datetime64[m]")).replace("T", " ")

    def times(self, data: xr.Dataset) -> np.ndarray:
        """The times of its file, decoded, as this recording counts them, shape (time,) [s]."""
        return _since_time_zero(self.path, data) - _after_time_zero(self.zero)


def _since_time_zero(path: Path, data: xr.Dataset) -> np.ndarray:
    return recorded_times(path, data) + recorded_begins(path, data, 1)


def _after_time_zero(date: np.datetime64) -> float:
    return float((date - ZERO) / np.timedelta64(1, "s"))


def needed_inputs(
    system: System, recorded: Iterable[str], *, replay: bool = False, occupancy: str | None = None
) -> list[str]:
    """Of the inputs that were recorded, those that a simulation reads.

    It does not read actuators in whose place the FMU's controllers act, nor persons who are to be taken for unknown.
    """
    idle = {one.name for one in system.inputs if one.source == "measured" and system.replay and not replay}
    idle |= {one.name for one in system.inputs if one.source == "occupancy" and occupancy == "unknown"}
    return [name for name in recorded if name not in idle]


def sentence_on_missing(system: System, recorded: Container[str]) -> str:
    """Which inputs a simulation lacks that were not recorded, and where to write them; "" where it lacks none.

    Weather has no stand-in, nor has a measured input in whose place no controller of the FMU acts.
    """
    lacking = [
        one
        for one in system.inputs
        if one.name not in recorded
        if isinstance(one, WeatherInput) or (one.source == "measured" and not system.replay)
    ]
    if not lacking:
        return ""
    names = ", ".join(f"{one.name} [{one.unit}]" for one in lacking)
    tables = [
        f"[weather.{one.column}]" if isinstance(one, WeatherInput) else f"[variables.{one.name}]" for one in lacking
    ]
    return (
        f"not recorded, and needed by a simulation: {names}; expected"
        f" a column of the log for each, named in the import's mapping under {', '.join(dict.fromkeys(tables))}"
    )


def read_recording(
    given: Path | str | xr.Dataset,
    system: System,
    *,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
    said: bool = True,
) -> Recording:
    """Read a stretch of a recording in which all inputs have values, and hold it against the system description.

    Parameters
    ----------
    given
        The recording: a NetCDF file, or a Dataset in memory.
    replay, occupancy
        What the recording is for, as in :func:`diagnosis.calibrating.calibration.calibrate`: inputs that are not read
        then may have gaps, and are left out if they have.
    stretch
        Which stretch is taken; the longest, if not given.
    said
        Whether the stretches that there are, and which is taken, is logged.

    Raises
    ------
    RecordingError
        If the file is unreadable, has no regular time, no output of the system, or a variable in another unit or of
        another kind: a mean for an instant, or the other way round; or if it has no stretch of a day, or not the one
        that was chosen.
    """
    path, data = read_recorded(given)
    whole = data if isinstance(given, xr.Dataset) else None
    if "system" in data.dims:
        if data.sizes["system"] != 1:
            raise RecordingError(f"{path}: holds {data.sizes['system']} systems; expected a recording of one")
        data = data.isel(system=0)
    time = _since_time_zero(path, data)
    if len(time) < 2:
        raise RecordingError(f"{path}: time is shorter than two steps; expected a regular time coordinate")
    if not np.isfinite(time).all():
        raise RecordingError(f"{path}: time has values that are not finite; expected a regular time coordinate")
    steps = np.diff(time)
    if (steps <= 0).any():
        at = int(np.argmax(steps <= 0))
        raise RecordingError(
            f"{path}: time runs backwards or stands still after step {at + 1}: {time[at]:g} s, then"
            f" {time[at + 1]:g} s; expected times that increase"
        )
    if not np.allclose(steps, steps[0], rtol=0, atol=1e-3):
        raise RecordingError(f"{path}: time is not regular (steps of {steps.min():g} to {steps.max():g} s)")
    step, time = _exact(time)

    methods = methods_of(system)
    other = of_another(data.attrs, system.name, "the system description")

    def series(name: str, unit: str) -> np.ndarray:
        found = data[name].attrs.get("units", "")
        if not isinstance(found, str) or found != unit:
            raise RecordingError(f"{path}: {name!r} is in {shown(found)}; the system description has {unit!r}{other}")
        if fault := method_fault(data[name], methods[name], "by the system description"):
            raise RecordingError(f"{path}: {name!r} {fault}{other}")
        if data[name].dims != ("time",):
            raise RecordingError(f"{path}: {name!r} has dimensions {data[name].dims}; expected ('time',)")
        return data[name].values.astype(float)

    measured = [o.name for o in system.outputs if o.name in data]
    if not measured:
        raise RecordingError(f"{path}: none of the outputs {', '.join(system.output_names)} is in it{other}")
    outputs = np.stack(
        [series(o.name, o.unit) if o.name in data else np.full(len(time), np.nan) for o in system.outputs]
    )
    inputs = {i.name: series(i.name, i.unit) for i in system.inputs if i.name in data}
    needed = needed_inputs(system, inputs, replay=replay, occupancy=occupancy)
    seconds = np.round(time).astype("timedelta64[s]")
    known = {name: np.isfinite(inputs[name]) for name in needed}
    unknown = {one.name: "--occupancy unknown" for one in system.inputs if one.source == "occupancy"}
    part = slice(*chosen(Steps(path, ZERO + seconds, step), known, stretch, unknown, said=said))
    time, outputs = time[part], outputs[:, part]
    inputs = {name: values[part] for name, values in inputs.items() if np.isfinite(values[part]).all()}
    zero = _zero(time[0] - step, str(data["time"].encoding.get("units", "")))
    time = time - _after_time_zero(zero)
    cut = data.isel(time=part)
    comments = {name: str(data[name].attrs.get("comment", "assumed")) for name in inputs}
    assumed = {name: what for name, what in comments.items() if _flags(cut, name, ASSUMED).all()}
    computed = {name: what for name, what in comments.items() if _flags(cut, name, COMPUTED).any()}
    return Recording(path, step, time, outputs, inputs, zero, assumed, computed, _given(path, data, system), whole)


def _given(path: Path, data: xr.Dataset, system: System) -> dict[str, float]:
    """The given facts of a building that a recording brings, by name [unit of the description]."""
    found = {}
    for one in system.given:
        fact = data.get(one.name)
        if fact is None or fact.attrs.get("role") != "given":
            continue
        unit = fact.attrs.get("units")
        if fact.dims or unit != one.unit or not np.isfinite(fact.item()):
            raise RecordingError(
                f"{path}: given fact {one.name!r} is {shown(fact.values.tolist())} in {shown(unit)}; expected one"
                f" number in {one.unit!r}"
            )
        found[one.name] = float(fact)
    return found


def _exact(time: np.ndarray) -> tuple[float, np.ndarray]:
    """The step [s] and times (steps,) that are whole numbers of it apart, of times that are so but for rounding.

    Numbers of hours since 1900 tell no instant to better than a microsecond, and every simulation adds the first step
    up over the whole recording.
    """
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    step = round(mean, 3) if abs(mean - round(mean, 3)) * (len(time) - 1) < ROUNDED else mean
    return step, round(float(time[0]), 3) + step * np.arange(len(time))


def _flags(data: xr.Dataset, name: str, bit: int) -> np.ndarray:
    """In which steps an import has set a quality flag of a variable, shape (steps,); in none without flags."""
    flags = data.get(f"{name}_flag")
    if flags is None or flags.dtype.kind not in "iu":
        return np.zeros(data.sizes["time"], dtype=bool)
    return np.asarray((flags.values & bit) > 0)


def _zero(begin: float, units: str) -> np.datetime64:
    """The date to count from [begin in s since time zero of simulated years]: the Monday that the file counts from.

    Where it counts from another day, or from one that is long past, it is the Monday nearest to 1 January.
    """
    first = ZERO + np.timedelta64(round(begin), "s")
    named = units.partition(" since ")[2].strip().replace(" ", "T")
    with suppress(ValueError):
        counted = np.datetime64(named, "s")
        monday = (counted - ZERO) % WEEK == np.timedelta64(0, "s")
        if monday and np.timedelta64(0, "s") <= first - counted <= YEAR:
            return counted
    return np.datetime64(time_zero(first.astype("M8[D]").item()).isoformat(), "s")


def check_warm_up(recording: Recording, warm_up: float) -> None:
    """Refuse to simulate a recording whose first day is not repeated before it.

    Raises
    ------
    RecordingError
        If ``warm_up`` [s] is less than a step, or endless.
    """
    if not recording.step <= warm_up < np.inf:
        raise RecordingError(
            f"warm_up is {warm_up / HOUR:g} h; expected at least a step of the recording, {recording.step / HOUR:g} h:"
            " without it the FMU's start values would count as known"
        )


def whole_days(recording: Recording, lead: int) -> int:
    """Steps of the first day, repeated as often as fills at least ``lead`` steps."""
    day = _first_day(recording)
    return -(-lead // day) * day


def extended(recording: Recording, values: np.ndarray, lead: int, *, held: bool) -> Piecewise:
    """A series (steps,) with its first day repeated before it, whole, for at least ``lead`` steps.

    Steps that end at its times where it is ``held``, or straight lines between them.
    """
    before, day = whole_days(recording, lead), _first_day(recording)
    time = np.concatenate([recording.time[0] - recording.step * np.arange(before, 0, -1), recording.time])
    values = np.concatenate([np.tile(values[:day], before // day), values])
    return Piecewise(time - recording.step, values, "previous") if held else Piecewise(time, values)


def _first_day(recording: Recording) -> int:
    """Steps of the first day: of the whole recording where that is shorter."""
    return max(min(round(DAY / recording.step), len(recording.time)), 1)
