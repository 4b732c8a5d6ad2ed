"""The weather that a mapping names: measured, computed from what was measured, or said to be of no use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.measurements import plausible, units, weather
from diagnosis.measurements.grid import Series, Target, values_at
from diagnosis.measurements.judge import BEAM, MOVING, Judge
from diagnosis.measurements.mapping import MEASURABLE, Mapping, Source
from diagnosis.measurements.signal import Signal
from shared.errors import RecordingError
from shared.schema import ASSUMED
from shared.system import System
from shared.variables import WeatherInput

ROUNDED = 1e-3
"""A share beyond its ends by so little is rounded."""
MOST_DOWN = 0.5
"""Share of the irradiance with the sun down from which on clock, place or column cannot be right."""
_SUN = ("ghi", "dni", "dhi")


@dataclass
class Outdoors:
    """Makes the series of inputs that come from the weather; what several need is made once."""

    system: System
    judge: Judge
    _signals: dict[str, Signal] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)
    _useless: dict[str, str] = field(default_factory=dict)
    _closed: Signal | None = None

    @property
    def known(self) -> dict[str, Source]:
        """What the mapping names, by pvlib's names."""
        return self.judge.mapping.weather

    def series(self, target: Target, column: str) -> Series | None:
        """The series of an input that comes from a weather column, or None if it is neither measured nor computed.

        Raises RecordingError if the input is in another unit, readings cannot be used, or place is missing.
        """
        judge, where = self.judge, f"{self.judge.mapping.path}: weather.{column}"
        unit = MEASURABLE.get(column, target.unit)
        if target.unit != unit and not _same(target.unit, unit):
            raise RecordingError(
                f"{self.system.path}: inputs {target.name!r}: unit is {target.unit!r}; expected {unit!r}, the unit of"
                f" weather column {column!r}"
            )
        if column in self.known:
            source = self.known[column]
            self._taken.add(column)
            if source.constant is not None:
                return judge.mapped(target, source, f"weather.{column}")
            made = judge.gridded(target, self.signal(column), source, f"{source.column} [{source.unit}]", where)
            made.key = f"weather.{column}"
            return made
        if column == "poa_global":
            return self._on_the_plane(target, where)
        if column == "temp_sky":
            return self._sky(target, where)
        return None

    def _on_the_plane(self, target: Target, where: str) -> Series | None:
        plane, place = self.system.weather, self.judge.mapping.place
        measured = [name for name in _SUN if self._measured(name)]
        for name in _SUN:
            if name in self.known and not self._measured(name):
                self._useless[name] = (
                    f"{target.name} is computed from what the sun did, and a constant is no course of it"
                )
        if plane is None or not ("ghi" in measured or {"dni", "dhi"} <= set(measured)):
            why = (
                "takes ghi, or both dni and dhi, as columns" if plane else "needs a [weather] table in the description"
            )
            self._useless |= dict.fromkeys(measured, f"{target.name} {why}")
            return None
        if place is None:
            raise RecordingError(
                f"{self.judge.mapping.path}: place is missing; expected it to bring {' and '.join(measured)} to a plane"
            )
        ghi = self._global()
        assert ghi is not None  # what it takes was measured
        base_name = "ghi" if "ghi" in measured else "dhi"
        parts = {name: values_at(self.signal(name), ghi) for name in measured if name != "ghi"}
        self._taken |= set(measured)
        for name, one in parts.items():
            if not np.isfinite(one).any():
                self._useless[name] = f"{target.name} takes it at the readings of {base_name}, where it has none"
        signal = weather.on_the_plane(ghi, self.judge.clock, place, plane, **parts)
        signal, beyond = plausible.without_impossible(target.name, signal)
        self.judge.tell(beyond)
        if len(parts) == 2:
            self.judge.tell(
                plausible.about_closure(ghi, weather.global_of(ghi, **parts, clock=self.judge.clock, place=place))
            )
        columns = " and ".join(str(self.known[name].column) for name in measured)
        base = self._unfilled(target, base_name)
        made = self.judge.gridded(target, signal, base, f"computed from {columns}", where)
        made.key = f"weather.{base_name}"
        known = (
            np.any([np.isfinite(one) for one in parts.values()], axis=0) if parts else np.zeros(len(ghi.values), bool)
        )
        by = [f"measured {' and '.join(parts)}"] if known.any() else []
        by += [] if known.all() else [f"Erbs in {(~known).sum()} of {len(known)} readings" if by else "Erbs"]
        made.comment = (
            f"{made.origin}: split by {', by '.join(by)}, carried by {plane.transposition} to tilt"
            f" {plane.surface_tilt:g}, azimuth {plane.surface_azimuth:g}; shadows of the surroundings are not in it"
        )
        self.judge.tell(f"{target.name}: {made.comment}")
        return made

    def _sky(self, target: Target, where: str) -> Series | None:
        place = self.judge.mapping.place
        helpers = ["temp_dew", "opaque_cover", "relative_humidity"]
        if "temp_air" not in self.known:
            self._useless |= {
                name: f"{target.name} is computed from temp_air, which is not mapped"
                for name in helpers
                if name in self.known
            }
            return None
        others = {name: self.signal(name) for name in helpers[:2] if name in self.known}
        humid = "relative_humidity" in self.known and "temp_dew" not in others
        if humid:
            others["temp_dew"] = weather.dew_point(self.signal("temp_air"), self.signal("relative_humidity"))
            self._taken.add("relative_humidity")
        ghi = self._global() if "opaque_cover" not in others and place is not None else None
        if ghi is not None:
            others["ghi"] = ghi
        elif self._measured("ghi") and place is None and "opaque_cover" not in others:
            self._useless["ghi"] = f"{target.name} takes clouds from it where place says how high the sun stands"
        signal, how = weather.sky(self.signal("temp_air"), others, self.judge.clock, place)
        self._taken |= {"temp_air", *others}
        how = how.replace("dew point", "dew point of the relative humidity (Magnus)", 1) if humid else how
        air = self.known["temp_air"]
        base = self._unfilled(target, "temp_air")
        made = self.judge.gridded(target, signal, base, f"estimated from {air.column or 'a constant'}", where)
        made.key = "weather.temp_air"
        constant = [name for name in ("temp_air", *others) if name in self.known and not self._measured(name)]
        stands = f"; {' and '.join(constant)} as the mapping's constant" if constant else ""
        made.comment = f"not measured; estimated from {how}{stands}"
        self.judge.tell(f"{target.name}: {made.comment}")
        for name, one in others.items():
            if self._measured(name):
                self.judge.tell(
                    plausible.about_helper(target.name, str(self.known[name].column), one, signal.clean().middle)
                )
        return made

    def _unfilled(self, target: Target, name: str) -> Source:
        """The source of what is computed from, without a constant that stands in its gaps: it is none of the target.

        No sun makes no sun, though.
        """
        source = self.known[name]
        if not isinstance(source.fill, float) or (source.fill == 0 and name != "temp_air"):
            return source
        self.judge.tell(f"{target.name}: the fill of {name} is not one of it; its gaps are left")
        return source.model_copy(update={"fill": "none"})

    def _global(self) -> Signal | None:
        """Global horizontal irradiance: measured, or of direct and diffuse; None if neither is there."""
        if self._measured("ghi"):
            return self.signal("ghi")
        place = self.judge.mapping.place
        if place is None or not (self._measured("dni") and self._measured("dhi")):
            return None
        if self._closed is None:
            dhi = self.signal("dhi").clean()
            dni = values_at(self.signal("dni"), dhi)
            if not np.isfinite(dni).any():
                raise RecordingError(
                    f"{self.judge.mapping.path}: weather: dni has no reading where dhi has one; expected both at the"
                    " same times, or ghi"
                )
            self._closed = weather.global_of(dhi, dni, dhi.values, self.judge.clock, place)
        return self._closed

    def _measured(self, name: str) -> bool:
        return name in self.known and self.known[name].column is not None

    def signal(self, name: str) -> Signal:
        """A mapped quantity of the weather, judged; a constant over all steps.

        Raises RecordingError if it cannot be used.
        """
        if name not in self._signals:
            unit, source = MEASURABLE[name], self.known[name]
            where = f"{self.judge.mapping.path}: weather.{name}"
            if source.constant is None:
                made = self.judge.signal(source, unit, where, moving=unit in MOVING and name != BEAM)
            else:
                begin, end = self.judge.edges[:-1], self.judge.edges[1:]
                target = Target(name, "input", unit, "mean", sun=unit == "W/m2")
                values = np.full(len(begin), self.judge.converted(source.constant, source, target, where))
                flags = np.full(len(begin), ASSUMED, dtype=np.int8)
                made = Signal(begin, end, values, flags, "mean", np.inf, unit)
            if unit == "1":
                _is_share(made, where)
            self._signals[name] = made
        return self._signals[name]

    def check_sun(self, series: Sequence[Series]) -> None:
        """Hold each measured irradiance against the sun of the place: a wrong zone or clock shows here.

        ``series`` are of all variables: an irradiance may be mapped by an input's name, too. Raises RecordingError if
        most of an irradiance comes while the sun is down.
        """
        judge, place = self.judge, self.judge.mapping.place
        zone = plausible.about_zone(judge.clock, place)
        judge.tell(zone)
        found = self._irradiances(series)
        for key, name, signal in found:
            if name != "ghi" and not judge.says_how(_source(judge.mapping, key)):
                judge.tell(plausible.about_sun(key, signal))
        daylight = judge.daylight
        if place is None or daylight is None:
            if found:
                judge.notes.append(
                    f"{judge.mapping.path}: place is missing, so that neither an offset of the irradiance nor its clock"
                    " could be checked; expected [place] with latitude and longitude"
                )
            return
        for key, name, signal in found:
            what = "the irradiance" if key == "weather" else f"the irradiance of {key}"
            late, correlation, down = weather.sun_clock(signal, daylight)
            if name == "ghi":  # on a facade, the sun's height alone says neither how strong it is nor when strongest
                judge.tell(plausible.about_level(signal, judge.clock, place))
                judge.tell(plausible.about_dark(signal, judge.clock, place))
                if correlation > 0.5 and abs(late) >= 20:
                    judge.tell(
                        f"{what} runs {abs(late):.0f} min {'behind' if late > 0 else 'ahead of'} the sun of this place "
                        f"(correlation {correlation:.2f}): check time.zone, the stamps of its means, and shadows"
                    )
            if down > MOST_DOWN and plausible.is_light(signal):
                raise RecordingError(
                    f"{judge.mapping.path}: {key}: {down:.0%} of the irradiance comes while the sun is down at latitude"
                    f" {place.latitude:g}, longitude {place.longitude:g}; expected most of it by day: check time.zone,"
                    f" time.format, place, and which column is the irradiance{f' ({zone})' if zone else ''}"
                )
            if down > 0.02:
                judge.tell(f"{down:.0%} of {what} comes while the sun is down: check time.zone and place")

    def _irradiances(self, series: Sequence[Series]) -> list[tuple[str, str, Signal]]:
        """Irradiances that were measured: where they stand in the mapping, pvlib's name, and the readings [W/m2]."""
        ghi = self._global()
        found = [("weather", "ghi", ghi)] if ghi is not None else []
        alone = ("poa_global",) if ghi is not None else ("poa_global", "dni", "dhi")
        found += [
            (f"weather.{name}", name, self._signals[name])
            for name in alone
            if name in self._signals and self._measured(name)
        ]
        inputs = {one.name: one.column for one in self.system.inputs if isinstance(one, WeatherInput)}
        for one in series:
            name = one.target.name
            sun = one.target.sun and _same(one.target.unit, "W/m2")
            if sun and name in self.judge.mapping.variables and one.signal is not None:
                found.append((f"variables.{name}", inputs[name], one.signal))
        return found

    def tell_unused(self) -> None:
        """Say what the mapping names that no input takes and nothing was computed from."""
        for name, source in self.known.items():
            what = "a constant" if source.column is None else f"column {source.column}"
            why = self._useless.get(name)
            if why is None and name not in self._taken:
                why = "no input takes it, and none is computed from it"
            self.judge.tell(f"could not use weather.{name} ({what}): {why}" if why else None)
            if source.compare is not None:
                self.judge.tell(
                    f"could not use weather.{name}.compare (column {source.compare.column}): weather is compared under"
                    " variables only"
                )


def _is_share(signal: Signal, where: str) -> None:
    """Refuse readings that are no share: tenths and oktas have no unit either."""
    seen = signal.clean().values
    wrong = seen[(seen < -ROUNDED) | (seen > 1 + ROUNDED)]
    if wrong.size:
        raise RecordingError(
            f"{where}: is {wrong[np.argmax(np.abs(wrong))]:g}; expected shares from 0 to 1: for tenths write scale ="
            " 0.1, for oktas scale = 0.125, and valid = [0, 1] where other readings are codes"
        )


def _source(mapping: Mapping, key: str) -> Source:
    """What stands in a mapping under ``weather.NAME`` or ``variables.NAME``."""
    table, _, name = key.partition(".")
    return (mapping.weather if table == "weather" else mapping.variables)[name]


def _same(unit: str, other: str) -> bool:
    """Whether two spellings are of one unit."""
    try:
        return bool(np.allclose(units.convert(np.array([0.0, 1.0]), unit, other, density=1.0, where=""), [0.0, 1.0]))
    except RecordingError:
        return False
