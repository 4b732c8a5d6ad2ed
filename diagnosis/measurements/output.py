"""The recording's file: NetCDF with CF attributes, flags beside the values, written whole or not at all."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.dates
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table as Grid

from diagnosis.curves import as_png, readable
from diagnosis.measurements.clock import Clock
from diagnosis.measurements.grid import Series
from diagnosis.measurements.signal import Signal, usual_gap
from diagnosis.physics import Finding
from diagnosis.recording import needed_inputs, sentence_on_missing
from shared.errors import RecordingError
from shared.netcdf import write_netcdf
from shared.numbers import counted
from shared.results import Result
from shared.schema import ASSUMED, FLAGS, IMPOSSIBLE, INTERPOLATED, SCHEMA_VERSION, STUCK
from shared.store import temporary_name
from shared.stretches import runs, stretches
from shared.system import System
from shared.units import ABSOLUTE
from shared.variables import ZERO_CELSIUS, OccupancyInput

MUCH = 0.05
"""Share of the hours in which outputs were measured: who loses more is told what would keep them."""


@dataclass(frozen=True, eq=False)
class Kept:
    """The steps of a recording that a simulation can use.

    ``series`` are of the recording's span, which begins at ``begin`` [s of the clock]; ``step`` is its step [s], and
    ``valid`` has the lines of the mapping that keep what was left out as impossible, by where they belong.
    """

    series: Sequence[Series]
    system: System
    step: float
    begin: float
    valid: Mapping[str, str]

    @property
    def measured(self) -> np.ndarray:
        """Steps in which any output was measured, (steps,)."""
        outputs = [np.isfinite(one.values) for one in self.series if one.target.role == "output"]
        return np.asarray(np.any(outputs, axis=0))

    @property
    def needed(self) -> list[Series]:
        """The inputs that a simulation reads unless told otherwise."""
        inputs = {one.target.name: one for one in self.series if one.target.role == "input"}
        return [inputs[name] for name in needed_inputs(self.system, inputs)]

    @property
    def crowd(self) -> frozenset[str]:
        """Inputs that are persons: a simulation does without a count of them."""
        return frozenset(one.name for one in self.system.inputs if isinstance(one, OccupancyInput))

    def stretches(self, without: frozenset[str] = frozenset()) -> list[tuple[int, int]]:
        """Stretches of at least a day, ``without`` regard to some inputs; all of a recording without gaps."""
        whole = np.ones(len(self.measured), dtype=bool)
        for one in self.needed:
            whole &= np.isfinite(one.values) | (one.target.name in without)
        return stretches(whole, self.step)

    def hours(self, found: Sequence[tuple[int, int]] | None = None) -> float:
        """Hours in which outputs were measured, of some stretches or of all the recording [h]."""
        measured = self.measured
        count = sum(int(measured[a:b].sum()) for a, b in found) if found is not None else int(measured.sum())
        return count * self.step / 3600.0

    def gaps(self) -> str:
        """Which needed inputs have no value in how many steps; empty if all have."""
        gaps = {one.target.name: int((~np.isfinite(one.values)).sum()) for one in self.needed}
        return ", ".join(f"{name} in {count} steps" for name, count in gaps.items() if count)

    def sentences(self) -> list[str]:
        """What is said of a recording with gaps in its inputs."""
        if not (gaps := self.gaps()):
            return []
        found = self.stretches()
        kept = self.hours(found)
        said = [
            f"inputs have no values ({gaps}): {counted(len(found), 'stretch', 'stretches')} of a day or more without"
            f" gaps hold{'s' * (len(found) == 1)} {kept:g} of {self.hours():g} h in which outputs were measured"
        ]
        if len(found) > 1:
            said.append("a command takes the longest stretch, or another by --stretch, or --from and --to")
        more = self.hours(self.stretches(without=self.crowd))
        if more > kept + MUCH * self.hours():
            said.append(
                f"with --occupancy unknown, {more:g} h: the gaps in {', '.join(sorted(self.crowd))} do not count then"
            )
        return said + self.remedies(MUCH)

    def remedies(self, share: float) -> list[str]:
        """For each reason why inputs lack more than a share of the hours measured, what to write in the mapping."""
        measured = self.measured
        reasons: dict[tuple[str, str, int], list[Series]] = {}
        for one in self.needed:
            lost = measured & ~np.isfinite(one.values)
            if one.key and lost.sum() > share * measured.sum():
                reasons.setdefault((*self._reason(one, lost), int(lost.sum())), []).append(one)
        said = []
        for (why, line, count), lacking in reasons.items():
            names = ", ".join(f"{one.target.name} ({one.origin})" for one in lacking)
            keys = ", ".join(header(key) for key in dict.fromkeys(one.key for one in lacking))
            said.append(
                f"{names}: no value in {count * self.step / 3600:g} of {self.hours():g} h in which outputs were"
                f" measured, {why}; {line} under {keys} would keep them"
            )
        return said

    def _reason(self, one: Series, lost: np.ndarray) -> tuple[str, str]:
        """Why an input has no value in the steps ``lost`` (steps,), and the line of the mapping that gives it one."""
        flags = one.flags[lost]
        if np.mean((flags & STUCK) > 0) > 0.5:
            return "as its readings stand still", "stuck_after = 0.0"
        if np.mean((flags & IMPOSSIBLE) > 0) > 0.5:
            return "as its readings are impossible", self.valid.get(one.key, "valid = [lowest, highest]")
        if one.signal is not None and (line := line_of_spacing(one.signal, self.begin + self.step * np.argmax(lost))):
            return "where its readings are further apart than usual", line
        gaps = [(a, b) for a, b in runs(~np.isfinite(one.values)) if lost[a:b].any()]
        longest = max(b - a for a, b in gaps) * self.step / 3600.0
        if one.signal is not None and one.signal.kind == "hold":
            return f"in gaps of up to {longest:g} h", f"max_gap = {longest + self.step / 3600.0:g}"
        return f"in gaps of up to {longest:g} h", f'fill = "interpolate" with fill_up_to = {longest:.4g}'


def header(key: str) -> str:
    """The header of a table of the mapping, as TOML has it: names with dots are quoted."""
    table, _, name = key.partition(".")
    return f"[{key}]" if re.fullmatch(r"[\w-]+", name, re.ASCII) else f'[{table}."{name}"]'


def about_spacing(signal: Signal, end: float) -> str:
    """How far apart readings are after ``end`` [s], where that is so much further than usual that it leaves gaps."""
    line = line_of_spacing(signal, end)
    if not line:
        return ""
    middle = signal.middle
    usual, apart = float(np.median(np.diff(middle))), float(np.median(np.diff(middle[middle > end])))
    return (
        f": its readings are {apart:g} s apart from there on, and usually {usual:g} s; expected the same spacing"
        f" throughout, or {line}"
    )


def line_of_spacing(signal: Signal, end: float) -> str:
    """The line of a mapping that takes readings after ``end`` [s] for as far apart as they are; empty if none does."""
    middle, length = signal.middle, signal.end - signal.begin
    after = middle > end
    if after.sum() < 2:
        return ""
    usual, apart = float(np.median(np.diff(middle))), float(np.median(np.diff(middle[after])))
    if apart <= usual_gap(usual) or np.median(length[after]) >= apart:
        return ""
    return f"interval = {apart:g}" if signal.kind == "mean" else f"max_gap = {apart / 3600:.3g}"


_MARKS = ((IMPOSSIBLE, "x", "impossible, left out"), (STUCK, ".", "stuck, left out"))


def draw_recording(
    series: Sequence[Series], time: np.ndarray, clock: Clock, title: str, stretches: Sequence[tuple[int, int]] = ()
) -> bytes:
    """PNG of a recording: a panel for each variable that was measured or computed.

    ``time`` are the ends of the steps, (steps,) [s of the clock]; ``stretches`` those in which no input is missing, as
    (first, one past the last): numbered unless there is one of all steps.
    """
    shown = [one for one in series if one.signal is not None]
    figure = Figure(figsize=(13, 1.9 * len(shown) + 0.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axes, one in zip(panels, shown, strict=True):
        _panel(axes, one, time, clock)
    if list(stretches) not in ([], [(0, len(time))]):
        _mark_stretches(panels, stretches, time, clock)
    locator = matplotlib.dates.AutoDateLocator(minticks=4, maxticks=14)
    panels[-1].xaxis.set_major_locator(locator)
    panels[-1].xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator))
    hours = clock.offset / 3600.0
    panels[-1].set_xlabel(f"local standard time (UTC{hours:+g} h, no daylight saving)")
    labels = {text: handle for axes in panels for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    if len(labels) > 1:
        figure.legend(
            list(labels.values()),
            list(labels),
            loc="outside lower center",
            ncols=len(labels),
            fontsize=8,
            frameon=False,
        )
    figure.suptitle(title, fontsize=11)
    return as_png(figure)


def _mark_stretches(panels: np.ndarray, stretches: Sequence[tuple[int, int]], time: np.ndarray, clock: Clock) -> None:
    """A bar for each stretch along the top of each panel, with its number in the first."""
    step = float(time[1] - time[0])
    for k, (a, b) in enumerate(stretches, 1):
        begin, end = clock.dates(np.array([time[a] - step, time[b - 1]]))
        for axes in panels:
            label = "stretch without gaps in inputs" if k == 1 else None
            axes.axvspan(begin, end, ymin=0.96, color="#228833", linewidth=0, label=label)
        panels[0].annotate(
            f"{k}", (begin, 0.94), xycoords=("data", "axes fraction"), fontsize=7, color="#228833", va="top"
        )


def _panel(axes: Axes, one: Series, time: np.ndarray, clock: Clock) -> None:
    _, unit = readable(one.values, one.target.unit)

    def shown(values: np.ndarray) -> np.ndarray:
        return values - ZERO_CELSIUS if unit != one.target.unit else values

    dates = clock.dates(time)
    style: dict[str, Any] = {"drawstyle": "steps-pre"} if one.target.method == "mean" else {}
    if one.second is not None:
        axes.plot(
            dates, shown(one.second), color="#ee7733", linewidth=0.8, label=f"second meter {one.second_name}", **style
        )
    axes.plot(dates, shown(one.values), color="#4477aa", linewidth=1.0, label="recording", **style)
    low, high = axes.get_ylim()
    step = float(time[1] - time[0])
    for k, (a, b) in enumerate(runs(~np.isfinite(one.values))):
        ends = clock.dates(np.array([time[a] - step, time[b - 1]]))
        axes.axvspan(*ends, color="#bbbbbb", alpha=0.5, linewidth=0, label="missing" if k == 0 else None)
    for bit, colour, text in ((INTERPOLATED, "#ccbb44", "interpolated"), (ASSUMED, "#aa3377", "assumed")):
        chosen = (one.flags & bit) > 0
        if chosen.any():
            axes.plot(dates[chosen], shown(one.values[chosen]), ".", color=colour, markersize=3, label=text)
    signal = one.signal
    if signal is not None:
        inside = (signal.middle >= time[0] - step) & (signal.middle <= time[-1])
        for bit, mark, text in _MARKS:
            chosen = inside & ((signal.flags & bit) > 0)
            if chosen.any():
                # what is far off would squeeze the rest: it is marked at the edge of the panel
                values = np.clip(shown(signal.values[chosen]), low, high)
                at = clock.dates(signal.middle[chosen])
                axes.plot(at, values, mark, color="#cc3311", markersize=4, label=text)
    axes.set_ylabel(f"{one.target.name}\n[{unit}]")
    axes.set_title(_from(one.origin), loc="left", fontsize=8, pad=2)
    axes.margins(x=0.005)
    axes.grid(alpha=0.25)


def _from(origin: str) -> str:
    """Where a variable comes from; the unit of a column is the log's, and not that of the axis."""
    column = re.fullmatch(r"(.+) \[(.*)\]", origin)
    return f"from {column[1]} ({column[2]})" if column else origin


class VariableReport(BaseModel, extra="forbid"):
    """One variable of the recording.

    ``origin`` is where it comes from in a few words. ``minimum``, ``mean`` and ``maximum`` are of the recording [unit].
    ``impossible`` and ``stuck`` count readings left out; ``missing``, ``partly``, ``interpolated`` and ``assumed``
    count steps of the recording.
    """

    name: str
    role: str
    unit: str
    method: str
    origin: str
    readings: int
    minimum: float | None
    mean: float | None
    maximum: float | None
    impossible: int
    stuck: int
    missing: int
    partly: int
    interpolated: int
    assumed: int
    computed: bool


class Comparison(BaseModel, extra="forbid"):
    """Two meters of one quantity, on the steps where both have a value; differences are used minus second meter.

    There is no ``correlation`` where one of them, or a constant in the first one's place, never changes.
    """

    name: str
    second: str
    unit: str
    steps: int
    mean_difference: float
    sd_difference: float
    largest_difference: float
    correlation: float | None


class StretchReport(BaseModel, extra="forbid"):
    """A stretch of at least a day in which no input is missing, and how long outputs were ``measured`` there [h]."""

    number: int
    begin: str
    end: str
    hours: float
    measured: float


class ImportReport(Result, BaseModel, extra="forbid"):
    """What :func:`diagnosis.import_recording` returns and ``diagnosis import --json`` prints.

    ``not_recorded`` are the variables that the recording lacks, ``lacking`` what that means for each kind of them.
    Outputs were ``measured`` for so many hours, and in each of the ``stretches`` for its share of them.
    ``begin`` and ``end`` are local standard time, ``utc_offset`` hours east of Greenwich, ``time_zero`` the Monday from
    which the recording's seconds count. ``physics``: what cannot be, and what the description contradicts.
    """

    schema_version: int = 3
    recording: str
    picture: str
    data: str
    system: str
    rows: int
    interval: float
    zone: str
    utc_offset: float
    time_zero: str
    begin: str
    end: str
    step: float
    steps: int
    measured: float
    stretches: list[StretchReport]
    variables: list[VariableReport]
    comparisons: list[Comparison]
    not_recorded: list[str]
    lacking: list[str]
    unused_columns: list[str]
    notes: list[str]
    physics: list[Finding]

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        strong = sum(one.strong for one in self.physics)
        wrong = f", {strong} to be corrected first" if strong else ""
        return f"{self.recording}: {self.begin} to {self.end}, {self.steps} steps of {self.step:g} s{wrong}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each variable of the recording: where it comes from, its range, and what of it is missing."""
        return pd.DataFrame([one.model_dump() for one in self.variables]).set_index("name")


def sentences_of(missing: Sequence[str], system: System) -> list[str]:
    """What it means that variables of a system are not in a recording: outputs, persons, and other inputs."""
    crowd = {one.name for one in system.inputs if isinstance(one, OccupancyInput)}
    outputs = [name for name in missing if name in system.output_names]
    persons = [name for name in missing if name in crowd]
    inputs = [name for name in missing if name not in {*outputs, *persons}]
    said = []
    if outputs:
        said.append(f"not measured: {', '.join(outputs)}: fits know nothing of it, and an estimator may need it")
    if persons:
        said.append(f"occupants were not counted ({', '.join(persons)}): fits treat them as unknown")
    if inputs:
        said.append(
            sentence_on_missing(system, {*system.input_names} - {*inputs}) or f"not recorded: {', '.join(inputs)}"
        )
    return said


def _number(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return f"{value - ZERO_CELSIUS:.1f} °C" if unit == "K" and value > ABSOLUTE else f"{value:.4g}"


def print_report(report: ImportReport, console: Console) -> None:
    """Print a report for people."""
    hours = report.steps * report.step / 3600.0
    console.print(
        f"{report.data}: {report.rows} rows, usually {report.interval:g} s apart; clock of {report.zone}, "
        f"kept in local standard time (UTC{report.utc_offset:+g} h)",
        markup=False,
        soft_wrap=True,
    )
    console.print(
        f"{report.recording}: {report.begin} to {report.end}, {report.steps} steps of {report.step:g} s "
        f"({hours / 24:.1f} days)",
        markup=False,
        soft_wrap=True,
    )
    table = Grid("variable", "unit", "from", "min", "mean", "max", "missing", "left out", "filled", box=None)
    for one in report.variables:
        left = [f"{n} {what}" for n, what in ((one.impossible, "impossible"), (one.stuck, "stuck")) if n]
        filled = [f"{one.interpolated} interpolated"] if one.interpolated else []
        if 0 < one.assumed < report.steps:
            filled.append(f"{one.assumed} assumed")
        if one.partly:
            filled.append(f"{one.partly} partly")
        table.add_row(
            one.name,
            one.unit,
            one.origin,
            *(_number(value, one.unit) for value in (one.minimum, one.mean, one.maximum)),
            f"{one.missing / report.steps:.1%}" if one.missing else "-",
            ", ".join(left) or "-",
            ", ".join(filled) or "-",
        )
    console.print(table, markup=False)
    if [one.hours for one in report.stretches] != [hours]:
        spans = Grid("stretch", "from", "to", "hours", "outputs measured [h]", box=None)
        for span in report.stretches:
            spans.add_row(f"{span.number}", span.begin, span.end, f"{span.hours:g}", f"{span.measured:g}")
        console.print(spans, markup=False)
    for pair in report.comparisons:
        together = f"correlation {pair.correlation:.2f} " if pair.correlation is not None else ""
        console.print(
            f"{pair.name}: used minus second meter ({pair.second}): {pair.mean_difference:+.3g} {pair.unit} on average,"
            f" standard deviation {pair.sd_difference:.3g}, at most {pair.largest_difference:.3g}, "
            f"{together}over {pair.steps} steps",
            markup=False,
            soft_wrap=True,
        )
    for note in report.notes:
        console.print(f"- {note}", markup=False, soft_wrap=True)
    for sentence in report.lacking:
        console.print(sentence, style="yellow", markup=False, soft_wrap=True)
    if report.unused_columns:
        console.print(f"columns not used: {', '.join(report.unused_columns)}", markup=False, soft_wrap=True)
    console.print(f"picture: {report.picture}", markup=False, soft_wrap=True)
    for found in report.physics:
        console.print(found.text, style="bold red" if found.strong else "yellow", markup=False, soft_wrap=True)


def build_recording(
    series: Sequence[Series],
    time: np.ndarray,
    clock: Clock,
    system: System,
    attributes: Mapping[str, str],
    given: Mapping[str, float],
) -> xr.Dataset:
    """Put the series and the given facts [unit of each] into a dataset as recordings have it.

    ``time`` are ends of steps (steps,) [s of the clock].
    """
    step = float(time[1] - time[0])
    variables: dict[str, Any] = {"time_bnds": (("time", "bnds"), np.stack([time - step, time], axis=1))}
    described = {one.name: one for one in system.outputs}
    for one in series:
        name = one.target.name
        flag = f"{name}_flag"
        attrs: dict[str, Any] = {
            "long_name": f"input {name}",
            "units": one.target.unit,
            "role": one.target.role,
            "cell_methods": f"time: {one.target.method}",
            "ancillary_variables": flag,
            "comment": one.comment or one.origin,
        }
        if name in described:
            output = described[name]
            attrs["long_name"] = output.long_name or output.name
            if output.standard_name:
                attrs["standard_name"] = output.standard_name
                if "temperature" in output.standard_name:
                    attrs["units_metadata"] = "temperature: on_scale"
        variables[name] = (("time",), one.values.astype(np.float32), attrs)
        flags = {
            "long_name": f"quality of {name}",
            "standard_name": "quality_flag",
            "flag_masks": np.array(list(FLAGS.values()), dtype=np.int8),
            "flag_meanings": " ".join(FLAGS),
        }
        variables[flag] = (("time",), one.flagged(), flags)
    for fact in system.given:
        if fact.name in given:
            attrs = {"long_name": fact.description or fact.name, "units": fact.unit, "role": "given"}
            variables[fact.name] = ((), given[fact.name], attrs)
    about = {
        "long_name": "end of the step, local standard time",
        "standard_name": "time",
        "units": clock.units,
        "units_metadata": "leap_seconds: none",
        "calendar": "standard",
        "axis": "T",
        "bounds": "time_bnds",
        "comment": f"local standard time is UTC{clock.offset / 3600:+g} h all year; time zero is a Monday",
    }
    attrs = {
        "Conventions": "CF-1.11",
        "title": f"Recording for {system.name}",
        "history": "imported by zeroshot-fmu",
        "zeroshot_schema_version": SCHEMA_VERSION,
        "system_name": system.name,
        "system_hash": system.hash(),
        "time_zone": clock.zone,
        "utc_offset_hours": clock.offset / 3600.0,
        **{name: value for name, value in attributes.items() if value},
    }
    return xr.Dataset(variables, {"time": (("time",), time, about)}, attrs)


def check_free(*paths: Path) -> None:
    """Refuse a path that is a folder, before any work: a RecordingError."""
    for one in paths:
        if one.is_dir():
            raise RecordingError(f"{one}: is a folder; expected a file, or a name that is free")


def write_recording(dataset: xr.Dataset, path: Path, picture: bytes, picture_path: Path) -> None:
    """Write a recording and its picture: both are whole under temporary names before either gets its own.

    The recording gets it first: a picture beside another recording, or none, would be of data that nobody has. Raises
    RecordingError if the folder cannot be written to.
    """
    encoding: dict[Any, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        real = variable.dtype.kind == "f" and name not in ("time", "time_bnds")
        encoding[name] = {"_FillValue": np.float32(np.nan) if real else None}
        if variable.dims == ("time",):
            encoding[name] |= {"zlib": name != "time", "complevel": 4}
    temporary, temporary_picture = temporary_name(path), temporary_name(picture_path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written ({error.strerror or error})") from None
    try:
        write_netcdf(dataset, temporary, encoding)
        temporary_picture.write_bytes(picture)
        os.replace(temporary, path)
        os.replace(temporary_picture, picture_path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)
        temporary_picture.unlink(missing_ok=True)
