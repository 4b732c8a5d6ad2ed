"""``describe``: what an FMU is, and a system description of it that runs, drafted from its own model description."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmpy.model_description import ModelDescription, ScalarVariable

from datagen.fmi.fmu import UNSET, fmu_sha256, is_difference, start_of, unit_of, unpack
from datagen.fmi.interface import lacks, library, missing_libraries
from datagen.units import UNITLESS, conversion, parsed
from shared.errors import FmuError
from shared.refused import meant
from shared.results import Result
from shared.store import write_atomically
from shared.variables import RESERVED

if TYPE_CHECKING:
    import pandas as pd

MOST_CANDIDATES = 20
"""Of more than these all but the first stand commented out: drawn all at once they seldom make a building."""
SPAN = 3.0
"""A drafted range goes from a third of the start value to three times as much."""
WARM = 10.0
"""A drafted range of a temperature goes so far to either side [K]."""
ACCURACY = 1e-4
"""Share of an output's nominal value, or of 1, to which its noise-free values are taken to be good."""
_FLOATS = ("Real", "Float64")
_WEATHER = (  # column, the kind of its unit, and words of its name
    ("temp_sky", "K", r"sky|tblasky"),
    ("temp_dew", "K", r"dew"),
    ("temp_air", "K", r"dry.?bul|out|amb|ext|air.?temp|weather|^t_?a(mb)?$|^te$|^to$"),
    ("wind_speed", "m/s", r"win.*(spe|vel)|wind"),
    ("wind_direction", "rad", r"win.*dir"),
    ("pressure", "Pa", r"atm|baro|p_?air|patm"),
    ("dni", "W/m2", r"dir.*nor|dni|beam"),
    ("dhi", "W/m2", r"dif|dhi"),
    ("ghi", "W/m2", r"glo|hor|ghi"),
    ("poa_global", "W/m2", r"fac|sol|sun|irr|rad|^s$|^h"),
)
_PERSONS = r"^n?_?per(s|$|[A-Z_])|people|occ|person|persons|head"
_SET_POINT = r"set|_sp$|sp$|ref"


@dataclass(frozen=True, repr=False)
class Description(Result):
    """What an FMU says of itself.

    Attributes
    ----------
    version, kinds, platforms
        Of FMI; ``Model Exchange`` and ``Co-Simulation``; folders with binaries.
    states, indicators
        Numbers of continuous states and event indicators (of Model Exchange).
    runs_here
        Whether one of them is for this machine.
    missing
        Shared libraries that its binary for this machine needs and that are not there; None where nothing can tell.
    without_unit
        Inputs and outputs without a unit.
    inputs, outputs, parameters
        How many there are; ``parameters`` are positive numbers that can be set.
    toml
        A system description, commented, that ``datagen simulate`` runs.
    """

    path: Path
    version: str
    kinds: tuple[str, ...]
    platforms: tuple[str, ...]
    states: int
    indicators: int
    runs_here: bool
    missing: tuple[str, ...] | None
    without_unit: tuple[str, ...]
    inputs: int
    outputs: int
    parameters: int
    toml: str

    @property
    def headline(self) -> str:
        """The file, what it is and how much it offers."""
        kinds = " and ".join(self.kinds) or "no kind that can be simulated"
        counts = f"{self.inputs} inputs, {self.outputs} outputs, {self.parameters} parameters"
        return f"{self.path.name}: FMI {self.version}, {kinds}; {counts}"

    def to_dataframe(self) -> pd.DataFrame:
        """What :meth:`sentences` says, a row each."""
        import pandas as pd

        return pd.DataFrame({"about the FMU": self.sentences()})

    @property
    def drafted(self) -> bool:
        """Whether the draft has all that a simulation needs."""
        return self.outputs > 0 and self.parameters > 0

    def sentences(self) -> list[str]:
        """What a reader should know before the description is used."""
        said = [
            f"FMI {self.version}, {' and '.join(self.kinds) or 'no kind that can be simulated'};"
            f" {self.states} states, {self.indicators} event indicators",
            f"binaries for {', '.join(self.platforms) or 'no platform'}"
            + ("" if self.runs_here else ": none for this machine; export it for this platform, too"),
            f"{self.inputs} inputs, {self.outputs} outputs, {self.parameters} positive parameters that can be set",
        ]
        lacking = [
            f"no {what}"
            for what, count in (("output that is a Real or Float64", self.outputs), ("parameter", self.parameters))
            if not count
        ]
        if lacking:
            said.append(
                f"the draft does not run yet, for the FMU offers {' and '.join(lacking)}: name another variable of it"
                " in [[outputs]] or [[parameters]]"
            )
        if self.missing:
            said += [f"its binary {lacks(name)}" for name in self.missing]
        if self.without_unit:
            some = ", ".join(self.without_unit[:6]) + (" ..." if len(self.without_unit) > 6 else "")
            said.append(
                f"{len(self.without_unit)} inputs and outputs state no unit ({some}): check the drafted ones, and write"
                ' fmu_unit = "..." where the FMU computes in one'
            )
        return said


def describe(fmu: Path | str, *, out: Path | str | None = None, parameters: Sequence[str] | None = None) -> Description:
    """Describe an FMU, and draft the system description that the other commands need.

    The draft runs as it is: inputs of the weather and persons are guessed by name and unit, every other one stays at
    its start value. What is guessed says so in a comment. Parameters are candidates, from a third of their start value
    to three times as much.

    Parameters
    ----------
    fmu
        An FMU of FMI 2.0 or 3.0.
    out
        Where the description goes (TOML), if it is wanted as a file. The FMU stays where it is.
    parameters
        Names of those that are to be estimated; the draft then has no others.

    Raises
    ------
    FmuError
        If it is no readable FMU, one of the parameters is no candidate of it, or the file exists or cannot be written.

    Examples
    --------
    >>> from shared.shipped import resolved
    >>> found = describe(resolved("MixedAirCO2").parent / "MixedAirCO2.fmu")
    >>> found.version, found.kinds, found.states
    ('2.0', ('Model Exchange',), 18)
    """
    path = Path(fmu)
    place = None if out is None else Path(out)
    if place is not None and (place.suffix != ".toml" or place.exists()):
        what = "exists" if place.exists() else f"ends in {place.suffix!r}"
        raise FmuError(f"{place}: {what}; expected a new file that ends in .toml")
    folder, model = unpack(path, fmu_sha256(path))
    kinds = {"Model Exchange": model.modelExchange, "Co-Simulation": model.coSimulation}
    binaries = folder / "binaries"
    interface = model.modelExchange or model.coSimulation
    binary = library(folder, interface.modelIdentifier) if interface is not None else None
    scalars = [v for v in model.modelVariables if not v.shape]
    inputs = [v for v in model.modelVariables if v.causality == "input"]
    outputs = [v for v in scalars if v.causality == "output" and v.type in _FLOATS]
    candidates = [v for v in scalars if _is_candidate(v)]
    chosen = candidates if parameters is None else _chosen(path, candidates, parameters)
    found = Description(
        path=path,
        version=str(model.fmiVersion),
        kinds=tuple(name for name, kind in kinds.items() if kind is not None),
        platforms=tuple(sorted(one.name for one in binaries.iterdir() if one.is_dir())) if binaries.is_dir() else (),
        states=int(model.numberOfContinuousStates or 0),
        indicators=int(model.numberOfEventIndicators or 0),
        runs_here=binary is not None and binary.is_file(),
        missing=missing_libraries(binary) if binary is not None else None,
        without_unit=tuple(v.name for v in [*inputs, *outputs] if v.type in _FLOATS and not _states_unit(v)),
        inputs=len(inputs),
        outputs=len(outputs),
        parameters=len(candidates),
        toml=_draft(_seen_from(path, place), model, inputs, outputs, chosen, every=parameters is not None),
    )
    if place is not None:
        try:
            write_atomically(place, found.toml.encode())
        except OSError as error:
            raise FmuError(f"{place}: cannot be written: {error.strerror or error}") from None
    return found


def _seen_from(path: Path, place: Path | None) -> str:
    if place is None:
        return path.name
    return Path(os.path.relpath(path.resolve(), place.parent.resolve())).as_posix()


def _is_candidate(variable: ScalarVariable) -> bool:
    """Whether a parameter is a positive number that can be set before a simulation."""
    if variable.causality != "parameter" or variable.type not in _FLOATS or variable.variability == "constant":
        return False
    if variable.name.startswith("_"):  # settings of the exporter's own solver
        return False
    start = _number(variable)
    return start is not None and 0 < start < math.inf


def _chosen(fmu: Path, candidates: Sequence[ScalarVariable], names: Sequence[str]) -> list[ScalarVariable]:
    """Candidates of these names, in this order."""
    known = {v.name: v for v in candidates}
    for name in names:
        if name not in known:
            raise FmuError(
                f"{fmu}: {name!r} is not one of its {len(known)} positive parameters that can be set"
                f"{meant(name, known) or f'; they are listed by: datagen describe {fmu}'}"
            )
    return [known[name] for name in dict.fromkeys(names)]


def _number(variable: ScalarVariable) -> float | None:
    try:
        return float(variable.start)
    except (TypeError, ValueError):
        return None


def _states_unit(variable: ScalarVariable) -> bool:
    return bool(variable.unit or getattr(variable.declaredType, "unit", None))


def _like(unit: str, other: str) -> bool:
    """Whether two units are known and of one kind."""
    try:
        return parsed(unit).dimensionality == parsed(other).dimensionality
    except ValueError:
        return False


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", " ", escaped) + '"'


def _table(kind: str, rows: Sequence[tuple[str, Any]], *, comment: str = "", off: bool = False) -> str:
    lines = [f"# {comment}"] if comment else []
    lines += [f"[[{kind}]]", *(f"{key} = {value}" for key, value in rows)]
    return "\n".join(f"# {line}" if off and not line.startswith("#") else line for line in lines) + "\n"


def _unit(variable: ScalarVariable) -> str:
    """The unit that an FMU states, or that the description of a variable without one has in brackets."""
    bracketed = re.search(r"\[([^\[\]]+)\]", variable.description or "")
    if _states_unit(variable) or bracketed is None:
        return unit_of(variable)
    told = bracketed[1].strip()
    return told if told not in UNITLESS and _like(told, told) else "1"


def _head(variable: ScalarVariable) -> list[tuple[str, str]]:
    unit, stated = _unit(variable), unit_of(variable)
    told = [] if unit == stated else [("fmu_unit", _quoted(unit))]
    return [("name", _quoted(variable.name)), ("unit", _quoted(unit)), *told]


def _draft(
    fmu: str,
    model: ModelDescription,
    inputs: Sequence[ScalarVariable],
    outputs: Sequence[ScalarVariable],
    parameters: Sequence[ScalarVariable],
    *,
    every: bool,
) -> str:
    """The description as TOML; with ``every`` no parameter is commented out, however many there are."""
    floats = [v for v in inputs if v.type in _FLOATS and not v.shape and v.name not in RESERVED]
    others = [v for v in inputs if v not in floats]
    guesses = [(v, *_source(v)) for v in floats]
    sources = {source for _, source, _, _ in guesses}
    recorded = [v for v in outputs if v.name not in RESERVED and "/" not in v.name]
    candidates = [v for v in parameters if v.name not in RESERVED and "/" not in v.name]
    parts = [_heading(fmu, model), _experiment(model)]
    if recorded:
        channels = ", ".join(_quoted(v.name) for v in recorded[:2])
        parts.append(f"# what an estimator reads\n[estimator]\nchannels = [{channels}]\ncontext_hours = 24.0\n")
    fixed = "\n".join(f"{_quoted(v.name)} = {start_of(v)}" for v in others if not v.shape and v.type not in UNSET)
    parts.append(
        f"# values of the FMU that stay as they are; inputs that are no numbers stand here\n[fixed]\n{fixed}\n"
    )
    parts.append("# what is estimated: choose a few, and give each a range that fits the building")
    many = len(candidates) > MOST_CANDIDATES and not every
    if many:
        parts.append(f"# ({len(candidates)} candidates: all but the first are commented out)")
    if not candidates:
        parts.append("# (no positive number of this FMU can be set: at least one [[parameters]] table is needed)")
    for k, v in enumerate(candidates):
        rows = [*_head(v), *_range(v)]
        if v.description:
            rows.insert(1, ("description", _quoted(v.description)))
        parts.append(_table("parameters", rows, comment=f"the FMU has {v.start}", off=many and k > 0))
    parts.append("# what drives the FMU")
    for v, source, rows, why in guesses:
        parts.append(_table("inputs", [*_head(v), ("source", f'"{source}"'), *rows], comment=why))
    parts.append("# what is recorded")
    for v in recorded:
        size = abs(float(v.nominal)) if v.nominal else 1.0
        rows = [*_head(v), ("accuracy", repr(ACCURACY * size))]
        if v.description:
            rows.insert(2, ("long_name", _quoted(v.description)))
        parts.append(_table("outputs", rows))
    if "weather" in sources:
        parts.append(
            "# a year that pvlib ships (Greensboro); put your own file here. The plane is a south facade\n"
            '[weather]\nfiles = ["pvlib:723170TYA.CSV"]\nsurface_tilt = 90.0\nsurface_azimuth = 180.0\nalbedo = 0.2\n'
        )
    if "occupancy" in sources:
        parts.append(
            "# persons at random: how many, when they come [h], how long they stay [h]\n[occupancy]\n"
            "headcount = [1, 10]\narrival = [7.0, 9.5]\nduration = [7.0, 10.0]\njitter = 0.5\nattendance = [0.4, 1.0]\n"
            "gaps = [1, 3]\ngap_duration = [0.4, 1.5]\ngap_share = [0.3, 1.0]\nabsence = 0.05\nweekend = 0.15\n"
        )
    if "schedule" in sources:
        parts.append("# values from an hour of the day on; all days, unless `weekend` has its own")
        parts += [_schedule(v) for v, source, _, _ in guesses if source == "schedule"]
    return "\n".join(parts)


def _range(variable: ScalarVariable) -> list[tuple[str, str]]:
    """A range about the start value: a third to three times of it, or 10 K to either side of a temperature."""
    start, unit = _number(variable) or 1.0, _unit(variable)
    if _like(unit, "K") and unit != "1" and not is_difference(variable) and start > WARM:
        return [("min", repr(start - WARM)), ("max", repr(start + WARM))]
    share = unit == "1" and start < 1.0  # an emissivity, an efficiency: at most all of it
    most = min(start * SPAN, 1.0) if share else start * SPAN
    return [("min", f"{start / SPAN:.4g}"), ("max", f"{most:.4g}"), ("scale", '"log"')]


def _heading(fmu: str, model: ModelDescription) -> str:
    name = re.sub(r"[^\w.-]+", "_", str(model.modelName or "system")).strip("_.-") or "system"
    return (
        "# Drafted from the FMU's own description: what is guessed says so. Check units, sources and ranges.\n"
        f"schema_version = 1\nname = {_quoted(name)}\ndescription = {_quoted(str(model.description or ''))}\n"
        f"fmu = {_quoted(fmu)}\n"
    )


def _experiment(model: ModelDescription) -> str:
    """Step, length and beginning by the FMU's default experiment, as far as it states them."""
    default = model.defaultExperiment
    start = float(default.startTime or 0.0) if default is not None else 0.0
    stop = float(default.stopTime or 0.0) if default is not None else 0.0
    own = float(default.stepSize or 0.0) if default is not None else 0.0
    step = own if 60.0 <= own <= 3600.0 else 3600.0
    length = stop - start if stop - start >= 86400.0 else 7 * 86400.0
    hours = max(math.floor(length / step) * step / 3600.0, step / 3600.0)
    tolerance = float(default.tolerance or 1e-6) if default is not None else 1e-6
    begins = f"start = [{start / 3600.0!r}, {start / 3600.0!r}]\n" if start > 0 else ""
    return (
        "# output step [s], length [h], how long before the record the simulation begins [h]\n[experiment]\n"
        f"step = {step!r}\nhours = {hours!r}\n{begins}warm_up_hours = 0.0\ntolerance = {min(tolerance, 1e-2)!r}\n"
    )


def _source(variable: ScalarVariable) -> tuple[str, list[tuple[str, str]], str]:
    """Where an input may come from, with the fields that say it, and why."""
    name, unit, start = variable.name, _unit(variable), _number(variable) or 0.0
    low = name.lower()
    held = [("interpolation", '"previous"')] if variable.variability == "discrete" else []
    if re.search(_SET_POINT, low) and _like(unit, "K"):
        return "schedule", [("schedule", _quoted(name))], "guessed by name and unit: a set point"
    for column, kind, words in _WEATHER:
        if unit != "1" and _like(unit, kind) and re.search(words, low):
            return "weather", [("column", f'"{column}"'), *held], "guessed by name and unit: weather"
    if unit == "1" and re.search(_PERSONS, name, re.IGNORECASE):
        return "occupancy", [], "guessed by name: persons"
    return "constant", [("value", repr(start)), *held], "stays at the FMU's start value; change what drives it"


def _schedule(variable: ScalarVariable) -> str:
    """A set point by day and night: the FMU's start value where that is one of a room, else 21 and 17 degC."""
    unit, start = _unit(variable), _number(variable)
    to = conversion("degC", unit)
    assert to is not None
    rooms = start is not None and 10.0 <= float(to.from_fmu(start)) <= 35.0
    day = float(start) if rooms and start is not None else float(to.to_fmu(21.0))
    night = day if rooms else float(to.to_fmu(17.0))
    rows = f"[[0.0, {night!r}], [6.0, {day!r}], [22.0, {night!r}]]"
    return f"[schedules.{_quoted(variable.name)}]\nweekday = {rows}\n"
