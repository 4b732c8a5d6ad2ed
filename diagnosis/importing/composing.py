"""Each variable of a system as a regular series: found in the measurements, computed, or taken from the description."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from datagen.inputs import schedule_signal
from datagen.tables import merge
from diagnosis.importing import plausible, units, weather
from diagnosis.importing.clock import Clock, find_zone
from diagnosis.importing.filling import fill_constant, interpolate_short
from diagnosis.importing.mapping import MEASURABLE, Mapping, Source
from diagnosis.importing.quality import (
    ASSUMED,
    COMPUTED,
    Signal,
    check_possible,
    is_constant,
    make_signal,
    mark_impossible,
    mark_stuck,
    to_target,
)
from diagnosis.importing.reading import Measurements
from diagnosis.importing.resampling import around, resample
from diagnosis.importing.series import Series, Target, input_target, output_target
from shared.errors import RecordingError
from shared.system import System
from shared.variables import ConstantInput, ExcitationInput, Input, MeasuredInput, Output, ScheduleInput, WeatherInput

DAY = 86400.0
_STATES = ("presence", "bool", "person", "persons", "count", "counts")
"""Units of what jumps from one reading to the next."""
_MOVING = ("K", "degC", "ppm", "W/m2", "m/s")
"""Units of quantities that never stand still: a sensor of one that does is stuck."""
ROUNDED = 1e-3
"""A share beyond its ends by so little is rounded."""
_STUCK_AFTER = 12.0
"""How long such a sensor may show one value [h]; irradiance may be zero for as long as it likes."""


@dataclass
class Composer:
    """Makes the series of a system's variables; what several need is made once.

    ``edges`` of the grid, shape (steps + 1,) [s of the clock]; ``notes`` are sentences on what was done, ``used`` the
    columns that were read.
    """

    system: System
    mapping: Mapping
    data: Measurements
    clock: Clock
    edges: np.ndarray
    notes: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    _weather: dict[str, Signal] = field(default_factory=dict)

    @property
    def step(self) -> float:
        """Step of the grid [s]."""
        return float(self.edges[1] - self.edges[0])

    def output(self, one: Output) -> Series | None:
        """The series of an output, or None if it is not mapped."""
        source = self.mapping.variables.get(one.name)
        return None if source is None else self._mapped(output_target(one), source, f"variables.{one.name}")

    def input(self, one: Input) -> Series | None:
        """The series of an input: mapped, of the weather, computed, or the description's; None if there is none."""
        target = input_target(one)
        if one.name in self.mapping.variables:
            return self._mapped(target, self.mapping.variables[one.name], f"variables.{one.name}")
        if isinstance(one, WeatherInput):
            return self._of_weather(target, one.column)
        if isinstance(one, ConstantInput):
            return self._assumed(target, one.value, "constant of the description")
        if isinstance(one, MeasuredInput):
            self.notes.append(f"{one.name}: not measured; the description's {one.value:g} {one.unit} stands in for it")
            return self._assumed(target, one.value, "assumed, not measured")
        if isinstance(one, ExcitationInput):
            return self._assumed(target, 0.0, "no excitation")
        if isinstance(one, ScheduleInput):
            made = schedule_signal(self.system.schedules[one.schedule], self.edges[0], self.edges[-1])
            self._tell_of_daylight_saving(one.name, one.schedule)
            table = merge({one.name: made}, self.edges[0], self.edges[-1])
            values = table.means(self.edges)[:, 0] if target.method == "mean" else made.at(self.edges[1:])
            return self._assumed(target, values, f"schedule {one.schedule} of the description")
        return None

    def _tell_of_daylight_saving(self, name: str, schedule: str) -> None:
        """A note where a schedule stands in on days on which clocks show an hour more than the recording's."""
        zone = find_zone(self.clock.zone, str(self.mapping.path))
        days = np.unique(np.floor(self.clock.utc(self.edges[:-1]) / DAY)) * DAY + DAY / 2
        offsets = [datetime.fromtimestamp(day, UTC).astimezone(zone).utcoffset() for day in days]
        moved = sum(one is not None and one.total_seconds() != self.clock.offset for one in offsets)
        if moved:
            self.notes.append(
                f"{name}: not measured; schedule {schedule!r} stands in for it, in standard time, an hour late by the"
                f" clocks of {moved} of {len(days)} days with daylight saving"
            )

    def _assumed(self, target: Target, value: float | np.ndarray, origin: str) -> Series:
        values = np.broadcast_to(np.asarray(value, dtype=np.float64), (len(self.edges) - 1,)).copy()
        return Series(target, origin, values, np.full(len(values), ASSUMED, dtype=np.int8))

    def _mapped(self, target: Target, source: Source, key: str) -> Series:
        where = f"{self.mapping.path}: {key}"
        if source.constant is not None:
            value = self._converted(source.constant, source, target.unit, where)
            return self._assumed(target, value, f"constant of the mapping: {value:.6g}")
        moving = target.unit in _MOVING and target.role == "output"
        signal = self._signal(source, target.unit, where, moving=moving)
        made = self._gridded(target, signal, source, f"{source.column} [{source.unit}]", where)
        if target.role == "output" and source.max_gap is None:
            lines = plausible.about_lines(str(source.column), signal, self.step)
            self.notes += [lines] if lines else []
        if source.compare is not None:
            meter = source.compare
            same = {name: getattr(source, name) for name in ("reading", "stamp", "interval", "max_gap")}
            own = {name: getattr(meter, name) for name in ("column", "unit", "scale", "offset", "persons")}
            second = Source(**own, **same)
            other = self._signal(second, target.unit, f"{where}.compare", moving=False)
            made.second, _ = resample(other, self.edges, target.method, self.mapping.grid.coverage)
            made.second_name = meter.column
        return made

    def _converted(self, value: float, source: Source, unit: str, where: str) -> float:
        density = self.mapping.air_density
        made = float(to_target(np.array(value), source, unit, density=density, where=where))
        check_possible(made, source, unit, density=density, where=where)
        return made

    def _signal(self, source: Source, unit: str, where: str, *, moving: bool) -> Signal:
        """A column as a judged signal; ``moving`` says that it never stands still."""
        column = str(source.column)
        where = f"{where}: column {column!r}"
        self.used.add(column)
        readings = self.data.numbers(column, where)
        density = self.mapping.air_density
        kind = source.reading or self.mapping.defaults.reading
        usual = plausible.sparse(self.data.utc, readings) if kind != "hold" and source.max_gap is None else None
        if usual is not None and kind == "point" and source.reading is None and source.unit in _STATES:
            raise RecordingError(
                f"{where}: is read every {usual / 3600:.3g} h only, and {source.unit} is no straight line between;"
                " expected reading = 'hold' if it is logged when it changes, or reading = 'point' to join its readings"
            )
        if usual is not None:
            self.notes.append(plausible.about_changes(column, kind, usual))
        signal = make_signal(
            self.clock.seconds(self.data.utc),
            readings,
            source,
            unit,
            kind=kind,
            stamp=source.stamp or self.mapping.defaults.stamp,
            density=density,
            where=where,
        )
        held = plausible.about_hold(column, signal) if source.max_gap is None else None
        self.notes += [held] if held else []
        if is_constant(signal):
            if moving:
                raise RecordingError(f"{where}: every reading is {signal.values[0]:g} {unit}; expected one that varies")
            self.notes.append(f"column {column}: every reading is {signal.values[0]:g} {unit}")
        signal = mark_impossible(signal, source, density=density, where=where)
        noise = plausible.about_noise(column, signal)
        self.notes += [noise] if noise else []
        if source.unit in ("percent", "%") and source.scale == 1 and 0 < float(np.nanmax(readings)) <= 1.0:
            self.notes.append(f"column {column}: declared in percent, but no reading is above 1; is it a fraction?")
        register = plausible.about_register(column, signal) if unit == "W" else None
        self.notes += [register] if register else []
        # a state is silent while nothing changes
        usual = _STUCK_AFTER if moving and kind != "hold" else 0.0
        hours = source.stuck_after if source.stuck_after is not None else usual
        signal = mark_stuck(signal, hours, except_zero=unit == "W/m2")
        if not signal.used.any():
            raise RecordingError(f"{where}: no reading can be used: all are impossible or stuck for over {hours:g} h")
        return signal

    def _gridded(self, target: Target, signal: Signal, source: Source, origin: str, where: str) -> Series:
        """A signal on the grid, an input's gaps filled as its mapping says: weather by short lines unless told."""
        values, flags = resample(signal, self.edges, target.method, self.mapping.grid.coverage)
        if target.role == "input" and target.method == "point":
            values = around(signal, self.edges)
        # an output may be below by its noise, which whoever fits it counts; what drives a simulation may not
        low = np.isfinite(values) & (values < signal.floor)
        if target.role == "input" and low.any():
            raised = np.where(low, signal.floor, values)
            told = plausible.about_floor(
                target.name, low, float(np.nanmean(values)), float(np.nanmean(raised)), target.unit
            )
            self.notes.append(told)
            values = raised
        flags |= np.bitwise_and.reduce(signal.flags) & np.int8(COMPUTED)
        if target.role == "input":
            fill = source.fill if source.fill is not None else self._usual_fill(source)
            if fill == "interpolate":
                values, flags = interpolate_short(values, flags, round(source.fill_up_to * 3600.0 / self.step))
            elif isinstance(fill, float):
                plain = Source(constant=fill, unit=source.unit, persons=source.persons)
                values, flags = fill_constant(values, flags, self._converted(fill, plain, target.unit, where))
        return Series(target, origin, values, flags, signal=signal)

    def _usual_fill(self, source: Source) -> str:
        return "interpolate" if any(one is source for one in self.mapping.weather.values()) else "none"

    def _of_weather(self, target: Target, column: str) -> Series | None:
        known = self.mapping.weather
        where = f"{self.mapping.path}: weather.{column}"
        unit = MEASURABLE.get(column, target.unit)
        if target.unit != unit and not _same(target.unit, unit):
            raise RecordingError(
                f"{self.system.path}: inputs {target.name!r}: unit is {target.unit!r}; expected {unit!r}, the unit of"
                f" weather column {column!r}"
            )
        if column in known:
            source = known[column]
            if source.constant is not None:
                return self._mapped(target, source, f"weather.{column}")
            return self._gridded(target, self.weather_signal(column), source, f"{source.column} [{source.unit}]", where)
        if column == "poa_global" and self._measured("ghi") and self.system.weather is not None:
            if self.mapping.place is None:
                raise RecordingError(f"{self.mapping.path}: place is missing; expected it to bring ghi to a plane")
            plane = self.system.weather
            signal = weather.on_the_plane(self.weather_signal("ghi"), self.clock, self.mapping.place, plane)
            made = self._gridded(target, signal, known["ghi"], f"computed from {known['ghi'].column}", where)
            made.comment = (
                f"{made.origin}: split by Erbs, carried by {plane.transposition} to tilt {plane.surface_tilt:g}, "
                f"azimuth {plane.surface_azimuth:g}; shadows of the surroundings are not in it"
            )
            self.notes.append(f"{target.name}: {made.comment}")
            return made
        if column == "temp_sky" and self._measured("temp_air"):
            others = {n: self.weather_signal(n) for n in ("temp_dew", "opaque_cover", "ghi") if self._measured(n)}
            signal, how = weather.sky(self.weather_signal("temp_air"), others, self.clock, self.mapping.place)
            made = self._gridded(target, signal, known["temp_air"], f"estimated from {known['temp_air'].column}", where)
            made.comment = f"not measured; estimated from {how}"
            self.notes.append(f"{target.name}: {made.comment}")
            helped = [plausible.about_helper(target.name, str(known[n].column), one) for n, one in others.items()]
            self.notes += [one for one in helped if one]
            return made
        return None

    def _measured(self, name: str) -> bool:
        return name in self.mapping.weather and self.mapping.weather[name].column is not None

    def weather_signal(self, name: str) -> Signal:
        """A mapped quantity of the weather, judged."""
        if name not in self._weather:
            unit = MEASURABLE[name]
            where = f"{self.mapping.path}: weather.{name}"
            self._weather[name] = self._signal(self.mapping.weather[name], unit, where, moving=unit in _MOVING)
            if unit == "1":
                _is_share(self._weather[name], where)
        return self._weather[name]

    def check_sun(self) -> None:
        """Hold the irradiance against the sun of the place: a wrong zone or clock shows here."""
        zone = plausible.about_zone(self.clock, self.mapping.place)
        self.notes += [zone] if zone else []
        if not self._measured("ghi") or self.mapping.place is None:
            return
        level = plausible.about_level(self.weather_signal("ghi"), self.clock, self.mapping.place)
        self.notes += [level] if level else []
        late, correlation, down = weather.sun_clock(self.weather_signal("ghi"), self.clock, self.mapping.place)
        if correlation > 0.5 and abs(late) >= 20:
            self.notes.append(
                f"the irradiance runs {abs(late):.0f} min {'behind' if late > 0 else 'ahead of'} the sun of this place "
                f"(correlation {correlation:.2f}): check time.zone, the stamps of its means, and shadows"
            )
        if down > 0.02:
            self.notes.append(f"{down:.0%} of the irradiance comes while the sun is down: check time.zone and place")


def _is_share(signal: Signal, where: str) -> None:
    """Refuse readings that are no share: tenths and oktas have no unit either."""
    seen = signal.clean().values
    wrong = seen[(seen < -ROUNDED) | (seen > 1 + ROUNDED)]
    if wrong.size:
        raise RecordingError(
            f"{where}: is {wrong[np.argmax(np.abs(wrong))]:g}; expected shares from 0 to 1: for tenths write scale ="
            " 0.1, for oktas scale = 0.125, and valid = [0, 1] where other readings are codes"
        )


def _same(unit: str, other: str) -> bool:
    """Whether two spellings are of one unit."""
    try:
        return bool(np.allclose(units.convert(np.array([0.0, 1.0]), unit, other, density=1.0, where=""), [0.0, 1.0]))
    except RecordingError:
        return False
