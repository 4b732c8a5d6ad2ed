"""Columns of the measurements as judged signals, and signals on the grid with their gaps filled as the mapping says."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from diagnosis.measurements import plausible, units
from diagnosis.measurements.clock import Clock
from diagnosis.measurements.grid import (
    CLOSER,
    Series,
    Target,
    around,
    as_read,
    fill_constant,
    interpolate_short,
    resample,
)
from diagnosis.measurements.mapping import Mapping, Source
from diagnosis.measurements.output import header
from diagnosis.measurements.plausible import find_offset
from diagnosis.measurements.register import POWERS
from diagnosis.measurements.signal import (
    Signal,
    check_possible,
    is_constant,
    make_signal,
    mark_impossible,
    mark_stuck,
    possible_in_source,
    source_value,
    to_target,
)
from diagnosis.measurements.table import OFF, STATES, Measurements
from diagnosis.measurements.weather import Daylight
from shared.errors import RecordingError
from shared.schema import ASSUMED, COMPUTED, IMPOSSIBLE, STUCK
from shared.still import CALM, STUCK_AFTER
from shared.units import spelled

_STATES = ("presence", "bool", "person", "persons", "count", "counts")
"""Units of what jumps from one reading to the next."""
MOVING = ("K", "degC", "degF", "ppm", "W/m2", "m/s")
"""Units of quantities that never stand still: a sensor of one that does is stuck."""
FEWER = 1.5
"""Readings of an output are fewer than its steps where they are so many steps apart, or means over so many."""
BEAM = "dni"
"""The quantity of the weather that may: the beam of an overcast day is zero from morning to night."""
TOLD = 0.05
"""Share of a column's readings from which on the sentence on those left out says what would keep them."""
_NIGHT = 24.0
"""How long an irradiance may show one value where nothing says when the sun is up [h]: only a polar night lasts longer,
in which it is zero."""


@dataclass
class Judge:
    """Reads the measurements as the mapping says.

    ``edges`` of the grid, shape (steps + 1,) [s of the clock]; ``notes`` are sentences on what was done, ``used`` the
    columns that were read, ``valid`` the lines that would keep what was left out as impossible, by where they belong.
    """

    mapping: Mapping
    data: Measurements
    clock: Clock
    edges: np.ndarray
    notes: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    valid: dict[str, str] = field(default_factory=dict)

    @property
    def step(self) -> float:
        """Step of the grid [s]."""
        return float(self.edges[1] - self.edges[0])

    @cached_property
    def daylight(self) -> Daylight | None:
        """Where the sun stands over the record; None where the mapping names no place."""
        if self.mapping.place is None:
            return None
        return Daylight.over(float(self.edges[0]), float(self.edges[-1]), self.clock, self.mapping.place)

    def tell(self, sentence: str | None) -> None:
        """Note a sentence, if there is one."""
        self.notes += [sentence] if sentence else []

    def assumed(self, target: Target, value: float | np.ndarray, origin: str) -> Series:
        """What nobody measured: one value, or one for each step [unit of the target]."""
        values = np.broadcast_to(np.asarray(value, dtype=np.float64), (len(self.edges) - 1,)).copy()
        return Series(target, origin, values, np.full(len(values), ASSUMED, dtype=np.int8))

    def mapped(self, target: Target, source: Source, key: str, *, weather: str | None = None) -> Series:
        """A target from its column or constant, which stand in the mapping under ``key``.

        ``weather`` is pvlib's name of the quantity, of an input that comes from the weather. Raises RecordingError if
        the column cannot be used, the constant is impossible, or gaps of an output are to be filled.
        """
        where = f"{self.mapping.path}: {key}"
        for name in ("fill", "fill_up_to") if target.role == "output" else ():
            if name in source.model_fields_set:
                raise RecordingError(
                    f"{where}: {name} is {getattr(source, name)!r}, which only an input has; expected none, as the gaps"
                    " of an output stay missing"
                )
        if source.constant is not None:
            value = self.converted(source.constant, source, target, where)
            made = self.assumed(target, value, f"constant of the mapping: {value:.6g}")
            return self._beside(made, source, where)
        # a set point stands still, the weather does not
        outdoors = weather is not None and weather != BEAM
        moving = spelled(target.unit) in MOVING and (target.role == "output" or outdoors)
        origin, source = f"{source.column} [{source.unit}]", source.as_power()
        signal = self.signal(source, target.unit, where, moving=moving, sun=target.sun, signed=target.signed)
        if target.method == "mean" and not self.says_how(source):
            self._instants(target, signal, f"{where}: column {source.column!r}")
        if target.role == "output":
            self._as_many(target, signal, f"{where}: column {source.column!r}")
        made = self.gridded(target, signal, source, origin, where)
        made.key = key
        return self._beside(made, source, where)

    def _beside(self, made: Series, source: Source, where: str) -> Series:
        """The same series with the second meter that its source may name, which is read as the first one is."""
        meter = source.compare
        if meter is None:
            return made
        same = {name: getattr(source, name) for name in ("reading", "stamp", "interval", "max_gap")}
        own = {name: getattr(meter, name) for name in meter.model_fields_set}
        if source.reading == "register" and meter.unit not in POWERS:
            same["reading"] = "mean"
        other = self.signal(
            Source(**own, **same).as_power(),
            made.target.unit,
            f"{where}.compare",
            moving=False,
            sun=made.target.sun,
            signed=made.target.signed,
        )
        made.second, _ = resample(other, self.edges, made.target.method, self.mapping.grid.coverage)
        if made.target.role == "input" and made.target.method == "point":  # as the first one is
            made.second = around(other, self.edges)
        made.second_name = meter.column
        return made

    def says_how(self, source: Source) -> bool:
        """Whether the mapping itself says how a column's readings are to be understood."""
        return source.reading is not None or "reading" in self.mapping.defaults.model_fields_set

    def _instants(self, target: Target, signal: Signal, where: str) -> None:
        """What is joined by straight lines to means over the steps though nothing says that it was read at instants.

        Raises RecordingError if readings are about a step apart: what a logger writes so seldom of a power or a flow
        are mostly means.
        """
        times = signal.clean().begin
        if len(times) < 2 or is_constant(signal):  # one value is its mean, however it was read
            return
        apart = float(np.median(np.diff(times)))
        if apart >= CLOSER * self.step:
            raise RecordingError(
                f"{where}: nothing says whether its readings, {apart:g} s apart, are means or instants, and"
                f" {target.name} is a mean over each step of {self.step:g} s; expected reading = 'mean' if the logger"
                " wrote means (as most do of a power or a flow), 'point' to interpolate between instants, or 'hold'"
                " for what holds until the next reading"
            )
        self.tell(plausible.about_instants(target.name, apart, self.step))

    def _as_many(self, target: Target, signal: Signal, where: str) -> None:
        """Refuse readings of an output that would become more than were read, each taken for one of its own.

        Gaps are none of their spacing, and a state is known until the next reading. Raises RecordingError if readings
        are usually further apart than steps, or means of longer intervals.
        """
        clean = signal.clean()
        over = clean.kind == "mean" and target.method == "mean"
        apart = clean.end - clean.begin if over else np.diff(clean.middle)
        joined = apart if over else apart[apart <= clean.max_gap]
        usual = float(np.median(joined)) if joined.size else 0.0
        if clean.kind == "hold" or usual <= FEWER * self.step:
            return
        found = f"are means over {usual:g} s" if over else f"are {usual:g} s apart"
        raise RecordingError(
            f"{where}: its readings {found}, and a step is {self.step:g} s: most of {target.name} would be made up"
            f" between them and taken for readings; expected steps of about {usual:g} s, as grid.step ="
            f" {usual:g} makes them, or reading = 'hold' for what holds until the next reading"
        )

    def converted(self, value: float, source: Source, target: Target, where: str) -> float:
        """A number as written in the source's unit, in the target's; refused if readings of it would be."""
        density = self.mapping.air_density
        made = float(to_target(np.array(value), source, target.unit, density=density, where=where))
        check_possible(made, source, target.unit, density=density, where=where, sun=target.sun, signed=target.signed)
        return made

    def signal(
        self, source: Source, unit: str, where: str, *, moving: bool, sun: bool = True, signed: bool = False
    ) -> Signal:
        """A column as a judged signal.

        ``moving`` says that it never stands still, ``sun`` that W/m2 are irradiance, ``signed`` that readings are
        differences. Raises RecordingError if there is no such column, or no reading of it can be used.
        """
        column = str(source.column)
        self.used.add(column)
        states = source.unit in ("", "1", "fraction", *_STATES) or "scale" in source.model_fields_set
        words = STATES if states else {} if spelled(unit) in MOVING else OFF
        readings = self.data.numbers(column, where, words)
        where = f"{where}: column {column!r}"
        written = self.data.units.get(column, source.unit)
        if not ({"scale", "persons"} & source.model_fields_set or units.same(written, source.unit)):
            raise RecordingError(
                f"{where}: unit is {source.unit!r}, and its cells end in {written!r}; expected unit = {written!r}"
            )
        density = self.mapping.air_density
        kind_of_reading = source.reading or self.mapping.defaults.reading
        if kind_of_reading != "mean":
            _check_no_interval(source, where)
        counted = kind_of_reading in ("hold", "register")
        usual = plausible.sparse(self.data.utc, readings) if not counted and source.max_gap is None else None
        if usual is not None and kind_of_reading == "point" and source.reading is None and source.unit in _STATES:
            raise RecordingError(
                f"{where}: is read every {usual / 3600:.3g} h only, and {source.unit} is not linear in between;"
                " expected reading = 'hold' if it is logged when it changes, or reading = 'point' to join its readings"
            )
        if usual is not None:
            self.notes.append(plausible.about_changes(column, kind_of_reading, usual))
        signal = make_signal(
            self.clock.seconds(self.data.utc),
            readings,
            source,
            unit,
            kind=kind_of_reading,
            stamp=source.stamp or self.mapping.defaults.stamp,
            density=density,
            where=where,
        )
        self.tell(plausible.about_hold(column, signal) if source.max_gap is None else None)
        if is_constant(signal):
            if moving and not _is_calm(signal):
                raise RecordingError(f"{where}: every reading is {signal.values[0]:g} {unit}; expected one that varies")
            self.notes.append(f"column {column}: every reading is {signal.values[0]:g} {unit}")
        read = signal.used  # without codes for missing readings
        watt = _watt(unit) if sun else None
        offset = None
        if watt is not None and self.daylight is not None:
            offset = find_offset(signal, self.daylight, watt)
        if offset is not None:
            signal = offset.taken_off(signal)
            self.notes.append(offset.sentence(column, unit))
        kind: dict[str, Any] = {"density": density, "where": where, "sun": sun, "signed": signed}
        signal = mark_impossible(signal, source, **kind)
        limits = possible_in_source(source, unit, **kind)
        self.tell(plausible.about_impossible(column, signal, source, *limits))
        self.tell(plausible.about_noise(column, signal))
        most = float(np.nanmax(readings)) if source.unit in ("percent", "%") and source.scale == 1 else 0.0
        # a fraction is a hundred times as much, and that of CO2 would be impossible
        if 0 < most <= 1.0 and 100.0 * most <= limits[1] * (1 + 1e-9):
            self.notes.append(f"column {column}: declared in percent, but no reading is above 1; is it a fraction?")
        if kind_of_reading == "register":
            self.tell(plausible.about_coarse(column, signal, self.step))
        else:
            self.tell(plausible.about_register(column, signal) if units.is_power(unit) else None)
        # a state is silent while nothing changes
        hours = STUCK_AFTER if moving and kind_of_reading != "hold" else 0.0
        rest: dict[str, Any] = {}
        if watt is not None and self.daylight is not None:
            rest = {"lasting": self.daylight.lit}
        elif watt is not None:
            hours, rest = _NIGHT if hours else 0.0, {"zero": np.inf}
        elif spelled(unit) == "m/s" and source.stuck_after is None:  # else the mapping knows the place
            rest = {"zero": CALM}
        hours = hours if source.stuck_after is None else source.stuck_after
        signal = mark_stuck(signal, hours, **rest)
        self._tell_left_out(signal, read, source, where, hours)
        if not signal.used.any():
            raise RecordingError(
                f"{where}: no reading can be used: all are impossible, or stuck for over {hours:g} h; expected others,"
                " or stuck_after = 0.0 and valid = [lowest, highest] there if they are right"
            )
        return signal

    def _tell_left_out(self, signal: Signal, read: np.ndarray, source: Source, where: str, hours: float) -> None:
        """Say which line of the mapping keeps the readings of a column, where many are left out that were ``read``."""
        key = where.removeprefix(f"{self.mapping.path}: ").partition(": ")[0]
        if key.endswith(".compare"):  # which has no such lines, and is only drawn
            return
        count = len(signal.flags)
        stuck = int(((signal.flags & STUCK) > 0).sum())
        if stuck > TOLD * count:
            self.notes.append(
                f"column {source.column}: {stuck} of {count} readings stand still for over {hours:g} h and are left out"
                f" as stuck; stuck_after = 0.0 under {header(key)} keeps them"
            )
        impossible = ((signal.flags & IMPOSSIBLE) > 0) & read
        if impossible.any():
            raw = [
                source_value(one, source, signal.unit, density=self.mapping.air_density, where=where)
                / (source.persons or 1.0)
                for one in (float(signal.values[read].min()), float(signal.values[read].max()))
            ]
            self.valid[key] = f"valid = [{_down(min(raw)):g}, {-_down(-max(raw)):g}]"
            if impossible.sum() > TOLD * count:
                self.notes.append(
                    f"column {source.column}: {self.valid[key]} under {header(key)} keeps all, if they are right"
                )

    def gridded(self, target: Target, signal: Signal, source: Source, origin: str, where: str) -> Series:
        """A signal on the grid, an input's gaps filled as its mapping says: weather by short lines unless told."""
        grid = (signal, self.edges, target.method, self.mapping.grid.coverage)
        if target.role == "output":
            values, flags = as_read(*grid, bridges=source.max_gap is not None)
        else:
            values, flags = resample(*grid)
            values = around(signal, self.edges) if target.method == "point" else values
        # an output may be below by its noise, which whoever fits it counts; what drives a simulation may not
        low = np.isfinite(values) & (values < signal.floor)
        if target.role == "input" and low.any():
            raised = np.where(low, signal.floor, values)
            told = plausible.about_floor(
                target.name, low, float(np.nanmean(values)), float(np.nanmean(raised)), target.unit
            )
            self.notes.append(told)
            values = raised
        flags |= np.bitwise_and.reduce(signal.flags) & np.int8(COMPUTED | ASSUMED)
        if target.role == "input":
            fill = source.fill if source.fill is not None else self._usual_fill(source)
            if fill == "interpolate":
                most = int(source.fill_up_to * 3600.0 / self.step + 1e-9)  # whole steps: no longer gap is filled
                values, flags = interpolate_short(values, flags, most)
            elif isinstance(fill, float):
                plain = Source(constant=fill, unit=source.unit, persons=source.persons, valid=source.valid)
                values, flags = fill_constant(values, flags, self.converted(fill, plain, target, f"{where}: fill"))
        return Series(target, origin, values, flags, signal=signal)

    def _usual_fill(self, source: Source) -> str:
        return "interpolate" if any(one is source for one in self.mapping.weather.values()) else "none"


def _check_no_interval(source: Source, where: str) -> None:
    """Refuse what only a mean has, of readings that are none."""
    for name, value in (("stamp", source.stamp), ("interval", source.interval)):
        if value is not None:
            raise RecordingError(
                f"{where}: {name} is {value!r}, which only a mean has; expected reading = 'mean' with it"
            )


def _is_calm(signal: Signal) -> bool:
    """Whether a signal is of wind, and so short that all of it may be a calm."""
    short = bool(signal.end[-1] - signal.begin[0] <= 3600.0 * CALM)
    return short and spelled(signal.unit) == "m/s" and not signal.values.any()


def _down(value: float) -> float:
    """A number with three digits that is not above this one."""
    if value == 0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(abs(value))) - 2)
    return float(np.floor(value / digit + 1e-9) * digit)


def _watt(unit: str) -> float | None:
    """A W/m2 in this unit; None if it is not one of irradiance."""
    try:
        return float(units.convert(1.0, "W/m2", unit, density=1.0, where=""))
    except RecordingError:
        return None
