"""What the columns of a log are: each with its reason, or left open.

A guess rests on a column's name first; its range, its unit and its course may only take a guess back, or tell apart
what the name leaves open. What no name tells is left open: a wrong column would be used without a word.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.measurements.layout import ROWS, Layout
from diagnosis.measurements.mapping import MEASURABLE, OPEN
from diagnosis.measurements.register import POWERS, is_register
from diagnosis.measurements.signal import even, logged_on_change
from diagnosis.measurements.table import Measurements
from diagnosis.measurements.units import convert
from diagnosis.measurements.vocabulary import (
    Meaning,
    meaning_of,
    measured_in,
    plain,
    unit_in,
    weather_meanings,
    words_for,
)
from shared.errors import RecordingError
from shared.possible import POSSIBLE
from shared.system import System
from shared.units import TEMPERATURES, spelled
from shared.variables import ConstantInput, MeasuredInput, OccupancyInput, ScheduleInput, WeatherInput

MOST_ODD = 0.1
"""Share of readings that may be impossible in a column's unit: codes for missing ones, and errors."""
HOUR = 3600.0
_NIGHT = (22.0, 3.0)
"""Hours in which the sun is down everywhere but near the poles in summer, on a clock that is daylight saving's, too."""
_WIDE, _NARROW = 25.0, 1.5
"""Temperatures of a room lie within so many kelvins nine tenths of the time; those outdoors beyond so many."""
_BREATH = 50.0
"""One person in a large room moves CO2 by more [ppm], as does the weather outdoors not."""
_WARM, _MILD = (12.0, 35.0), (54.0, 95.0)
"""Medians of a room's temperature [degC], [degF]: they do not overlap."""


@dataclass(frozen=True)
class Target:
    """What a column may be: a variable of the system or a quantity of the weather.

    ``averaged`` says that its means over steps are wanted; ``most`` is the highest number of persons.
    """

    table: str
    name: str
    unit: str
    quantities: frozenset[str]
    places: frozenset[str]
    roles: frozenset[str] = frozenset()
    averaged: bool = False
    most: float = np.inf


@dataclass(eq=False)
class Column:
    """A column of the file: what its name says, its readings (rows,) [as in the file], and what was made of it.

    ``fields`` are those of the mapping's table; ``reasons`` stand behind them by name; ``open`` says why it is nothing.
    """

    name: str
    meaning: Meaning
    values: np.ndarray
    hours: np.ndarray
    wall: np.ndarray
    target: Target | None = None
    fields: dict[str, object] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    second: Column | None = None
    open: str = ""

    @property
    def read(self) -> np.ndarray:
        """Which rows hold a reading."""
        return np.isfinite(self.values)

    @property
    def seen(self) -> np.ndarray:
        """The readings."""
        return self.values[self.read]

    @property
    def binary(self) -> bool:
        """Whether it holds 0 and 1 only."""
        return set(np.unique(self.seen)) == {0.0, 1.0}

    @property
    def rises(self) -> bool:
        """Whether it rises but for a reset, as a meter's register does."""
        rising = len(self.seen) > 3 and bool((np.diff(self.seen) >= 0).all())
        return is_register(self.seen) or (rising and len(np.unique(self.seen)) > 0.1 * len(self.seen))

    @property
    def on_change(self) -> bool:
        """Whether it is written only when it changes."""
        return not even(np.diff(self.wall[self.read])) and logged_on_change(self.seen)

    @property
    def looks(self) -> str:
        """Its range and course, for a comment."""
        if not self.seen.size:
            return "holds no numbers"
        low, high = float(self.seen.min()), float(self.seen.max())
        if low == high:
            return f"is always {low:g}"
        said = "0 and 1 only" if self.binary else f"{round(low, 9) + 0:.5g} to {round(high, 9) + 0:.5g}"
        if self.rises:
            falls = int((np.diff(self.seen) < 0).sum())
            return f"{said}, and {f'rises but for {falls} of its steps' if falls else 'only rises'}"
        peak = self.peak
        return f"{said}{f', highest about {peak:.0f} h' if peak is not None else ''}"

    @property
    def peak(self) -> float | None:
        """The hour of day in which it is highest on average, where hours tell more than chance would."""
        good = self.read & np.isfinite(self.hours)
        if good.sum() < 48 or np.std(self.values[good]) == 0:
            return None
        hour = self.hours[good].astype(int)
        count = np.bincount(hour, minlength=24)
        with np.errstate(invalid="ignore"):
            mean = np.bincount(hour, weights=self.values[good], minlength=24) / count
        explained = np.nansum(count * (mean - self.values[good].mean()) ** 2) / np.sum(
            (self.values[good] - self.values[good].mean()) ** 2
        )
        days = max(len(np.unique(np.floor(self.wall[good] / 86400.0))), 2)
        return float(np.nanargmax(mean)) if explained > 2.0 / days + 0.05 else None


def columns_of(layout: Layout) -> list[Column]:
    """The file's columns but those of the time stamps."""
    frame = layout.rows.frame.drop(columns=layout.columns)
    table = Measurements(
        layout.path, layout.wall, "", frame.fillna(""), layout.file.decimal, set(layout.file.missing),
        numeric=layout.rows.numeric,
    )  # fmt: skip
    hours = (layout.wall % 86400.0) / HOUR
    begin = f" in the first {ROWS} rows" if len(frame) == ROWS else ""
    found = []
    for k, name in enumerate(map(str, frame.columns)):
        twice = list(frame.columns).count(name) > 1
        try:
            values = table.numbers(name, "") if not twice else np.full(len(frame), np.nan)
            said = ""
        except RecordingError:
            values = np.full(len(frame), np.nan)
            texts = frame.iloc[:, k].fillna("").str.strip()
            texts = texts[texts != ""]
            said = f"text such as {str(texts.iloc[0])[:40]!r}" if len(texts) else f"it is empty{begin}"
        column = Column(name, meaning_of(name, layout.units.get(name, "")), values, hours, layout.wall)
        column.open = "another column has the same name" if twice else said
        found.append(column)
    if found and _numbers_rows(found[0]):
        found[0].open = "numbers of the rows"
    return found


def _numbers_rows(column: Column) -> bool:
    name = column.name.startswith("Unnamed:") or not column.name or "row_number" in column.meaning.quantities
    return name and len(column.seen) > 1 and bool((np.diff(column.seen) == 1).all())


def targets_of(system: System) -> list[Target]:
    """What a system's outputs and inputs, and the weather that they need, may be in a log."""
    found = []
    for one in system.outputs:
        says = meaning_of(f"{one.long_name} {one.standard_name}" if one.long_name else one.name)
        found.append(_target(one.name, one.unit, says, one.method == "mean"))
    wanted: dict[str, bool] = {}
    for given in system.inputs:
        if isinstance(given, WeatherInput):
            wanted[given.column] = given.column in MEASURABLE
        elif isinstance(given, OccupancyInput):
            most = float(system.occupancy.headcount[1]) if system.occupancy is not None else np.inf
            kinds = frozenset(("persons", "presence"))
            found.append(Target("variables", given.name, given.unit, kinds, frozenset(), averaged=True, most=most))
        elif isinstance(given, ScheduleInput) and spelled(given.unit) in TEMPERATURES:
            about = Target("variables", given.name, given.unit, frozenset(["temperature"]), frozenset())
            found.append(Target(**{**about.__dict__, "roles": frozenset(["set_point"])}))
        elif isinstance(given, ConstantInput | ScheduleInput | MeasuredInput):
            if isinstance(given, MeasuredInput) and given.column in system.output_names:
                continue  # the output's own column drives it
            found.append(_target(given.name, given.unit, meaning_of(given.name), given.interpolation == "previous"))
    if wanted.get("poa_global") or wanted.get("temp_sky"):
        wanted |= {"ghi": True, "dni": True, "dhi": True}
    if wanted.get("temp_sky"):
        wanted |= {"temp_air": True, "temp_dew": True, "opaque_cover": True, "relative_humidity": True}
    for name, tags in weather_meanings().items():
        if wanted.get(name):
            places = frozenset(one for one in tags[1:] if one == "outdoor")
            roles = frozenset(tags[1:]) - places
            found.append(Target("weather", name, MEASURABLE[name], frozenset(tags[:1]), places, roles))
    return [one for one in found if one.quantities]


def _target(name: str, unit: str, says: Meaning, averaged: bool) -> Target:
    """A variable by its unit and what its description says; none of a share, which may be of anything."""
    kinds = frozenset(measured_in(spelled(unit)))
    quantities = kinds & says.quantities or (kinds if len(kinds) == 1 or spelled(unit) in TEMPERATURES else frozenset())
    if spelled(unit) in TEMPERATURES and len(quantities) > 1:
        quantities = frozenset(["temperature"])
    if spelled(unit) == "ppm":
        quantities = frozenset(["co2"])
    places = says.places
    if not places and quantities <= {"temperature", "co2", "humidity"}:
        places = frozenset(["room"])  # a system is one of rooms
    return Target("variables", name, unit, frozenset(quantities), places, says.roles & {"set_point"}, averaged)


def guess(layout: Layout, system: System) -> list[Column]:
    """The columns of a file, each with what it is guessed to be or why it is left open."""
    columns = columns_of(layout)
    targets = targets_of(system)
    rivals: dict[int, list[Column]] = {}
    for column in columns:
        if column.open:
            continue
        k = _matching(column, targets, columns)
        if k is not None and _take(column, targets[k], columns, layout):
            rivals.setdefault(k, []).append(column)
    for k, several in rivals.items():
        _choose(several, targets[k])
    return columns


def _quantities(column: Column) -> frozenset[str]:
    """What a column measures, by its name and its unit; nothing if they contradict each other."""
    by_unit = frozenset(measured_in(column.meaning.unit))
    by_name = column.meaning.quantities
    if by_unit and by_name:
        return by_unit & by_name
    if by_name or "set_point" in column.meaning.roles:
        return by_name
    if column.meaning.unit in ("percent", "fraction", "presence", "persons", "ppm") and not column.meaning.words:
        return frozenset()
    return frozenset(["temperature"]) if "temperature" in by_unit else by_unit if len(by_unit) == 1 else frozenset()


def _matching(column: Column, targets: Sequence[Target], columns: Sequence[Column]) -> int | None:
    """The one target that a column is, by its name; else None, and the column says why."""
    meaning, quantities = column.meaning, _quantities(column)
    if meaning.roles & {"extreme", "forecast"}:
        column.open = f"its name says {words_for(meaning.roles & {'extreme', 'forecast'})}: {column.looks}"
        return None
    if len(quantities) != 1 and "set_point" not in meaning.roles:
        said = words_for(meaning.quantities | meaning.places)
        what = "its name tells too little" if not meaning.quantities else f"its name says {said}"
        column.open = f"{what}: {column.looks}"
        return None
    found = [k for k, one in enumerate(targets) if _fits(meaning, quantities, one)]
    if not found and not meaning.places:
        found = _only_one(column, quantities, targets, columns)
    if len(found) == 1:
        return found[0]
    said = words_for(quantities | meaning.places | (meaning.roles - {"mean", "count"}))
    alike = [one.name for one in targets if one.table == "variables" and quantities & one.quantities]
    which = "does not say of which place" if alike and not meaning.places else "is nothing that this system takes"
    if alike and meaning.places and "temperature" not in quantities:  # a flow goes on, a temperature is another there
        which = f"the system has elsewhere: write {' or '.join(alike[:3])} for the ? if this is the same here"
    which = f"may be {' or '.join(targets[k].name for k in found)}" if found else which
    column.open = f"{said}, which {which}: {column.looks}{_of_use(column, quantities)}"
    return None


def _of_use(column: Column, quantities: frozenset[str]) -> str:
    """What could be made of what no system takes as it is."""
    if "position" in quantities:
        return "; if its full flow is known, scale = that flow makes it a flow"
    return ""


def _fits(meaning: Meaning, quantities: frozenset[str], target: Target) -> bool:
    places, roles = meaning.places, meaning.roles
    if ("set_point" in roles) != ("set_point" in target.roles):
        return False
    if "set_point" in roles:
        return quantities <= {"temperature"} and places <= {"room", "heating"}
    if target.quantities == {"irradiance"}:
        sun = roles & {"global", "direct", "diffuse", "tilted"}
        wanted = target.roles or frozenset(["global"])
        return (
            quantities == {"irradiance"}
            and places <= {"outdoor"}
            and (sun - ({"global"} if len(sun) > 1 else set()) or {"global"}) == wanted
        )
    if quantities & {"energy"} and "power" in target.quantities:
        return bool(places) and places == target.places
    if not quantities & target.quantities:
        return False
    if target.table == "weather":
        return places <= {"outdoor"} if not target.places else places == target.places
    if target.quantities <= {"persons", "presence"}:
        return places <= {"room"}
    return places == target.places


def _only_one(
    column: Column, quantities: frozenset[str], targets: Sequence[Target], columns: Sequence[Column]
) -> list[int]:
    """The room's variable that a column without a place must be: the name of no other column says the room's."""
    found = [
        k
        for k, one in enumerate(targets)
        if quantities & one.quantities
        and one.places == {"room"}
        and not one.roles
        and not column.meaning.roles - {"mean"}
    ]
    alike = [
        one
        for one in columns
        if one is not column
        and not one.open
        and _quantities(one) == quantities
        and not one.meaning.roles & {"set_point", "extreme", "forecast"}
    ]
    if len(found) != 1 or any(one.meaning.places <= {"room"} and one.meaning.places for one in alike):
        return []
    others = [one for one in alike if not one.meaning.places]
    elsewhere = any("outdoor" in one.meaning.places for one in alike)
    if quantities == {"temperature"} and not elsewhere:  # it may be the outdoor air's, but not beside a room's CO2
        beside = [one for one in columns if "co2" in one.meaning.quantities and one.meaning.places <= {"room"}]
        if others or len(alike) or len(beside) != 1:
            return []
    elif quantities == {"temperature"} and others:
        return []
    column.reasons["place"] = (
        "no other column is said to be of the room" if alike or elsewhere else "it is the only one"
    )
    return found


def _take(column: Column, target: Target, columns: Sequence[Column], layout: Layout) -> bool:
    """Make a column a target, with its unit and kind of reading; False if its values contradict that."""
    outdoors = target.table == "weather" and target.quantities == {"temperature"}
    if outdoors and _days(column) > 3 and float(np.ptp(np.quantile(column.seen, [0.05, 0.95]))) < _NARROW:
        column.open = f"its name says the air outdoors, which varies more in so many days: {column.looks}"
        return False
    unit, why, fields = _unit(column, target, columns, layout)
    if unit == OPEN and ("energy" in _quantities(column) or target.quantities <= {"persons", "presence"}):
        column.open = f"{why}: {column.looks}"
        return False
    if unit != OPEN and "reading" not in fields:
        odd = _impossible(column, unit, float(str(fields.get("scale", 1.0))), target)
        if odd:
            column.open = f"its name says {target.name}, but {odd}: {column.looks}"
            return False
    column.target = target
    said = " and ".join(repr(one) for one in column.meaning.words) or repr(column.name)
    column.reasons["column"] = f"the name says {said}; {column.looks}"
    if place := column.reasons.pop("place", ""):
        column.reasons["column"] += f"; {place}"
    column.reasons["unit"] = why
    column.fields = {"column": column.name, "unit": unit, **fields}
    reading, reason = (
        ("register", "a meter's register: the power between its readings is taken")
        if "reading" in fields
        else _reading(column, target)
    )
    if reading:
        column.fields["reading"] = reading
    column.reasons["reading"] = reason
    return True


def _impossible(column: Column, unit: str, scale: float, target: Target) -> str:
    """What is wrong with a column's values in a unit; empty if nothing is."""
    if target.quantities <= {"persons", "presence"}:
        negative = float((column.seen < 0).mean())
        return "readings are below zero" if negative > MOST_ODD else ""
    try:
        values = convert(scale * column.seen, unit, target.unit, density=1.2, where="")
    except RecordingError:
        return f"{unit} is no unit of it"
    low, high = POSSIBLE.get(spelled(target.unit), (-np.inf, np.inf))
    share = float(((values < low) | (values > high)).mean())
    if share > MOST_ODD:
        return f"{share:.0%} of its readings are impossible in {unit}"
    if target.places == {"room"} and target.quantities == {"temperature"} and not target.roles:
        middle = float(np.median(convert(column.seen, unit, "degC", density=1.2, where="")))
        if not 0.0 <= middle <= 45.0:
            return f"no room is at {middle:.3g} degC half of the time"
        if float(np.ptp(np.quantile(values, [0.05, 0.95]))) > _WIDE:
            return "no room varies so much"
    if target.quantities == {"co2"} and "place" in column.reasons and float(np.ptp(values)) < _BREATH:
        return "nobody breathes there"
    if target.quantities == {"irradiance"} and (dark := _by_night(column)) > 0.5:
        return f"{dark:.0%} of it comes between 22 h and 3 h"
    return ""


def _days(column: Column) -> float:
    """The days that a column spans."""
    wall = column.wall[column.read & np.isfinite(column.wall)]
    return float(np.ptp(wall)) / 86400.0 if wall.size else 0.0


def _by_night(column: Column) -> float:
    """The share of a column's sum that comes by night."""
    good = column.read & np.isfinite(column.hours)
    values = np.maximum(column.values[good], 0.0)
    night = (column.hours[good] >= _NIGHT[0]) | (column.hours[good] < _NIGHT[1])
    return float(values[night].sum() / values.sum()) if values.sum() > 0 else 0.0


def _unit(
    column: Column, target: Target, columns: Sequence[Column], layout: Layout
) -> tuple[str, str, dict[str, object]]:
    """A column's unit, why, and further fields that go with it; the unit is left open if nothing tells."""
    unit, seen = column.meaning.unit, column.seen
    if target.quantities <= {"persons", "presence"}:
        return _occupancy(column, target)
    if "energy" in _quantities(column):
        return _energy(column, layout)
    if unit:
        told = "the row below the names says" if layout.units.get(column.name) else "the name says"
        return unit, f"as {'its cells say' if column.name in layout.rows.units else told}", {}
    middle, high = float(np.median(seen)), float(seen.max())
    if target.quantities == {"temperature"}:
        return (*_degrees(column, target, columns), {})
    if target.quantities == {"co2"} and 300 <= middle <= 5000:
        return "ppm", f"half of the readings are above {middle:.4g}", {}
    if target.quantities == {"irradiance"} and 50 < high <= 1500:
        return "W/m2", f"the highest reading is {high:.4g}", {}
    if target.quantities == {"wind_speed"} and high <= 40 and float(seen.mean()) < 6:
        return "m/s", f"{float(seen.mean()):.2g} on average; km/h would be calm all the time", {}
    if target.quantities == {"humidity"} and 0 < high <= 110:
        return ("percent" if high > 1.5 else "fraction"), f"the highest reading is {high:.4g}", {}
    if target.quantities == {"pressure"}:
        for one, low, most in (("hPa", 500, 1100), ("Pa", 50_000, 110_000), ("kPa", 50, 110)):
            if low <= middle <= most:
                return one, f"half of the readings are above {middle:.5g}", {}
    return OPEN, "neither name nor range tells it", {}


def _degrees(column: Column, target: Target, columns: Sequence[Column]) -> tuple[str, str]:
    """The unit of a temperature whose name says none: by a room's usual range, its own or that of another column."""
    for one in [column, *columns]:
        temperature = "temperature" in _quantities(one) or "set_point" in one.meaning.roles
        room = one.meaning.places <= {"room"} and (one is not column or target.places <= {"room"})
        if not temperature or not room or not one.seen.size:
            continue
        middle = float(np.median(one.seen))
        other = "" if one is column else f" of {one.name}"
        if one.meaning.unit in TEMPERATURES:
            return one.meaning.unit, f"as the name{other} says"
        for unit, low, high in (("degC", *_WARM), ("degF", *_MILD), ("K", 273.0, 310.0)):
            if low <= middle <= high:
                return unit, f"half of the readings{other} are above {middle:.4g}"
    return OPEN, "neither name nor range tells it"


def _occupancy(column: Column, target: Target) -> tuple[str, str, dict[str, object]]:
    if column.meaning.unit in ("percent", "fraction"):
        return OPEN, "a share is neither a count of persons nor presence", {}
    counted = (
        "persons" in column.meaning.quantities or column.meaning.unit == "persons" or "count" in column.meaning.roles
    )
    if counted or (
        not column.binary and bool((column.seen % 1 == 0).all()) and 1 < column.seen.max() <= 2 * target.most
    ):
        return "persons", "whole numbers" if not counted else "the name says persons", {}
    if column.binary:
        return "presence", "0 and 1 only", {"persons": OPEN if target.most > 1 else 1.0}
    return OPEN, "neither whole numbers nor 0 and 1", {}


def _energy(column: Column, layout: Layout) -> tuple[str, str, dict[str, object]]:
    """A register, or the energy of each interval as a power."""
    unit = column.meaning.unit
    if unit and column.rises:
        return unit, "as the name says", {"reading": "register"}
    if not unit or not layout.interval or layout.file.names is not None:
        what = "a meter's register" if column.rises else "an energy"
        return OPEN, f"{what}, and {'how long it is of' if unit else 'its unit'} is not known", {}
    power, factor = POWERS[unit]
    scale = factor / layout.interval
    return power, f"{unit} within {layout.interval:g} s each, by the scale", {"scale": scale}


def _reading(column: Column, target: Target) -> tuple[str, str]:
    """What a column's readings are, and why; nothing of irradiance, about which the import says what it took."""
    if "mean" in column.meaning.roles:
        return "mean", "the name says so"
    if target.quantities <= {"persons", "presence"} or target.roles == {"set_point"}:
        return "hold", "a state, which holds until the next reading"
    if column.on_change:
        return "hold", "it is written only when it changes"
    if target.averaged:
        return "mean", 'most loggers write means of it; "point" if these are instants'
    if target.quantities == {"irradiance"}:
        return "", 'reading = "mean" if the logger writes means'
    return "point", 'an instant; "mean" if the logger writes means'


def _numbers(name: str) -> tuple[str, ...]:
    """The numbers in a column's name, as of rooms or meters, but those of a substance or a unit."""
    return tuple(re.findall(r"\d+", re.sub(r"co ?2|m ?[23]\b|pm ?\d+", " ", plain(unit_in(name)[1]))))


def _choose(several: Sequence[Column], target: Target) -> None:
    """Of columns that may be one target the one that is used; a second is compared with it, others are left open."""

    def worth(one: Column) -> tuple[bool, bool, int]:
        return one.fields["unit"] != OPEN, one.fields["unit"] == "persons", int(one.read.sum())

    apart = "set_point" in target.roles or len({_numbers(one.name) for one in several}) > 1
    if len(several) > 1 and target.table == "variables" and apart:
        for one in several:
            rest = " and ".join(other.name for other in several if other is not one)
            whose = "for heating or for cooling" if "set_point" in target.roles else "of several rooms"
            one.target = None
            one.open = f"may be {target.name}, and so may {rest}: {whose}? {one.looks}"
        return
    most = max(int(one.read.sum()) for one in several)
    # a count of persons says more than presence, if it is there for most of the time
    good = [one for one in several if one.read.sum() >= 0.5 * most]
    best = max(good, key=worth)
    others = [one for one in several if one is not best]
    if others:
        why = "counts persons" if best.fields["unit"] == "persons" else "has most readings"
        best.reasons["column"] += f"; of {len(several)} columns that may be it this one {why}"
    for one in others:
        compared = (
            best.second is None
            and target.table == "variables"
            and OPEN not in (one.fields["unit"], one.fields.get("persons"))
            and "register" not in (one.fields.get("reading"), best.fields.get("reading"))
        )
        if compared and target.quantities != {"persons", "presence"}:
            best.second = one
        one.target = None
        one.open = f"{'compared with' if best.second is one else 'may be'} {target.name}, as {best.name}: {one.looks}"
