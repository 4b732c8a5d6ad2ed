"""What a recording says that cannot be, or that its system's description contradicts; and what would mend it.

Variables are found by what the description says of them: unit, kind of source, weather column, sources. No name is
known here. A finding is strong where physics leaves hardly another reading of it; others are hints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from diagnosis.delays import Delay, find_delays
from diagnosis.recording import DAY, HOUR, Recording
from shared.errors import RecordingError
from shared.possible import POSSIBLE
from shared.system import System
from shared.units import ABSOLUTE, TEMPERATURES, spelled
from shared.variables import (
    ZERO_CELSIUS,
    ConstantInput,
    ExcitationInput,
    Input,
    MeasuredInput,
    OccupancyInput,
    Output,
    ScheduleInput,
    WeatherInput,
)

Kind = Literal["offset", "clock", "night", "unit", "balance", "description"]
WHERE = "(docs/own-measurements.md, From my room to a description)"
ACCURACY = 50.0
"""What room sensors of CO2 are good for, and by how much outdoor air differs from what is assumed of it [ppm]: data
sheets of infrared sensors say 30 to 50 ppm and 2 to 3 % of the reading; towns lie some tens above the background."""
OFTEN = 0.05
"""Share of the readings that has to say so before an offset is believed: more than a lost reading or a window."""
BEYOND = 1.645
"""Standard deviations beyond which a twentieth of normal readings lies: that of :data:`OFTEN`."""
NIGHT = 5.0
"""Irradiance that is none [W/m2]: pyranometers of a good class have zero offsets below it by night (ISO 9060)."""
LIT = 0.01
"""Share of the brightest time of the day from which on it is day."""
NOON = 3.0
"""The middle of the light may be so far from twelve by the clock [h]: standard times differ from the sun's by up to
1.75 h, the equation of time adds 0.3 h, and hills or trees cut off the rest."""
LARGE, BEYOND_NOISE = 10.0, 100.0
"""So many times the largest number that the description has in this unit, and its sensor's noise, is no such thing."""
HOT = 311.15
"""The air outdoors is hardly anywhere above this half of the time [K], but a winter's degrees Fahrenheit are."""
HOTTEST = 323.15
"""It reaches this [K] in a few deserts only; the highest ever recorded on earth is 56.7 degC (Death
Valley, 10 July 1913; World Meteorological Organization)."""
WIDEST = 30.0
"""The air outdoors hardly ever moves by more within a day [K], and degrees Fahrenheit taken for Celsius do."""
COLDER = 3.0
"""Nothing indoors is colder than the air outdoors by so much on average [K], and varies more."""
COOLED = 1.0
"""A room that nothing cools is not so much colder than the air outdoors [K], on average over :data:`MEMORY`: sensors
err by less together, and persons, sun and heaters only warm it."""
MEMORY = 7 * DAY
"""Walls remember colder days for about so long [s]."""
POWERS = ("W", "kW")
"""Units of a heat flow."""
FOLLOWED = 2.0
"""A heated room is not so far below its set point [K] all day long: the widest usual band of a thermostat's control."""
SETTLED = 4.0
"""So long after the last change of a set point a room has to be there [h]."""
SET_BACK = 3.0
"""Hours that a night's set-back takes at least."""
SPOILED = 3.6
"""The smallest factor between units of flow that are taken for each other: litres a second and cubic metres an hour."""
GAS, AIR = 44.01, 28.97
"""Molar masses of CO2 and of dry air [g/mol]."""
DENSITY = 1.2
"""Of air indoors [kg/m3]."""


@dataclass(frozen=True)
class Finding:
    """What a recording says that cannot be.

    ``sentence`` says what was found, ``remedy`` what to write where; ``names`` are the variables that it is about;
    ``size`` [``unit``] by how much they are off. ``strong``: nothing that follows from the recording is to be believed
    before this is mended; else it is a hint.
    """

    kind: Kind
    names: tuple[str, ...]
    size: float
    unit: str
    sentence: str
    remedy: str
    strong: bool

    @property
    def text(self) -> str:
        """What was found and what to do about it."""
        return f"{self.sentence} {self.remedy}"


def check_physics(system: System, recording: Recording) -> list[Finding]:
    """What a recording says that cannot be, and where it contradicts its description, strong findings first.

    Nothing is simulated. Inputs that nobody measured are no evidence.
    """
    found = [*_clocks(system, recording)]
    told = {name for one in found for name in one.names}
    found += [one for one in _light(system, recording) if one.kind != "clock" or not told.issuperset(one.names)]
    found += [*_below_outdoors(system, recording), *_units(system, recording)]
    if not any(one.kind == "clock" for one in found):  # by a wrong clock, habits and balances look wrong as well
        found += [*_gas_balance(system, recording), *_description(system, recording)]
    return sorted(found, key=lambda one: not one.strong)


def warnings(findings: Sequence[Finding]) -> list[str]:
    """Strong findings as sentences, which stand before everything else."""
    return [f"Correct this before believing what follows: {one.text}" for one in findings if one.strong]


def hints(findings: Sequence[Finding]) -> list[str]:
    """All other findings as sentences, which stand after the answer."""
    return [f"Worth a look: {one.text}" for one in findings if not one.strong]


# ---------------------------------------------------------------- what is refused


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
    replayed = {one.column for one in system.inputs if one.source == "measured"}  # an actuator may well stand still
    for output, values in zip(system.outputs, recording.outputs, strict=True):
        seen = values[np.isfinite(values)]
        if len(seen) and (seen == seen[0]).all() and output.name not in replayed:
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


# ---------------------------------------------------------------- clocks


def _clocks(system: System, recording: Recording) -> Iterator[Finding]:
    """Columns whose stamps are hours off the others'."""
    for one in find_delays(system, recording):
        yield _about_delay(one, system)


def _about_delay(one: Delay, system: System) -> Finding:
    early = "after" if one.hours > 0 else "before"
    come = "comes" if len(one.names) == 1 else "come"
    size = abs(one.hours)
    inputs = set(system.input_names)
    if inputs.issuperset(one.names):
        what = f"what follows from {'it' if len(one.names) == 1 else 'them'} in the room"
    else:
        what = "what causes it" if len(one.names) == 1 else "what causes them"
    stamps = f"are {size:g} h {'late' if one.hours > 0 else 'early'}"
    rivals = "".join(f", or those of {_listed(some)} by as much the other way" for some in one.rivals)
    sentence = (
        f"{_listed(one.names)} {come} about {size:g} h {early} {what} ({_listed(one.causes)}): the time stamps of"
        f" {_listed(one.names)} {stamps}{rivals}."
    )
    remedy = (
        f"Write shift = {-one.hours * HOUR:.1f} under {_tables(one.names, system)} of the mapping (seconds that are"
        f" added to the column's stamps) and import again; where those are right, shift = {one.hours * HOUR:.1f} under"
        f" {_tables(one.rivals[0] if one.rivals else one.causes, system)}."
    )
    return Finding("clock", one.names, one.hours, "h", sentence, remedy, strong=True)


def _tables(names: Sequence[str], system: System) -> str:
    """Where variables stand in a mapping; what comes from the weather may be computed from several of its columns."""
    weather = {one.name: one.column for one in system.inputs if isinstance(one, WeatherInput)}
    tables = [f"[variables.{name}]" for name in names if name not in weather]
    columns = [weather[name] for name in names if name in weather]
    if columns:
        tables.append(f"the [weather.…] tables of {_listed([name for name in names if name in weather])}")
    return _listed(tables)


def _listed(names: Sequence[str]) -> str:
    return " and ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


# ---------------------------------------------------------------- a trace gas below that of the air outdoors


def _below_outdoors(system: System, recording: Recording) -> Iterator[Finding]:
    """Rooms with less CO2 than the air outdoors: persons and fires only add to it, plants hardly take of it."""
    outdoors = _outdoor_gas(system)
    if outdoors is None:
        return
    level = _values(recording, outdoors)
    for one, values in zip(system.outputs, recording.outputs, strict=True):
        excess = (values - level)[np.isfinite(values - level)]
        if spelled(one.unit) != "ppm" or len(excess) * recording.step < DAY:
            continue
        low = np.sort(excess)[: max(int(OFTEN * len(excess)), 1)][-1]
        step = np.diff(values - level)
        quiet = step[np.isfinite(step) & ((values - level)[1:] < np.quantile(excess, 0.25))]
        scatter = float(np.median(np.abs(quiet))) / 0.6745 / np.sqrt(2.0) if quiet.size else 0.0
        size = float(-low - BEYOND * scatter)
        if size <= ACCURACY:
            continue
        share = float(np.mean(excess < -BEYOND * scatter))
        mean = float(np.mean(level))
        assumed = outdoors.name not in recording.inputs or outdoors.name in recording.assumed
        sentence = (
            f"{one.name} is below the air outdoors ({outdoors.name}, {mean:.0f} ppm{', assumed' if assumed else ''}) in"
            f" {share:.0%} of the readings, by {size:.0f} ppm or more: occupants only add to it, so that the sensor"
            " reads too low by at least so much."
        )
        remedy = (
            f"Write offset = {round(size, -1):.0f} under [variables.{one.name}] of the mapping (in ppm) and import"
            f" again, or what the air outdoors has under [variables.{outdoors.name}]."
        )
        yield Finding("offset", (one.name,), -size, "ppm", sentence, remedy, strong=True)


def _outdoor_gas(system: System) -> Input | None:
    """The one input in ppm: what the air outdoors has of a trace gas."""
    found = [one for one in system.inputs if spelled(one.unit) == "ppm"]
    return found[0] if len(found) == 1 and (found[0].source != "measured" or found[0].value > 0) else None


def _values(recording: Recording, one: Input) -> np.ndarray:
    """An input over the steps, or the description's number where it was not recorded, shape (steps,)."""
    constant = one.value if isinstance(one, ConstantInput | MeasuredInput) else np.nan
    return recording.inputs.get(one.name, np.full(len(recording.time), constant))


# ---------------------------------------------------------------- light by night


def _light(system: System, recording: Recording) -> Iterator[Finding]:
    """Irradiance that does not end by night, or whose day has its middle far from noon."""
    days = int((recording.stop - recording.start) / DAY)
    if recording.step > HOUR or days < 3:
        return
    place = np.floor((recording.time - 0.5 * recording.step) % DAY / recording.step).astype(int)
    day = np.floor((recording.time - recording.start - 0.5 * recording.step) / DAY).astype(int)
    for one in system.inputs:
        values = recording.inputs.get(one.name)
        sun = isinstance(one, WeatherInput) and one.column.startswith(("ghi", "dni", "dhi", "poa"))
        sun = sun and spelled(one.unit) == "W/m2"
        if not sun or values is None or one.name in recording.assumed or np.ptp(values) == 0:
            continue
        dark = float(np.median([values[day == k].min() for k in range(days)]))
        if dark > NIGHT:
            sentence = f"{one.name} is not below {dark:.0f} W/m2 by night on most days: there is no sun then."
            remedy = (
                "Write what its column reads by night, with the opposite sign, as offset where it stands in the"
                " mapping, unless the sun does not set there."
            )
            yield Finding("night", (one.name,), dark, "W/m2", sentence, remedy, strong=False)
        course = np.bincount(place, values) / np.maximum(np.bincount(place), 1)
        noon = _middle(course - course.min() > LIT * np.ptp(course), recording.step)
        off = 0.0 if noon is None else (noon - 12.0 + 12.0) % 24.0 - 12.0
        if abs(off) > NOON:
            sentence = (
                f"The light of {one.name} has its middle at {noon:.1f} h by the recording's clock; in standard time"
                f" that is within {NOON:g} h of noon everywhere: its stamps, or those of all columns, are about"
                f" {abs(off):.0f} h {'late' if off > 0 else 'early'}."
            )
            remedy = (
                f"If it is alone in that, write shift = {-round(off) * HOUR:.1f} where its column stands in the"
                " mapping; if all columns keep that clock, correct time.zone or time.stamps; then import again."
            )
            yield Finding("clock", (one.name,), off, "h", sentence, remedy, strong=True)


def _middle(lit: np.ndarray, step: float) -> float | None:
    """The middle of the light [h] of a day whose steps are lit or not, opposite to its longest night; None if none."""
    count = len(lit)
    if lit.all() or not lit.any():
        return None
    begin = int(np.argmax(lit))
    turned = np.roll(lit, -begin)
    edges = np.flatnonzero(np.diff(np.concatenate([[1], turned.astype(int), [1]])))
    lengths = edges[1::2] - edges[::2]
    longest = int(np.argmax(lengths))
    if lengths[longest] * step < SETTLED * HOUR:
        return None
    middle = begin + 0.5 * (edges[2 * longest] + edges[2 * longest + 1]) + 0.5 * count
    return float(middle * step / HOUR % 24.0)


# ---------------------------------------------------------------- units


def _units(system: System, recording: Recording) -> Iterator[Finding]:
    """Quantities that are far from all that the description, or the weather, has in their unit."""
    for one, values in zip(system.outputs, recording.outputs, strict=True):
        yield from _still(one, values[np.isfinite(values)])
        yield from _too_large(one, values, system)
    for name in recording.inputs.keys() - recording.assumed.keys():
        if (described := next((one for one in system.inputs if one.name == name), None)) is not None:
            yield from _too_large(described, recording.inputs[name], system)
    for name, air in _air(system, recording).items():
        yield from _too_hot(name, air, recording)
        yield from _swapped(name, air, system, recording)


def _still(one: Output, seen: np.ndarray) -> Iterator[Finding]:
    """An output that moves by less than its sensor's noise, as one in too large a unit does."""
    noise = max((sensor.sd for sensor in one.noise.values()), default=0.0)
    if not len(seen) or not 0 < (spread := float(np.ptp(seen))) < noise:
        return
    sentence = (
        f"{one.name} varies by {spread:.3g} {one.unit} in all, from {seen.min():.6g} to {seen.max():.6g}, which is less"
        f" than its sensor's noise (standard deviation {noise:g} {one.unit})."
    )
    yield Finding("unit", (one.name,), spread, one.unit, sentence, _unit_of(one.name), strong=False)


def _unit_of(name: str) -> str:
    return f"Is the unit right? Then leave it; else write the column's own unit under [variables.{name}]."


def _too_large(one: Input | Output, values: np.ndarray, system: System) -> Iterator[Finding]:
    """A quantity without limits that is far larger than all that the description has in its unit.

    Numbers without a unit are of many kinds, and are not compared.
    """
    sizes = np.abs(values[np.isfinite(values)])
    limited = np.isfinite(POSSIBLE.get(spelled(one.unit), (0.0, np.inf))[1])
    largest, field = _largest(system, one.unit)
    if one.unit == "1" or (limited and (one.unit != "W/m2" or isinstance(one, WeatherInput))) or largest <= 0:
        return
    if not (sizes > 0).any():
        return
    usual = float(np.median(sizes[sizes > 0]))
    noise = max((sensor.sd for o in system.outputs if o.unit == one.unit for sensor in o.noise.values()), default=0.0)
    if usual <= max(LARGE * largest, BEYOND_NOISE * noise):
        return
    sentence = (
        f"{one.name} is usually {usual:.4g} {one.unit} where it is not 0, and the largest number in {one.unit} that the"
        f" description has is {largest:.4g} ({field})."
    )
    yield Finding("unit", (one.name,), usual, one.unit, sentence, _unit_of(one.name), strong=False)


def _too_hot(name: str, air: np.ndarray, recording: Recording) -> Iterator[Finding]:
    """Air outdoors (steps,) [K] that is hotter than it is anywhere, or moves by more within a day."""
    day = np.floor((recording.time - 0.5 * recording.step) / DAY).astype(int)
    swing = max(float(np.ptp(air[day == one])) for one in np.unique(day))
    middle, most = float(np.median(air)), float(air.max())
    if middle > HOT:
        size, found = middle - ZERO_CELSIUS, f"has a median of {middle - ZERO_CELSIUS:.1f} degC"
    elif most > HOTTEST:
        size = most - ZERO_CELSIUS
        found = f"reaches {size:.1f} degC (the highest ever recorded on earth is 56.7 degC)"
    elif swing > WIDEST:
        size, found = swing, f"moves by {swing:.1f} K within a day"
    else:
        return
    remedy = "Is its unit right (degF)? Write the column's own unit where it stands in the mapping."
    yield Finding("unit", (name,), size, "degC", f"{name}, the air outdoors, {found}.", remedy, strong=True)


def _swapped(name: str, air: np.ndarray, system: System, recording: Recording) -> Iterator[Finding]:
    """Temperatures that are colder than the air outdoors (steps,) [K] and vary more: columns may be swapped."""
    for one, values in zip(system.outputs, recording.outputs, strict=True):
        both = np.isfinite(values)
        if spelled(one.unit) not in TEMPERATURES or both.sum() < 2:
            continue
        inside, outside = _kelvin(values[both], one.unit), air[both]
        colder = float(np.mean(outside - inside))
        if colder > COLDER and inside.std() > outside.std():
            sentence = f"{one.name} is {colder:.1f} K colder on average than {name}, the air outdoors, and varies more."
            remedy = "Are their columns swapped? Exchange them in the mapping and import again."
            room = _room(system, recording)  # water, of a chiller for instance, may well be so
            alone = room is not None and room[0] == one.name
            yield Finding("unit", (one.name, name), colder, "K", sentence, remedy, strong=alone)


def _air(system: System, recording: Recording) -> dict[str, np.ndarray]:
    """The air outdoors as it was measured [K], by the input's name."""
    return {
        one.name: _kelvin(recording.inputs[one.name], one.unit)
        for one in system.inputs
        if isinstance(one, WeatherInput)
        and one.column == "temp_air"
        and spelled(one.unit) in TEMPERATURES
        and one.name in recording.inputs.keys() - recording.assumed.keys()
    }


def _kelvin(values: np.ndarray, unit: str) -> np.ndarray:
    unit = spelled(unit)
    celsius = (values - 32.0) / 1.8 if unit == "degF" else values
    return values if unit == "K" else celsius + ZERO_CELSIUS


def _largest(system: System, unit: str) -> tuple[float, str]:
    """The largest number that a description has in a unit, and its field; 0 if it has none."""
    found = [(one.max, f"max of parameter {one.name}") for one in system.parameters if one.unit == unit]
    found += [(abs(one.upper), f"upper of effect {one.name}") for one in system.effects if one.unit == unit]
    for one in system.inputs:
        if one.unit != unit:
            continue
        if isinstance(one, ConstantInput | MeasuredInput):
            found.append((abs(one.value), f"value of input {one.name}"))
        elif isinstance(one, ScheduleInput):
            hours = system.schedules[one.schedule]
            rows = [*hours.weekday, *(hours.weekend or [])]
            found += [(abs(value), f"schedules.{one.schedule}") for _, value in rows]
        elif isinstance(one, ExcitationInput):
            parts = system.excitations[one.excitation].components
            found += [(abs(part.amplitude), f"excitations.{one.excitation}") for part in parts]
    return max((one for one in found if np.isfinite(one[0])), default=(0.0, ""))


# ---------------------------------------------------------------- the balance of a trace gas


@dataclass(frozen=True)
class _Persons:
    """The persons of a system, how many there are at most, and the CO2 that one of them brings [kg/s]."""

    name: str
    most: int
    least_gas: float
    most_gas: float


def _persons(system: System) -> _Persons | None:
    """Persons and what they bring, as ``[[sources]]`` says; None where it does not."""
    crowd = [one.name for one in system.inputs if isinstance(one, OccupancyInput)]
    sources = [one for one in system.sources if one.input in crowd and spelled(one.unit) == "kg/s"]
    if len(crowd) != 1 or len(sources) != 1 or system.occupancy is None:
        return None
    per = sources[0].per
    ranges = {one.name: (one.min, one.max) for one in system.parameters}
    low, high = ranges[per] if isinstance(per, str) else (per, per)
    if low <= 0:
        return None
    return _Persons(crowd[0], system.occupancy.headcount[1], low, high)


def _gas_output(system: System, recording: Recording) -> np.ndarray | None:
    """The one output in ppm above the air outdoors, (steps,) [ppm]; None if there is no such thing."""
    outdoors = _outdoor_gas(system)
    found = [k for k, one in enumerate(system.outputs) if spelled(one.unit) == "ppm"]
    if outdoors is None or len(found) != 1:
        return None
    return np.asarray(recording.outputs[found[0]] - _values(recording, outdoors))


def _gas_balance(system: System, recording: Recording) -> Iterator[Finding]:
    """An air flow that would carry off far more, or far less, CO2 than the counted persons bring."""
    persons, excess = _persons(system), _gas_output(system, recording)
    counted = recording.inputs.get(persons.name) if persons is not None else None
    flows = {o.name: v for o, v in zip(system.outputs, recording.outputs, strict=True) if spelled(o.unit) == "kg/s"}
    for one in system.inputs:
        used = one.name in recording.inputs.keys() - recording.assumed.keys()
        if isinstance(one, MeasuredInput) and spelled(one.unit) == "kg/s" and used:
            flows.setdefault(one.name, recording.inputs[one.name])
    flows = {name: flow for name, flow in flows.items() if np.nansum(np.abs(flow)) > 0}
    if persons is None or excess is None or counted is None or persons.name in recording.assumed or len(flows) != 1:
        return
    ((name, flow),) = flows.items()
    known = np.isfinite(flow) & np.isfinite(excess)
    if known.sum() * recording.step < 3 * DAY:
        return
    carried = float(np.mean((flow * excess)[known])) * 1e-6 * GAS / AIR
    brought = float(np.mean(counted[known]))
    if carried <= 0 or brought <= 0:
        return
    least, most = carried / (brought * persons.most_gas), carried / (brought * persons.least_gas)
    factor = least if least > SPOILED else most if most < 1 / SPOILED else 1.0
    if factor == 1.0:
        return
    times = f"{factor:.2g} times" if factor > 1 else f"1/{1 / factor:.2g} of"
    sentence = (
        f"The air of {name} carries off {times} the CO2 that {persons.name} can bring, on average over the recording."
    )
    remedy = (
        f"Check the unit of {name} (l/s, m3/h and kg/s; per hour or per second) and that of {persons.name}; air that"
        " flows beside the meter, or occupants who were not counted, look alike."
    )
    yield Finding("balance", (name,), factor, "1", sentence, remedy, strong=False)


# ---------------------------------------------------------------- a room that is not the description's


def _description(system: System, recording: Recording) -> Iterator[Finding]:
    """What the description takes for granted and the recording contradicts."""
    yield from _cooled(system, recording)
    yield from _negative(system, recording)
    yield from _set_point(system, recording)
    yield from _crowded(system, recording)
    yield from _small(system, recording)


def _room(system: System, recording: Recording) -> tuple[str, np.ndarray] | None:
    """The air temperature of the room, (steps,) [K]; None where several outputs may be."""
    found = [k for k, one in enumerate(system.outputs) if spelled(one.unit) in TEMPERATURES]
    if len(found) > 1:
        found = [k for k in found if system.outputs[k].standard_name == "air_temperature"]
    if len(found) != 1 or not np.isfinite(recording.outputs[found[0]]).any():
        return None
    one = system.outputs[found[0]]
    return one.name, _kelvin(recording.outputs[found[0]], one.unit)


def _heat_below_zero(system: System, recording: Recording) -> bool:
    """Whether a measured heat flow is negative at times, beyond noise: then it is known that the room is cooled."""
    for one, values in _heats(system, recording):
        seen = values[np.isfinite(values)]
        noise = _heat_noise(system, one.unit)
        if len(seen) and float(np.quantile(seen, OFTEN)) < -2.0 * noise:
            return True
    return False


def _heat_noise(system: System, unit: str) -> float:
    """Standard deviation of a heat meter's noise [``unit``], of the noisiest preset; 0 if there is none."""
    return max((n.sd for one in system.outputs if one.unit == unit for n in one.noise.values()), default=0.0)


def _heats(system: System, recording: Recording) -> Iterator[tuple[Input | Output, np.ndarray]]:
    """Variables that are heat flows by their unit, with their values (steps,)."""
    yield from (pair for pair in zip(system.outputs, recording.outputs, strict=True) if pair[0].unit in POWERS)
    yield from (
        (one, recording.inputs[one.name])
        for one in system.inputs
        if one.unit in POWERS and one.name in recording.inputs.keys() - recording.assumed.keys()
    )


def _cooled(system: System, recording: Recording) -> Iterator[Finding]:
    """A room that is colder than the air outdoors on average."""
    room, air = _room(system, recording), _air(system, recording)
    if (
        room is None
        or len(air) != 1
        or recording.stop - recording.start < MEMORY
        or _heat_below_zero(system, recording)
    ):
        return
    ((outdoors, outside),) = air.items()
    name, inside = room
    both = np.isfinite(inside)
    colder = float(np.mean((outside - inside)[both]))
    if colder <= COOLED:
        return
    days = (recording.stop - recording.start) / DAY
    sentence = (
        f"{name} is {colder:.1f} K colder than {outdoors} on average over {days:.0f} days: occupants, sun and a heater"
        " only add heat, so that the room is cooled."
    )
    remedy = (
        "If its description only heats, map the cooler as a negative heat flow and calibrate with --replay, or describe"
        f" a cooled room {WHERE}."
    )
    yield Finding("description", (name,), colder, "K", sentence, remedy, strong=False)


def _negative(system: System, recording: Recording) -> Iterator[Finding]:
    """A measured heat flow that only takes heat out of a room which is warmer than outdoors: a sign is turned."""
    room, air = _room(system, recording), _air(system, recording)
    if room is None or len(air) != 1 or float(np.nanmean(room[1] - next(iter(air.values())))) < COLDER:
        return
    for one, values in _heats(system, recording):
        seen = values[np.isfinite(values)]
        noise = _heat_noise(system, one.unit)
        moves = len(seen) > 0 and float(seen.std()) > noise  # the zero of a meter does not
        if moves and float(seen.mean()) < -noise and float(np.quantile(seen, 1 - OFTEN)) <= 2.0 * noise:
            sentence = (
                f"{one.name} is {seen.mean():.3g} {one.unit} on average and hardly ever above zero, as a cooler's,"
                f" while {room[0]} is warmer than the air outdoors."
            )
            remedy = (
                f"If it heats, turn the sign of scale under [variables.{one.name}]: scale = -1 where there is none."
            )
            yield Finding("unit", (one.name,), float(seen.mean()), one.unit, sentence, remedy, strong=False)


def _set_point(system: System, recording: Recording) -> Iterator[Finding]:
    """A set point that the room stays below all day long, or at night only: another one, or a set-back."""
    wanted = [
        one
        for one in system.inputs
        if isinstance(one, ScheduleInput)
        and spelled(one.unit) in TEMPERATURES
        and one.name in recording.inputs
        and not _is_difference(one, system)
    ]
    room = _room(system, recording)
    if room is None or len(wanted) != 1 or recording.stop - recording.start < 3 * DAY:
        return
    name, target = room[0], wanted[0].name
    hours = _above(recording, room[1], _kelvin(recording.inputs[target], wanted[0].unit))
    known = np.isfinite(hours)
    below = known & (hours < -FOLLOWED)
    where = f"[variables.{target}], or write the hours into schedules.{wanted[0].schedule} {WHERE}"
    if known.sum() < 6 or not below.any():
        return
    size = float(-np.median(hours[below]))
    if below.sum() == known.sum():
        sentence = (
            f"{name} is {size:.1f} K below the set point {target} at all hours of working days: nothing follows it."
        )
        remedy = f"Map what the thermostat was set to as {where}; or the heater was off."
        yield Finding("description", (name,), size, "K", sentence, remedy, strong=False)
        return
    first, count = _longest(below)
    if count >= SET_BACK and (hours[known & ~below] > -0.5 * FOLLOWED).mean() > 0.5:
        sentence = (
            f"{name} is {size:.1f} K below the set point {target} from {first} to {(first + count) % 24} h of working"
            " days, and near it at others: a set-back that the set point does not have."
        )
        yield Finding("description", (name,), size, "K", sentence, f"Map the set-back as {where}.", strong=False)


def _above(recording: Recording, inside: np.ndarray, target: np.ndarray) -> np.ndarray:
    """By how much a room is above its set point (steps,) in the median of each hour of working days, (24,) [K].

    Of steps in which that has stood for :data:`SETTLED`; NaN for hours with fewer than three.
    """
    steps = max(round(SETTLED * HOUR / recording.step), 1)
    settled = np.isfinite(inside)
    settled[:steps] = False
    for back in range(1, min(steps, len(target) - 1) + 1):
        settled[back:] &= np.abs(target[back:] - target[:-back]) < 0.1
    begin = recording.time - 0.5 * recording.step
    settled &= np.floor(begin / DAY).astype(int) % 7 < 5
    hour = np.floor(begin % DAY / HOUR).astype(int)
    parts = [(inside - target)[settled & (hour == one)] for one in range(24)]
    return np.array([np.median(part) if len(part) > 2 else np.nan for part in parts])


def _longest(marked: np.ndarray) -> tuple[int, int]:
    """Begin and length of the longest run of marked hours of a day, over midnight too; some are, and some are not."""
    begin = int(np.argmin(marked))
    turned = np.roll(marked, -begin)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], turned.astype(int), [0]])))
    lengths = edges[1::2] - edges[::2]
    longest = int(np.argmax(lengths))
    return int((edges[2 * longest] + begin) % len(marked)), int(lengths[longest])


def _crowded(system: System, recording: Recording) -> Iterator[Finding]:
    """More persons than the description allows for."""
    crowd = [one.name for one in system.inputs if isinstance(one, OccupancyInput)]
    if system.occupancy is None:
        return
    for name in crowd:
        values = recording.inputs.get(name)
        most = system.occupancy.headcount[1]
        if values is None or name in recording.assumed or float(values.max()) <= most + 0.5:
            continue
        sentence = f"{name} reaches {values.max():.0f} occupants, and the description has {most} at most."
        remedy = (
            "An estimator never saw so many: widen [occupancy] headcount in a description of this room and train on it"
            f" {WHERE}."
        )
        yield Finding("description", (name,), float(values.max()), "1", sentence, remedy, strong=False)


def _small(system: System, recording: Recording) -> Iterator[Finding]:
    """CO2 that rises faster than the persons can make it in the smallest room that the description allows."""
    persons, excess = _persons(system), _gas_output(system, recording)
    volumes = [one for one in system.parameters if spelled(one.unit) == "m3" and one.min > 0]
    noise = [
        max((n.sd for n in one.noise.values()), default=0.0) for one in system.outputs if spelled(one.unit) == "ppm"
    ]
    counted = recording.inputs.get(persons.name) if persons is not None else None
    if persons is None or excess is None or len(volumes) != 1 or counted is None or persons.name in recording.assumed:
        return
    there = np.maximum(counted[1:], counted[:-1])
    rise = np.diff(excess)
    quickest = there * persons.most_gas * recording.step / (DENSITY * volumes[0].min) * 1e6 * AIR / GAS
    faster = (rise > quickest + 3 * np.sqrt(2) * noise[0]) & (there > 0) & np.isfinite(rise)
    if faster.sum() < max(3, OFTEN * ((there > 0) & np.isfinite(rise)).sum()):
        return
    size = volumes[0].min * float(np.median(quickest[faster] / rise[faster]))
    sentence = (
        f"CO2 rises faster than the occupants of {persons.name} can make it rise in {volumes[0].min:g} m3, the smallest"
        f" {volumes[0].name} of the description: as in {size:.0f} m3 or less, or with more occupants than were counted."
    )
    remedy = f"Write the room's volume under [fixed], or a range that holds it {WHERE}."
    yield Finding("description", (volumes[0].name,), size, "m3", sentence, remedy, strong=False)
