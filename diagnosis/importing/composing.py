"""Each variable of a system as a regular series: found in the measurements, computed, or taken from the description."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from datagen.driving.inputs import schedule_signal
from datagen.driving.tables import merge
from diagnosis.importing import plausible
from diagnosis.importing.clock import Clock, find_zone
from diagnosis.importing.judging import Judge
from diagnosis.importing.mapping import Mapping
from diagnosis.importing.outdoors import Outdoors
from diagnosis.importing.reading import Measurements
from diagnosis.importing.series import Series, input_target, output_target
from diagnosis.importing.units import COUNTS
from shared.system import System
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
                    f"{one.name}: {made.values[0]:g} persons at all hours, nights too, as the mapping states: a"
                    " calibration, forecast or diagnosis takes that for a count, unless told --occupancy unknown"
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
        zone = find_zone(self.clock.zone, str(self.mapping.path))
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
