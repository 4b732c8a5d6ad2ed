"""All inputs of a system over a span of time, composed as its description says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from datagen.driving.disturbances import Change, changed_signals
from datagen.driving.occupancy import sample_occupancy
from datagen.driving.sampling import sample_given, sample_parameters, stream
from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.driving.weather import UNITS, WeatherTable, read_weather
from datagen.units import conversion
from shared.errors import SystemDescriptionError
from shared.signals import DrawnSchedule, Excitation, Schedule
from shared.system import System
from shared.variables import (
    ConstantInput,
    ExcitationInput,
    Input,
    MeasuredInput,
    OccupancyInput,
    ScheduleInput,
    WeatherInput,
)

TEMPERATURES = ("temp_air", "temp_dew", "temp_sky")
"""Weather columns that a shift of the temperature moves together."""
_HOUR = 3600.0
_DAY = 24 * _HOUR
_KNOTS_PER_PERIOD = 5


def build_inputs(
    system: System,
    *,
    root_seed: int,
    index: int,
    start: float,
    stop: float,
    excitation: bool = True,
    measured: Mapping[str, Piecewise] | None = None,
    overrides: Mapping[str, Piecewise] | None = None,
    changes: Mapping[str, list[Change]] | None = None,
) -> InputTable:
    """Compose the inputs of one system over ``start`` to ``stop`` [s since time zero].

    What an input is at a time depends on (root seed, index) and that time alone: it does not depend on the span. Raises
    SystemDescriptionError if an input asks for a weather column that is not known or in another unit, or an override
    for an input that is not declared; WeatherError if the system's weather file cannot be used; ValueError if the span
    is empty.

    Parameters
    ----------
    excitation
        Whether inputs of source ``excitation`` act; off, they are zero.
    measured
        Signals by the column that inputs of source ``measured`` name; those without one take their ``value``.
    overrides
        Signals by the name of an input, of any source.
    changes
        What disturbances make of inputs, by name (:mod:`datagen.driving.disturbances`).
    """
    measured, overrides = measured or {}, overrides or {}
    for name in overrides:
        if name not in system.input_names:
            raise SystemDescriptionError(
                f"{system.path}: {name!r} is to be overridden but is not an input; found "
                f"{', '.join(system.input_names) or 'none'}"
            )
    composer = _Composer(system, root_seed, index, start, stop, excitation, measured)
    signals = {
        one.name: overrides[one.name] if one.name in overrides else composer.signal(one) for one in system.inputs
    }
    return merge(changed_signals(signals, changes or {}), start, stop)


def system_weather(system: System, root_seed: int, index: int) -> WeatherTable:
    """The weather of one system: one of the description's files, drawn by the system's own stream.

    Raises SystemDescriptionError if the description has no weather; WeatherError if the file cannot be used.
    """
    if system.weather is None:
        raise SystemDescriptionError(f"{system.path}: has no [weather] table; expected one for a weather input")
    files = system.weather.files
    # a draw also when there is one file: cheap, and the same code path for all
    file = files[int(stream(root_seed, index, "weather").integers(len(files)))]
    given = sample_given(system, root_seed, index)
    settings: dict[str, Any] = {one.weather: given[one.name] for one in system.given if one.weather}
    shift = settings.pop("temperature_shift", 0.0)
    table = read_weather(system.weather.model_copy(update=settings), file, system.path.parent)
    if not shift:
        return table
    moved = {name: table.columns[name] + shift for name in TEMPERATURES if name in table.columns}
    return replace(table, columns=MappingProxyType({**table.columns, **moved}))


class _Composer:
    """Makes each input's signal; what several inputs share is made once."""

    def __init__(
        self,
        system: System,
        root_seed: int,
        index: int,
        start: float,
        stop: float,
        excitation: bool,
        measured: Mapping[str, Piecewise],
    ) -> None:
        self.system, self.root_seed, self.index = system, root_seed, index
        self.start, self.stop, self.excitation, self.measured = start, stop, excitation, measured
        self._weather: WeatherTable | None = None
        self._occupancy: Piecewise | None = None

    def signal(self, one: Input) -> Piecewise:
        """The signal of one declared input."""
        if isinstance(one, ConstantInput):
            return Piecewise.constant(one.value)
        if isinstance(one, MeasuredInput):
            return self.measured[one.column] if one.column in self.measured else Piecewise.constant(one.value)
        if isinstance(one, ScheduleInput):
            schedule = self.system.schedules[one.schedule]
            if schedule.drawn is not None:
                rng = stream(self.root_seed, self.index, f"schedule {one.schedule}")
                schedule = drawn_schedule(schedule.drawn, rng)
            return schedule_signal(schedule, self.start, self.stop)
        if isinstance(one, OccupancyInput):
            return self.occupancy()
        if isinstance(one, ExcitationInput):
            if not self.excitation:
                return Piecewise.constant(0.0)
            made = excitation_signal(self.system.excitations[one.excitation], self.start, self.stop)
            return _held(made) if one.interpolation == "previous" else made
        return self.weather(one)

    def occupancy(self) -> Piecewise:
        """Persons present: one draw for the system, however many inputs read it."""
        spec = self.system.occupancy
        if spec is None:
            raise SystemDescriptionError(f"{self.system.path}: has no [occupancy] table; expected one for its input")
        if self._occupancy is None:
            if spec.density is not None:
                density = float(stream(self.root_seed, self.index, "density").uniform(*spec.density))
                drawn = sample_parameters(self.system, self.root_seed, self.index)
                persons = round(density * float(drawn[self.system.parameter_names.index(spec.per)]))
                persons = min(max(persons, spec.headcount[0]), spec.headcount[1])
                spec = spec.model_copy(update={"headcount": (persons, persons)})
            rng = stream(self.root_seed, self.index, "occupancy")
            self._occupancy = sample_occupancy(spec, rng, self.start, self.stop)
        return self._occupancy

    def weather(self, one: WeatherInput) -> Piecewise:
        """A weather column in the unit of the input."""
        where = f"{self.system.path}: inputs {one.name!r}"
        if one.column not in UNITS:
            raise SystemDescriptionError(
                f"{where}: weather column is {one.column!r}; expected one of {', '.join(UNITS)}"
            )
        unit = UNITS[one.column]
        try:
            made = conversion(unit, one.unit)
        except ValueError as error:
            raise SystemDescriptionError(f"{where}: {error}; weather column {one.column!r} is in {unit!r}") from None
        if made is None:
            raise SystemDescriptionError(
                f"{where}: unit is {one.unit!r}; expected one that {unit!r}, the unit of weather column"
                f" {one.column!r}, can be converted to"
            )
        if self._weather is None:
            self._weather = system_weather(self.system, self.root_seed, self.index)
        signal = self._weather.signal(one.column, self.start, self.stop)
        if not made.nothing:
            signal = Piecewise(signal.times, made.to_fmu(signal.values), signal.kind)
        return _held(signal) if one.interpolation == "previous" else signal


def drawn_schedule(spec: DrawnSchedule, rng: np.random.Generator) -> Schedule:
    """The timetable of one system."""
    low, high, begin, end = (float(rng.uniform(*span)) for span in (spec.low, spec.high, spec.begin, spec.end))
    constant, weekends = rng.random(2)
    if constant < spec.constant:
        return Schedule(weekday=[(0.0, high)])
    weekday = [(0.0, low), (begin, high), (end, low)]
    return Schedule(weekday=weekday, weekend=None if weekends < spec.weekends else [(0.0, low)])


def schedule_signal(schedule: Schedule, start: float, stop: float) -> Piecewise:
    """A schedule over ``start`` to ``stop`` [s since time zero] as steps."""
    days = np.arange(np.floor(start / _DAY), np.ceil(stop / _DAY))
    weekend = days.astype(np.int64) % 7 >= 5
    parts_t, parts_v = [], []
    for rows, chosen in ((schedule.weekday, ~weekend), (schedule.weekend or schedule.weekday, weekend)):
        hours, values = np.array(rows, dtype=np.float64).T
        parts_t.append((days[chosen, None] * _DAY + hours * _HOUR).ravel())
        parts_v.append(np.tile(values, int(chosen.sum())))
    times, values = np.concatenate(parts_t), np.concatenate(parts_v)
    order = np.argsort(times, kind="stable")
    return Piecewise(times[order], values[order], "previous")


def excitation_signal(excitation: Excitation, start: float, stop: float) -> Piecewise:
    """A sum of sinusoids, sampled on a grid and linear between: what the grid holds is the signal.

    The grid is the hours, so that excitation adds no knots to those of the weather and hourly recordings reproduce
    it; finer, a whole part of an hour, where a period would have fewer than five knots.
    """
    shortest = min(component.period for component in excitation.components)
    step = _HOUR / max(1, int(np.ceil(_KNOTS_PER_PERIOD / shortest - 1e-9)))
    times = step * np.arange(np.floor(start / step), np.ceil(stop / step) + 1)
    values = np.zeros_like(times)
    for c in excitation.components:
        values += c.amplitude * np.sin(2 * np.pi * (times / (c.period * _HOUR) + c.phase))
    return Piecewise(times, values)


def _held(signal: Piecewise) -> Piecewise:
    """A linear signal as steps that hold each segment's mean: conserves what a plain sample-and-hold would shift."""
    means = np.append(0.5 * (signal.values[:-1] + signal.values[1:]), signal.values[-1])
    return Piecewise(signal.times, means, "previous")
