"""Recorded trajectories in place of a second FMU: CSV files of another tool, and a TOML that says what is in them.

    [recorded]
    cases = "rooms.csv"                  # a row for each room, with its parameters; any CSV may be gzipped
    name = "room"                        # its column that names the room
    series = "room{name}.csv"            # one file a room: its outputs, and inputs of its own
    shared = "weather.csv"               # inputs that all rooms share (may be left out)
    time = "time_s"                      # column [s since 1 January 00:00 local standard time], evenly spaced
    jumps = "after"                      # what an instant shows where an input jumps: the value "before" or "after"
    discard_hours = 240.0                # the start is not compared: initial states differ

    [recorded.parameters]                # the description's parameter = column of the cases
    "room.volume" = "V"
    [recorded.inputs]                    # an input = column, of the room's file or the shared one
    T_outdoor = { column = "Tout_degC", add = 273.15 }
    persons = { column = "n", interpolation = "previous" }      # constant from its row on
    [recorded.outputs]
    T_room = { column = "T" }
    Q_heater = { column = "Q", method = "mean" }                # mean since the row before; "point": an instant
    [recorded.fixed]                     # parameters of the FMU that are not estimated but known of these rooms
    "wall.C" = 3e4
    [recorded.sun]                       # an irradiance input from direct, diffuse and global irradiance
    input = "sun_on_facade"
    method = "mean"                      # since the row before, as weather files have it; "point" (default): an instant
    dni = "dni_W_m2"
    dhi = "dhi_W_m2"
    ghi = "ghi_W_m2"
    latitude = 42.0
    longitude = -88.0
    utc_offset = -6.0

A value is ``column * factor + add``. Schedules and constants that no column gives come from the system description;
excitation is off.
"""

from __future__ import annotations

import gzip
import io
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from pydantic import Field

from datagen.comparing.recorded_sun import Sun
from datagen.driving.inputs import build_inputs
from datagen.driving.tables import InputTable, Piecewise
from shared.errors import RecordingError
from shared.reading import MIB, check_columns, listed, read_bytes, read_toml, shown, validated, why
from shared.signals import Table
from shared.system import System
from shared.variables import OccupancyInput, WeatherInput

MOST_CSV = 1024 * MIB
HOUR = 3600.0


class RecordedInput(Table):
    """An input's column."""

    column: str
    factor: float = 1.0
    add: float = 0.0
    interpolation: Literal["linear", "previous"] = "linear"


class RecordedOutput(Table):
    """An output's column; ``mean`` is the mean since the row before."""

    column: str
    factor: float = 1.0
    add: float = 0.0
    method: Literal["point", "mean"] = "point"


class Recorded(Table):
    """What a mapping says; see the module."""

    cases: str
    name: str
    series: str
    shared: str = ""
    time: str
    jumps: Literal["before", "after"] = "before"
    discard_hours: float = Field(0.0, ge=0)
    parameters: dict[str, str]
    inputs: dict[str, RecordedInput]
    outputs: dict[str, RecordedOutput] = Field(min_length=1)
    fixed: dict[str, float | bool] = {}
    sun: Sun | None = None
    folder: Path = Path()


class _File(Table):
    recorded: Recorded


@dataclass(frozen=True)
class Case:
    """One recorded room: its name and parameters by name [unit of the description]."""

    name: str
    parameters: dict[str, float]


def load_recorded(mapping: Path, system: System, folder: Path | None = None) -> tuple[Recorded, list[Case]]:
    """Read a mapping and the cases that it names; ``folder`` holds the CSV files, by default the mapping's own.

    Raises RecordingError if the mapping or the cases cannot be read, or do not give what the description needs.
    """
    raw = read_toml(mapping, RecordingError, "a mapping (TOML)")
    if set(raw) != {"recorded"} or not isinstance(raw["recorded"], dict):
        raise RecordingError(f"{mapping}: tables are {listed(raw) or 'none'}; expected [recorded] alone")
    given = {**raw["recorded"], "folder": folder or mapping.parent}
    spec = validated(_File, {"recorded": given}, f"{mapping}", RecordingError).recorded
    _check(mapping, spec, system)
    path = spec.folder / spec.cases
    table = _read_csv(path)
    columns = {name: _column(table, column, path) for name, column in spec.parameters.items()}
    labels = _column(table, spec.name, path, numbers=False)
    cases = [
        Case(str(label), {name: float(values[k]) for name, values in columns.items()}) for k, label in enumerate(labels)
    ]
    if not cases:
        raise RecordingError(f"{path}: has no row; expected one for each recorded system")
    names = [case.name for case in cases]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(
            f"{path}: column {spec.name!r} has {shown(twice[0])} in more than one row; expected another name in each"
        )
    return spec, cases


def series_of(spec: Recorded, case: Case, system: System) -> tuple[np.ndarray, dict[str, np.ndarray], InputTable]:
    """Times (rows,) [s], recorded outputs by name (rows,), and the inputs that drove them.

    Raises RecordingError if a file or a column is missing, times are not evenly spaced, or the sun's columns are of the
    other method.
    """
    path = spec.folder / spec.series.replace("{name}", case.name)
    own, time = _series(path, spec.time)
    shared = (spec.folder / spec.shared, *_series(spec.folder / spec.shared, spec.time)) if spec.shared else None

    def find(column: str) -> tuple[Path, np.ndarray, np.ndarray]:
        if shared is not None and column not in own and column in shared[1]:
            return shared[0], shared[2], _column(shared[1], column, shared[0])
        return path, time, _column(own, column, path)

    signals = {}
    for name, one in spec.inputs.items():
        _, at, values = find(one.column)
        _covers(path, name, at, time)
        signals[name] = Piecewise(at, values * one.factor + one.add, one.interpolation)
    if spec.sun is not None:
        columns = [find(column) for column in (spec.sun.dni, spec.sun.dhi, spec.sun.ghi)]
        signals[spec.sun.input] = _sun_signal(spec.sun, system, path, time, columns)
    outputs = {n: _column(own, o.column, path) * o.factor + o.add for n, o in spec.outputs.items()}
    table = build_inputs(
        system,
        root_seed=0,
        index=0,
        start=float(time[0]),
        stop=float(time[-1]),
        excitation=False,
        overrides=signals,
    )
    return time, outputs, table


def compared(spec: Recorded, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of a recording's times (rows,) [s], those that bound steps (steps + 1,), and which steps count (steps,)."""
    rows = time[:-1] if spec.jumps == "after" else time  # the last row has no after
    return rows, rows[1:] - rows[0] > spec.discard_hours * HOUR


def check_lengths(mapping: Path, spec: Recorded, cases: list[Case]) -> None:
    """Look at the times of all recordings before any is simulated: a comparison is a table of rooms by steps.

    Raises RecordingError if a file cannot be read, nothing of it is left to compare, or it is not as long as the
    others.
    """
    first, steps = Path(), 0
    for case in cases:
        path = spec.folder / spec.series.replace("{name}", case.name)
        rows, counts = compared(spec, _series(path, spec.time)[1])
        found = int(counts.sum())
        if not found:
            raise RecordingError(
                f"{mapping}: recorded.discard_hours is {spec.discard_hours:g}; expected less than the "
                f"{(rows[-1] - rows[0]) / HOUR:g} h that {path} spans"
            )
        if steps and found != steps:
            raise RecordingError(
                f"{path}: has {found} steps to compare, {first} has {steps}; expected as many of each, or those of "
                "another length in a mapping of their own"
            )
        first, steps = first if steps else path, found


def _sun_signal(
    sun: Sun, system: System, path: Path, time: np.ndarray, columns: list[tuple[Path, np.ndarray, np.ndarray]]
) -> Piecewise:
    """The plane's irradiance over ``time`` [s], from columns each with its file and its times."""
    assert system.weather is not None  # held by _check
    where, at = columns[0][:2]
    if others := {name for name, _, _ in columns} - {where}:
        raise RecordingError(
            f"{where}: has the column {sun.dni!r} of recorded.sun, others are in {', '.join(map(str, others))}; "
            "expected all three in one file"
        )
    _covers(path, sun.input, at, time)
    try:
        return sun.signal(system.weather, at, *(values for _, _, values in columns))
    except RecordingError as error:
        raise RecordingError(f"{where}: {error}") from None


def _check(mapping: Path, spec: Recorded, system: System) -> None:
    """The mapping names what the description declares, and leaves no random input to chance."""
    for kind, given, known in (
        ("parameters", spec.parameters, system.parameter_names),
        ("inputs", spec.inputs, system.input_names),
        ("outputs", spec.outputs, system.output_names),
        ("sun.input", [spec.sun.input] if spec.sun else [], system.input_names),
    ):
        for name in given:
            if name not in known:
                raise RecordingError(
                    f"{mapping}: recorded.{kind}: {name!r} is not declared by {system.path}; found {', '.join(known)}"
                )
    for name in system.parameter_names:
        if name in spec.fixed:
            raise RecordingError(
                f"{mapping}: recorded.fixed: {name!r} is an estimated parameter; expected its column under "
                "[recorded.parameters]"
            )
        if name not in spec.parameters:
            raise RecordingError(f"{mapping}: recorded.parameters: no column for {name!r}; expected one for each")
    for one in system.inputs:
        covered = one.name in spec.inputs or (spec.sun is not None and spec.sun.input == one.name)
        if isinstance(one, WeatherInput | OccupancyInput) and not covered:
            raise RecordingError(
                f"{mapping}: recorded.inputs: no column for {one.name!r}, which comes from {one.source}; expected one"
            )
    if spec.sun is not None and system.weather is None:
        raise RecordingError(f"{mapping}: recorded.sun: {system.path} has no [weather] table, which tells the plane")


def _read_csv(path: Path) -> pd.DataFrame:
    data = read_bytes(path, RecordingError, "a CSV file", MOST_CSV)
    try:
        if path.suffix == ".gz":
            with gzip.open(io.BytesIO(data)) as packed:
                data = packed.read(MOST_CSV + 1)
        if len(data) > MOST_CSV:
            raise RecordingError(f"{path}: unpacks to more than {MOST_CSV // MIB} MiB; expected a CSV file")
        text = data.decode("utf-8-sig")
        check_columns(text, ",", f"{path}", RecordingError)
        return pd.read_csv(io.StringIO(text))
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path}: not a readable gzip file: {why(error)}") from None
    except (ValueError, ArithmeticError, LookupError, MemoryError) as error:  # what pandas meets in text that is no CSV
        raise RecordingError(f"{path}: not a readable CSV file: {why(error)}") from None


def _series(path: Path, time: str) -> tuple[pd.DataFrame, np.ndarray]:
    table = _read_csv(path)
    times = _column(table, time, path)
    steps = np.diff(times)
    grid = np.linspace(times[0], times[-1], len(times)) if len(times) > 2 else np.empty(0)
    even = grid.size and (steps > 0).all() and np.ptp(steps) <= 1e-6 * steps[0]
    if not even or np.abs(times - grid).max() > 1e-3 * steps[0]:  # what each step is off by may add up
        raise RecordingError(f"{path}: column {time!r} is not evenly spaced and increasing; expected times [s]")
    return table, grid


def _column(table: pd.DataFrame, column: str, path: Path, numbers: bool = True) -> np.ndarray:
    if column not in table:
        raise RecordingError(f"{path}: no column {column!r}; found {listed(table.columns)}")
    if not numbers:
        return np.asarray(table[column])
    values = pd.to_numeric(table[column], errors="coerce").to_numpy(dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise RecordingError(
            f"{path}: column {column!r} has {shown(str(table[column].iloc[bad[0]]))} in row {bad[0] + 1};"
            " expected a number"
        )
    return values


def _covers(path: Path, name: str, at: np.ndarray, time: np.ndarray) -> None:
    if at[0] > time[0] or at[-1] < time[-1]:
        raise RecordingError(
            f"{path}: input {name!r} is given from {at[0]:g} to {at[-1]:g} s; expected {time[0]:g} to {time[-1]:g} s"
        )
