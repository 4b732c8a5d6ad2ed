"""The system description: one TOML file that tells every package about one system.

It names the FMU, the estimated parameters, the inputs and where each comes from, the outputs and their
sensors, and the numbers of the random occupancy. Nothing in the packages' code knows a variable's name.
Whether the FMU has the variables is checked where FMUs are read (``datagen.fmi.checking``).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal
from zipfile import is_zipfile

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, ValidationError, model_serializer, model_validator

from shared.errors import SystemDescriptionError
from shared.given import Given, Ratio
from shared.possible import driven_in_another_unit
from shared.reading import MOST_TOML, parse_json, parse_toml, read_text, shown
from shared.refused import meant, sentence_of
from shared.shipped import resolved, shipped_systems
from shared.signals import Excitation, Occupancy, Schedule, Table, Weather
from shared.variables import (
    Effect,
    ExcitationInput,
    Input,
    MeasuredInput,
    Noise,
    OccupancyInput,
    Output,
    Parameter,
    ScheduleInput,
    Source,
    Uncertain,
    WeatherInput,
    names_fault,
    table_fault,
)

WHOLE = 1e-6
"""By so many steps a length may differ from a whole number of them."""
MOST_STEPS = 1e8  # of a record: three years of seconds; a series of more is a GiB


class Experiment(Table):
    """How long and how finely a system is simulated."""

    step: float = Field(3600.0, gt=0, description="output step [s]")
    hours: float = Field(8760.0, gt=0, description="length of the record [h]")
    start: tuple[float, float] = Field(
        (0.0, 0.0), description="a record begins at a midnight between these hours, at the first if there is none [h]"
    )
    warm_up_hours: float = Field(0.0, ge=0, description="simulated before the record begins and dropped [h]")
    tolerance: float = Field(1e-6, gt=0, le=1e-2, description="relative tolerance of the integrator")


class Estimator(Table):
    """What the default estimator reads."""

    channels: list[str] = Field(description="names of outputs and inputs, unless a command names others")
    context_hours: float = Field(168.0, gt=0, description="length of the recording that it reads [h]")


class Preset(Table):
    """A named dataset: how many systems, and what of the experiment differs from the description's."""

    systems: int = Field(ge=1, description="how many")
    hours: float | None = Field(None, gt=0, description="length of the record [h]")
    step: float | None = Field(None, gt=0, description="output step [s]")
    start: tuple[float, float] | None = Field(None, description="as that of the experiment [h]")
    description: str = Field("", description="what it is for")


class System(Table):
    """A system description. Load one with :func:`load_system`."""

    schema_version: Literal[1] = Field(description="of this format")
    name: str = Field(description="in datasets and reports")
    description: str = Field("", description="what it is, for reports")
    fmu: str = Field(description="the FMU's file, as seen from this one's folder")
    wider: str = Field(
        "",
        description="name or path of a system description with wider ranges of the same parameters: commands name it"
        " where a recording does not fit into the ranges of this one",
    )
    kind: Literal["ModelExchange", "CoSimulation"] | None = Field(
        None, description="of an FMU that is both, which one is simulated; Model Exchange if not given"
    )
    experiment: Experiment = Experiment()
    estimator: Estimator
    fixed: dict[str, float | bool] = Field(
        {}, description="FMU variables by name, and the value that each keeps [the FMU's unit]; Boolean inputs, too"
    )
    replay: dict[str, float | bool] = Field(
        {}, description="FMU parameters that make recorded actuators replace the control loops [the FMU's unit]"
    )
    parameters: list[Parameter] = Field(min_length=1)
    inputs: list[Input] = []
    outputs: list[Output] = Field(min_length=1)
    effects: list[Effect] = []
    sources: list[Source] = []
    uncertain: list[Uncertain] = []
    given: list[Given] = []
    ratios: list[Ratio] = []
    weather: Weather | None = None
    occupancy: Occupancy | None = None
    schedules: dict[str, Schedule] = {}
    excitations: dict[str, Excitation] = {}
    presets: dict[str, Preset] = {}
    path: Path = Path()

    @model_serializer(mode="wrap")
    def _without_nothing(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What is empty is left out: descriptions keep the hash that they had before such a field was there."""
        made: dict[str, Any] = handler(self)
        for name in ("kind", "wider", "given", "ratios"):
            if not getattr(self, name):
                made.pop(name, None)
        return made

    @model_validator(mode="after")
    def _consistent(self) -> System:
        if wrong := [*dict.fromkeys(self._faults())]:
            raise ValueError("; ".join(wrong))
        return self

    def _faults(self) -> Iterator[str]:
        """What tables say of each other that cannot be, a sentence each."""
        yield from self._name_faults()
        yield from self._input_faults()
        yield from self._effect_faults()
        for where, name in self._reads():
            if name not in self.parameter_names:
                yield f"{where}: {name!r} is not an estimated parameter"
        if self.weather is None and any(one.weather for one in self.given):
            yield "given: a fact sets the weather, but there is no [weather] table"
        signals = [*self.output_names, *self.input_names]
        for channel in self.estimator.channels:
            if channel not in signals:
                near = meant(channel, signals)
                yield f"estimator.channels: {channel!r} is neither an output nor an input{near}"
        yield from self._time_faults()

    def _name_faults(self) -> Iterator[str]:
        for kind in ("parameters", "inputs", "outputs", "uncertain", "given"):
            if wrong := names_fault(kind, [item.name for item in getattr(self, kind)]):
                yield wrong
        for name in sorted({*self.parameter_names, *self.input_names}):
            if (name in self.output_names) + (name in self.input_names) + (name in self.parameter_names) > 1:
                yield f"{name!r} is the name of two things; expected one"
        for parameter in self.parameters:
            for table in ("fixed", "replay"):
                if parameter.name in getattr(self, table):
                    yield f"{table}: {parameter.name!r} is also an estimated parameter"

    def _input_faults(self) -> Iterator[str]:
        for one in self.inputs:
            if isinstance(one, ScheduleInput) and one.schedule not in self.schedules:
                yield f"inputs: {one.name!r} names schedule {one.schedule!r}, which is not declared"
            if isinstance(one, ExcitationInput) and one.excitation not in self.excitations:
                yield f"inputs: {one.name!r} names excitation {one.excitation!r}, which is not declared"
            if isinstance(one, WeatherInput) and self.weather is None:
                yield f"inputs: {one.name!r} comes from the weather, but there is no [weather] table"
            if isinstance(one, OccupancyInput) and self.occupancy is None:
                yield f"inputs: {one.name!r} comes from the occupancy, but there is no [occupancy] table"
            if isinstance(one, MeasuredInput) and (wrong := one.fault(self.outputs)):
                yield f"inputs: {wrong}"

    def _effect_faults(self) -> Iterator[str]:
        """Of sources, uncertain constants and given facts: names that are taken, and FMU parameters set twice."""
        for k, source in enumerate(self.sources):
            before = [earlier.name for earlier in self.sources[:k]]
            if wrong := source.fault(self.input_names, self.parameter_names, before):
                yield wrong
        names = {*self.parameter_names, *self.output_names, *self.input_names, *(one.name for one in self.effects)}
        by_others = [(getattr(one, "parameters", {}), getattr(one, "constants", {})) for one in self.effects]
        by_others += [(one.parameters, {}) for one in self.sources] + [(self.replay, {})]
        taken = {name for tables in by_others for table in tables for name in table}
        if wrong := table_fault("uncertain", self.uncertain, names, self.parameter_names, taken):
            yield wrong
        names |= {one.name for one in self.uncertain}
        taken = taken - {*self.replay} | {name for one in self.uncertain for name in one.parameters} | {*self.fixed}
        if wrong := table_fault("given", self.given, names, self.parameter_names, taken):
            yield wrong

    def _time_faults(self) -> Iterator[str]:
        spans = {"experiment": self.experiment.start}
        spans |= {f"presets.{name}": one.start for name, one in self.presets.items() if one.start is not None}
        for where, span in spans.items():
            if not 0 <= span[0] <= span[1]:
                yield f"{where}: start is {span[0]:g} to {span[1]:g} h; expected 0 <= first <= last"
        steps = self.experiment.hours * 3600 / self.experiment.step  # hours of whole steps are rounded: 385 / 12
        if not steps <= MOST_STEPS:
            yield f"experiment: hours over step are {steps:.3g} steps; expected at most {MOST_STEPS:.0e}"
        elif round(steps) < 1 or abs(steps - round(steps)) > WHOLE:
            yield f"experiment: step {self.experiment.step:g} s does not divide {self.experiment.hours:g} h"

    def _reads(self) -> list[tuple[str, str]]:
        """Where other tables name estimated parameters, and which."""
        found = [("ratios", name) for one in self.ratios for name in (one.over, one.under)]
        found += [(f"given {one.name!r}: per", one.per) for one in self.given if one.per]
        return found + ([("occupancy.per", self.occupancy.per)] if self.occupancy and self.occupancy.per else [])

    @property
    def told(self) -> list[Given]:
        """The given facts that an estimator may be told."""
        return [one for one in self.given if not one.hidden]

    @property
    def parameter_names(self) -> list[str]:
        """Names of the estimated parameters, in the order of every parameter vector."""
        return [p.name for p in self.parameters]

    @property
    def input_names(self) -> list[str]:
        """Names of the FMU inputs."""
        return [i.name for i in self.inputs]

    @property
    def output_names(self) -> list[str]:
        """Names of the recorded outputs."""
        return [o.name for o in self.outputs]

    @property
    def fmu_path(self) -> Path:
        """Where the FMU is: relative to the TOML's folder."""
        return (self.path.parent / self.fmu).resolve()

    @property
    def noise_presets(self) -> list[str]:
        """Names of the sensor presets; ``none`` is always there."""
        return ["none", *sorted({name for output in self.outputs for name in output.noise} - {"none"})]

    def canonical(self) -> str:
        """The description as canonical JSON, without where it lies."""
        return json.dumps(self.model_dump(mode="json", exclude={"path"}), sort_keys=True, separators=(",", ":"))

    def with_experiment(
        self,
        *,
        hours: float | None = None,
        step: float | None = None,
        start: tuple[float, float] | None = None,
    ) -> System:
        """The same system with another length [h], output step [s] or span of beginnings [h].

        Raises SystemDescriptionError if the step does not divide the length.
        """
        given = {"hours": hours, "step": step, "start": start}
        changes = {name: value for name, value in given.items() if value is not None}
        if not changes:
            return self
        raw = json.loads(self.canonical())
        raw["experiment"].update(changes)
        asked = ", ".join(f"{name} {value}" for name, value in changes.items())
        return _validate({**raw, "path": self.path}, self.path, f" with {asked}")

    def with_known(self, values: Mapping[str, float | bool]) -> System:
        """The same system of which some FMU parameters are known [unit of each]: none of them is uncertain.

        The other parameters of an uncertain constant remain so; a constant that has no other is left out.
        """
        rest = {one.name: [name for name in one.parameters if name not in values] for one in self.uncertain}
        uncertain = [one.model_copy(update={"parameters": rest[one.name]}) for one in self.uncertain if rest[one.name]]
        given = [one for one in self.given if not {*one.parameters} & {*values}]
        return self.model_copy(update={"fixed": {**self.fixed, **values}, "uncertain": uncertain, "given": given})

    def preset(self, name: str) -> Preset:
        """A preset by its name.

        Raises SystemDescriptionError if there is none of that name.
        """
        if name not in self.presets:
            found = ", ".join(self.presets) or "none"
            raise SystemDescriptionError(f"{self.path}: no preset {name!r}; found {found}")
        return self.presets[name]

    def hash(self) -> str:
        """sha256 of what is simulated: equal for equal systems, however long and for whom they are simulated.

        ``experiment``, ``presets`` and ``estimator`` are defaults of commands, ``effects`` and ``sources`` are what
        diagnosis tries, ``wider`` is advice, and ``uncertain`` is what is not trusted: none of them changes a system
        that is simulated as described, and they are left out. So systems whose constants were drawn count as the same
        to an estimator that must not have seen them: that errs on the safe side, and datasets of both kinds differ in
        their settings.
        """
        without = {"path", "experiment", "presets", "estimator", "sources", "uncertain", "wider"}
        content = self.model_dump(mode="json", exclude=without) | {"effects": []}
        return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

    def noise_sd(self, preset: str) -> np.ndarray:
        """Standard deviation of each output's error under a noise preset [unit of each output], shape (outputs,).

        The numerical floor and the quantisation (quantum / sqrt(12)) are part of it.
        """
        if preset not in self.noise_presets:
            raise SystemDescriptionError(
                f"{self.path}: noise {preset!r} is not a preset of {self.name}; found {', '.join(self.noise_presets)}"
            )
        sensors = [output.noise.get(preset, Noise()) for output in self.outputs]
        return np.array(
            [np.sqrt(o.accuracy**2 + n.sd**2 + n.quantum**2 / 12) for o, n in zip(self.outputs, sensors, strict=True)]
        )


def parse_system(text: str, path: Path) -> System:
    """Parse a system description from TOML text; ``path`` is where relative paths start and errors point.

    Raises SystemDescriptionError with one sentence that names the field, what was found and what was expected.
    """
    system = _validate({**parse_toml(text, f"{path}", SystemDescriptionError), "path": path}, path)
    if wrong := driven_in_another_unit(system.inputs, system.schedules):
        raise SystemDescriptionError(f"{path}: {wrong}")
    return system


def system_from_canonical(text: str, path: Path) -> System:
    """Rebuild a system from :meth:`System.canonical`, as manifests hold it."""
    raw = parse_json(text, f"{path}", SystemDescriptionError, "a system description")
    if not isinstance(raw, dict):
        raise SystemDescriptionError(f"{path}: is {shown(raw)}; expected a system description")
    return _validate({**raw, "path": path}, path)


def _validate(raw: dict[str, object], path: Path, changed: str = "") -> System:
    """Of a table of the file at ``path``; ``changed`` says what was asked for in place of what stands there."""
    _name_unnamed(raw, path)
    try:
        return System.model_validate(raw)
    except ValidationError as error:
        raise SystemDescriptionError(f"{path}{changed}: {sentence_of(error, System)}") from None


def _name_unnamed(raw: dict[str, object], path: Path) -> None:
    """A missing unit is the commonest slip: say whose it is, by name rather than by position."""
    for table in ("parameters", "inputs", "outputs"):
        items = raw.get(table, [])
        for item in items if isinstance(items, list) else []:
            if isinstance(item, dict) and "name" in item and not item.get("unit") and not meant("unit", item):
                raise SystemDescriptionError(
                    f'{path}: {table} {shown(item["name"])} has no unit; expected for example "K", or "1" for a number'
                )


def load_system(path: Path | str) -> System:
    """Read a system description: a TOML file, a folder that holds ``system.toml``, or the name of a shipped system.

    Raises
    ------
    SystemDescriptionError
        If the file is missing, not TOML, or does not describe a system.
    """
    named, path = Path(path), resolved(path)
    if path.is_dir():
        path = path / "system.toml"
    shipped = ", ".join(shipped_systems())
    expected = f"a system description (TOML), or the name of one that comes with the package ({shipped})"
    expected += meant(named.name, shipped_systems()) if len(named.parts) == 1 else ""
    if path.is_file() and is_zipfile(path):
        raise SystemDescriptionError(
            f"{path}: is an FMU or another archive; expected a system description (TOML) that names it as its fmu:"
            f" draft one with `datagen describe {path} --out system.toml`"
        )
    return parse_system(read_text(path, SystemDescriptionError, expected, most=MOST_TOML), path)
