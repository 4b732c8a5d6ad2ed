"""``import_recording``: a mapping and a CSV of measurements become a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from datagen.driving.inputs import schedule_signal
from datagen.driving.tables import merge
from diagnosis.measurements import plausible
from diagnosis.measurements.clock import Clock, make_clock
from diagnosis.measurements.grid import Series, input_target, output_target
from diagnosis.measurements.judge import Judge
from diagnosis.measurements.mapping import Mapping, check_against, load_mapping
from diagnosis.measurements.outdoors import Outdoors
from diagnosis.measurements.output import (
    Comparison,
    ImportReport,
    Kept,
    StretchReport,
    VariableReport,
    about_spacing,
    build_recording,
    check_free,
    draw_recording,
    sentences_of,
    write_recording,
)
from diagnosis.measurements.table import Measurements, read_measurements
from diagnosis.measurements.units import COUNTS
from diagnosis.measurements.zones import find_zone
from diagnosis.physics import check_physics
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from shared.places import check_folder
from shared.schema import ASSUMED, COMPUTED, IMPOSSIBLE, INTERPOLATED, PARTLY, STUCK
from shared.shipped import resolved
from shared.store import sha256_of
from shared.system import System, load_system
from shared.variables import (
    ConstantInput,
    ExcitationInput,
    Input,
    MeasuredInput,
    OccupancyInput,
    Output,
    ScheduleInput,
    WeatherInput,
)


def about_ends(series: Sequence[Series], edges: np.ndarray, last: int) -> list[str]:
    """Sentences on inputs without a value in step ``last`` of the grid, where inputs were read beyond it.

    ``edges`` are of the steps, shape (steps + 1,) [s].
    """
    read = [(one, one.signal.clean()) for one in series if one.target.role == "input" and one.signal is not None]
    if last + 1 >= len(edges) or not any((signal.middle > edges[last + 1]).any() for _, signal in read):
        return []
    return [
        f"{one.target.name}, {one.origin}, has no value in the step after, and so the recording ends there"
        f"{about_spacing(signal, float(edges[last]))}"
        for one, signal in read
        if not np.isfinite(one.values[last])
    ]


DAY = 86400.0


@dataclass
class Composer:
    """Makes the series of a system's variables.

    ``edges`` of the grid, shape (steps + 1,) [s of the clock]; ``notes`` are sentences on what was done, ``used`` the
    columns that were read, ``planned`` the inputs for which a schedule stands in, and its name, ``uncounted`` persons
    that nobody counted.
    """

    system: System
    mapping: Mapping
    data: Measurements
    clock: Clock
    edges: np.ndarray
    judge: Judge = field(init=False)
    outdoors: Outdoors = field(init=False)
    planned: dict[str, str] = field(default_factory=dict)
    uncounted: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.judge = Judge(self.mapping, self.data, self.clock, self.edges)
        self.outdoors = Outdoors(self.system, self.judge)

    @property
    def notes(self) -> list[str]:
        """Sentences on what was done."""
        return self.judge.notes

    @property
    def used(self) -> set[str]:
        """Columns that were read."""
        return self.judge.used

    @property
    def step(self) -> float:
        """Step of the grid [s]."""
        return self.judge.step

    def output(self, one: Output) -> Series | None:
        """The series of an output, or None if it is not mapped."""
        source = self.mapping.variables.get(one.name)
        return None if source is None else self.judge.mapped(output_target(one), source, f"variables.{one.name}")

    def input(self, one: Input) -> Series | None:
        """The series of an input: mapped, of the weather, computed, or the description's; None if there is none."""
        target = input_target(one)
        if one.name in self.mapping.variables:
            weather = one.column if isinstance(one, WeatherInput) else None
            source = self.mapping.variables[one.name]
            made = self.judge.mapped(target, source, f"variables.{one.name}", weather=weather)
            if isinstance(one, OccupancyInput) and source.constant is not None:
                self.notes.append(
                    f"{one.name}: {made.values[0]:g} occupants at all hours, nights too, as the mapping states: a"
                    " calibration, forecast or diagnosis takes that for a count; use --occupancy unknown if it is none"
                )
            if isinstance(one, OccupancyInput) and source.unit in COUNTS and made.signal is not None:
                most = self.system.occupancy.headcount[1] if self.system.occupancy is not None else 1
                self.judge.tell(plausible.about_presence(one.name, str(source.column), made.signal, most))
            return made
        if isinstance(one, WeatherInput):
            return self.outdoors.series(target, one.column)
        if isinstance(one, OccupancyInput):
            self.uncounted.append(one.name)
            return None
        if isinstance(one, ConstantInput):
            return self.judge.assumed(target, one.value, "constant of the description")
        if isinstance(one, MeasuredInput):
            self.notes.append(f"{one.name}: not measured; the description's {one.value:g} {one.unit} stands in for it")
            return self.judge.assumed(target, one.value, "assumed, not measured")
        if isinstance(one, ExcitationInput):
            return self.judge.assumed(target, 0.0, "no excitation")
        if isinstance(one, ScheduleInput):
            planned = schedule_signal(self.system.schedules[one.schedule], self.edges[0], self.edges[-1])
            self.planned[one.name] = one.schedule
            table = merge({one.name: planned}, self.edges[0], self.edges[-1])
            values = table.means(self.edges)[:, 0] if target.method == "mean" else planned.at(self.edges[1:])
            return self.judge.assumed(target, values, f"schedule {one.schedule} of the description")
        return None

    def tell_of_daylight_saving(self, first: int, last: int) -> None:
        """A note where a schedule or habits stand in on days, of steps ``first`` to ``last``, with daylight saving."""
        zone = find_zone(self.clock.zone)
        days = np.unique(np.floor(self.edges[first:last] / DAY)) * DAY + DAY / 2
        moments = [datetime.fromtimestamp(one, UTC).astimezone(zone).utcoffset() for one in self.clock.utc(days)]
        moved = sum(one is not None and one.total_seconds() != self.clock.offset for one in moments)
        planned = {name: f"not measured; schedule {one!r} stands in for it" for name, one in self.planned.items()}
        habits = dict.fromkeys(self.uncounted, "not counted; the description's habits stand in for it")
        for name, said in {**planned, **habits}.items() if moved else ():
            self.notes.append(
                f"{name}: {said}, in standard time, an hour late by the clocks of {moved} of {len(days)} days with"
                " daylight saving"
            )


_MOST_STEPS = 5_000_000


def import_recording(
    mapping: Path | str,
    data: Path | str,
    *more: Path | str,
    out: Path | str,
    system: System | Path | str | None = None,
    ahead: bool = False,
) -> ImportReport:
    """Turn measurements into a recording (NetCDF) and draw it.

    Parameters
    ----------
    mapping
        Column mapping (TOML): see :mod:`diagnosis.measurements.mapping`.
    data
        The measurements: CSV, Excel, Parquet or NetCDF.
    more
        Further mappings and measurements in turn, as of a weather station. The recording has the clock, the steps and
        the time of the first.
    out
        The recording; its picture lies next to it, ending in ``.png``.
    system
        System description; by default the one that the first mapping names.
    ahead
        Whether the recording goes on after the last reading of an output as long as all inputs do, for a forecast.

    Returns
    -------
    ImportReport
        What was understood, and what could not be used.

    Raises
    ------
    RecordingError
        If mapping or measurements cannot be used. Nothing has been written then.
    SystemDescriptionError
        If the system description cannot be used.
    """
    given = [Path(one) for one in (mapping, data, *more)]
    if len(given) % 2 or any(one.suffix.lower() == ".toml" for one in given[1::2]):
        raise RecordingError(
            f"{', '.join(map(str, given))}: expected a mapping (TOML) and its measurements in turn, as room.toml"
            " room.csv weather.toml weather.csv"
        )
    settings = [load_mapping(one) for one in given[::2]]
    out = Path(out)
    if out.suffix != ".nc":
        raise RecordingError(f"{out}: ending is {out.suffix!r}; expected .nc")
    check_folder(out.parent, RecordingError)
    check_free(out, out.with_suffix(".png"))
    read: list[Measurements] = []
    wrong: list[str] = []
    with _noted(wrong):
        described = _system(settings, system)
    for path, own in zip(given[1::2], settings, strict=True):
        with _noted(wrong):
            read.append(read_measurements(path, own))
    _refuse(wrong)
    measurements, data = read[0], given[1]
    length = float(measurements.utc[-1] - measurements.utc[0])
    interval = float(np.median(np.diff(measurements.utc)))
    if length + interval < DAY:
        raise RecordingError(f"{data}: spans {length / 3600:.3g} h; expected at least a day")
    clock = make_clock(measurements.zone, find_zone(measurements.zone), measurements.utc[0])
    edges = _edges(described, settings[0], read, clock, ahead)
    facts = {name: value for one in settings for name, value in one.given.items()}
    facing = _facing(described, facts)
    composers = [Composer(facing, *one, clock, edges) for one in zip(settings, read, strict=True)]
    composer = composers[0]
    composer.notes.extend(_beyond(described, facts))
    if abs(DAY / composer.step - round(DAY / composer.step)) > 1e-9:
        composer.notes.append(
            f"{settings[0].path}: grid.step is {composer.step:g} s, of which no whole number makes a day; expected one"
            f" that does, such as the description's {described.experiment.step:g}"
        )
    for one in composers[1:]:
        composer.notes.extend(_about_further(one))
    series, missing = _series(composers)
    for one in composers:
        one.outdoors.check_sun(series)
        one.outdoors.tell_unused()
    first, last = _span(composer, series, ahead)
    for variable in series:
        variable.cut(first, last)
        if variable.target.role == "output" and not np.isfinite(variable.values).any():
            composer.notes.append(
                f"{variable.target.name}: {variable.origin} has no usable reading from"
                f" {clock.text(edges[first])} to {clock.text(edges[last])}: check its shift, valid and time stamps, or"
                f" leave variables.{variable.target.name} out"
            )
    valid = {key: line for one in composers for key, line in one.judge.valid.items()}
    kept = Kept(series, described, composer.step, float(composer.edges[first]), valid)
    stretches = _stretches(composer, kept)
    composer.tell_of_daylight_saving(first + stretches[0][0], first + stretches[-1][1])
    counted = None if kept.stretches() else "unknown"
    time = composer.edges[first + 1 : last + 1]
    attributes = {
        "source": "; ".join(one.source or path.name for one, path in zip(settings, given[1::2], strict=True)),
        "source_file": ", ".join(one.name for one in given[1::2]),
        "source_sha256": ", ".join(map(sha256_of, given[1::2])),
        "comment": " ".join(one.description for one in settings if one.description),
    }
    dataset = build_recording(series, time, clock, described, attributes, facts)
    begin, end = clock.text(time[0] - composer.step), clock.text(time[-1])
    picture = draw_recording(
        series, time, clock, f"{out.name}: {begin} to {end}, steps of {composer.step:g} s", stretches
    )
    write_recording(dataset, out, picture, out.with_suffix(".png"))
    return ImportReport(
        recording=str(out),
        picture=str(out.with_suffix(".png")),
        data=str(data),
        system=str(described.path),
        rows=len(measurements.utc),
        interval=interval,
        zone=measurements.zone,
        utc_offset=clock.offset / 3600.0,
        time_zero=clock.zero.isoformat(),
        begin=begin,
        end=end,
        step=composer.step,
        steps=len(time),
        measured=kept.hours(),
        stretches=[
            StretchReport(
                number=k,
                begin=clock.text(time[a] - composer.step),
                end=clock.text(time[b - 1]),
                hours=(b - a) * composer.step / 3600.0,
                measured=kept.hours([(a, b)]),
            )
            for k, (a, b) in enumerate(stretches, 1)
        ],
        variables=[_about(one) for one in series],
        comparisons=[found for one in series if (found := _compare(one)) is not None],
        not_recorded=missing,
        lacking=sentences_of(missing, described),
        unused_columns=[str(name) for one in composers for name in one.data.columns if name not in one.used],
        notes=[note for one in composers for note in (*one.data.notes, *one.notes)],
        physics=check_physics(described, read_recording(out, described, occupancy=counted, said=False)),
    )


@contextmanager
def _noted(wrong: list[str]) -> Iterator[None]:
    """Add what a RecordingError says to what is wrong, and go on."""
    try:
        yield
    except RecordingError as error:
        wrong.append(str(error))


def _refuse(wrong: Sequence[str]) -> None:
    """Raise RecordingError if anything is wrong: all of it, each sentence once."""
    if wrong:
        raise RecordingError("\n".join(dict.fromkeys(wrong)))


def _system(mappings: Sequence[Mapping], given: System | Path | str | None) -> System:
    first = mappings[0]
    if isinstance(given, System):
        check_against(mappings, given)
        return given
    if given is None and first.system is None:
        raise RecordingError(f"{first.path}: system is missing; expected the system description that is measured")
    if given is None:
        beside = first.path.parent / str(first.system)
        given = beside if beside.exists() else resolved(str(first.system))
        given = given if given.exists() else beside
    system = load_system(given)
    check_against(mappings, system)
    return system


def _facing(system: System, facts: dict[str, float]) -> System:
    """The system with the facade that looks where a given fact says: that is where the sun is computed."""
    brought = [one for one in system.given if one.name in facts and one.weather]
    turned: dict[str, float] = {one.weather: facts[one.name] for one in brought}
    if system.weather is None or not turned:
        return system
    return system.model_copy(update={"weather": system.weather.model_copy(update=turned)})


def _beyond(system: System, facts: dict[str, float]) -> list[str]:
    """Sentences on facts that lie outside of the description's ranges."""
    return [
        f"given {one.name} is {facts[one.name]:g}, and the description has {one.min:g} to {one.max:g} {one.unit}: is"
        " its unit right? No estimator was trained on it"
        for one in system.given
        if one.name in facts and not one.per and not one.min <= facts[one.name] <= one.max
    ]


def _edges(system: System, mapping: Mapping, read: Sequence[Measurements], clock: Clock, ahead: bool) -> np.ndarray:
    """Edges of the grid, shape (steps + 1,) [s of the clock]: over the first measurements, and ahead over all."""
    data = read[0]
    step = mapping.grid.step or system.experiment.step
    begin = float(clock.seconds(data.utc[:1])[0])
    end = max(float(clock.seconds(one.utc[-1:])[0]) for one in (read if ahead else read[:1]))
    if step > end - begin:
        raise RecordingError(
            f"{data.path}: spans {(end - begin) / 3600:.3g} h, and a step is {step:g} s; expected two steps at least"
            f" (grid.step of {mapping.path}, or the system's own)"
        )
    first, last = np.floor(begin / step) - 1, np.ceil(end / step) + 1
    if last - first > _MOST_STEPS:
        raise RecordingError(
            f"{data.path}: {clock.text(begin)} to {clock.text(end)} are {last - first:.3g} steps of {step:g} s; "
            f"expected at most {_MOST_STEPS:g} (is time.format right?)"
        )
    return np.asarray(step * np.arange(first, last + 1))


def _about_further(one: Composer) -> list[str]:
    """What is said of measurements beside the first ones.

    Raises
    ------
    RecordingError
        If they are of another time.
    """
    data, clock = one.data, one.clock
    begin, end = (float(value) for value in clock.seconds(data.utc[[0, -1]]))
    if end <= one.edges[0] or begin >= one.edges[-1]:
        raise RecordingError(
            f"{data.path}: is of {clock.text(begin)} to {clock.text(end)}; expected measurements between"
            f" {clock.text(float(one.edges[0]))} and {clock.text(float(one.edges[-1]))}, as the first file has them"
        )
    interval = float(np.median(np.diff(data.utc)))
    return [f"{data.path}: {len(data.utc)} rows, usually {interval:g} s apart; clock of {data.zone}"]


def _series(composers: Sequence[Composer]) -> tuple[list[Series], list[str]]:
    """All series that can be had, each of the first mapping that has it, and the names of the variables that cannot."""
    series, missing = [], []
    wrong: list[str] = []
    for one in [*composers[0].system.outputs, *composers[0].system.inputs]:
        with _noted(wrong):
            found = _output_series(composers, one) if isinstance(one, Output) else _input_series(composers, one)
            if found is None:
                missing.append(one.name)
            else:
                series.append(found)
    _refuse(wrong)
    return series, missing


def _output_series(composers: Sequence[Composer], one: Output) -> Series | None:
    """The series of an output: of the first mapping that has it."""
    made = [composer.output(one) for composer in composers]
    return next((series for series in made if series is not None), None)


def _input_series(composers: Sequence[Composer], one: Input) -> Series | None:
    """The series of an input: of the mapping that names it, of the weather of any, or what the first makes of it."""
    named = [composer for composer in composers if one.name in composer.mapping.variables]
    if isinstance(one, WeatherInput) and not named:
        made = (composer.input(one) for composer in composers)
        return next((series for series in made if series is not None), None)
    return (named or composers)[0].input(one)


def _span(composer: Composer, series: list[Series], ahead: bool) -> tuple[int, int]:
    """The steps to keep: from the first to the last output, and ahead as long as all inputs go on."""
    measured = np.any([np.isfinite(one.values) for one in series if one.target.role == "output"], axis=0)
    if not measured.any():
        raise RecordingError(f"{composer.data.path}: no output has a value on the grid of {composer.step:g} s")
    first, last = int(np.flatnonzero(measured)[0]), int(np.flatnonzero(measured)[-1]) + 1
    inputs = [np.isfinite(one.values) for one in series if one.target.role == "input"]
    further = int(np.argmin([*np.all(inputs, axis=0)[last:], False])) if inputs else 0
    if ahead:
        last += further
        composer.notes.extend(about_ends(series, composer.edges, last))
    else:
        first, last = _trimmed(composer, series, first, last)
    if further:
        kept = "are kept for a forecast" if ahead else "are left out (--ahead keeps them for a forecast)"
        composer.notes.append(f"inputs go on for {further} steps after the last reading of an output: these {kept}")
    if (last - first) * composer.step < DAY - 1e-6:
        raise RecordingError(
            f"{composer.data.path}: outputs were read over {(last - first) * composer.step / 3600:.3g} h; expected at"
            " least a day"
        )
    if last - first < 2:
        raise RecordingError(
            f"{composer.data.path}: makes one step of {composer.step:g} s; expected two at least (grid.step of"
            f" {composer.mapping.path}, or the system's own)"
        )
    return first, last


def _trimmed(composer: Composer, series: list[Series], first: int, last: int) -> tuple[int, int]:
    """The same without a first and a last step that lack an input: a log begins and ends within a step."""
    needed = Kept(series, composer.system, composer.step, 0.0, {}).needed
    for k, which in ((first, "first"), (last - 1, "last")):
        if lacking := [one.target.name for one in needed if not np.isfinite(one.values[k])]:
            composer.notes.append(f"{', '.join(lacking)}: no value in the {which} step with outputs, which is left out")
            first, last = (first + 1, last) if which == "first" else (first, last - 1)
    return first, last


def _stretches(composer: Composer, kept: Kept) -> list[tuple[int, int]]:
    """The stretches of a recording in which no input is missing; what is lost is noted."""
    found = kept.stretches() or kept.stretches(without=kept.crowd)
    if not found:
        remedies = "; ".join(kept.remedies(0.0)) or "a mapping's fill says what may fill gaps"
        raise RecordingError(
            f"{composer.data.path}: no inputs are missing ({kept.gaps()}) in no stretch of a day; expected at least one"
            f" ({remedies})"
        )
    composer.notes.extend(kept.sentences())
    return found


def _about(one: Series) -> VariableReport:
    there = np.isfinite(one.values)
    seen = one.values[there]

    def steps(bit: int) -> int:
        return int(((one.flags & bit) > 0).sum())

    def readings(bit: int) -> int:
        return 0 if one.signal is None else int(((one.signal.flags & bit) > 0).sum())

    return VariableReport(
        name=one.target.name,
        role=one.target.role,
        unit=one.target.unit,
        method=one.target.method,
        origin=one.origin,
        readings=0 if one.signal is None else len(one.signal.values),
        minimum=float(seen.min()) + 0.0 if seen.size else None,
        mean=float(seen.mean()) if seen.size else None,
        maximum=float(seen.max()) if seen.size else None,
        impossible=readings(IMPOSSIBLE),
        stuck=readings(STUCK),
        missing=int((~there).sum()),
        partly=steps(PARTLY),
        interpolated=steps(INTERPOLATED),
        assumed=steps(ASSUMED),
        computed=steps(COMPUTED) > 0,
    )


def _compare(one: Series) -> Comparison | None:
    """Two meters of one quantity where both have values; None if there is no second or they share too little.

    The first may be a constant of the mapping; where its gaps were filled there is nothing to compare.
    """
    if one.second is None:
        return None
    read = (one.flags & (INTERPOLATED | ASSUMED)) == 0 if one.signal is not None else True
    both = np.isfinite(one.values) & np.isfinite(one.second) & read
    if both.sum() < 2:
        return None
    used, second = one.values[both], one.second[both]
    vary = used.std() > 0 and second.std() > 0
    return Comparison(
        name=one.target.name,
        second=one.second_name,
        unit=one.target.unit,
        steps=int(both.sum()),
        mean_difference=float((used - second).mean()),
        sd_difference=float((used - second).std()),
        largest_difference=float(np.abs(used - second).max()),
        correlation=float(np.corrcoef(used, second)[0, 1]) if vary else None,
    )
