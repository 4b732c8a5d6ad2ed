"""The variables that a system description declares: parameters, inputs and where they come from, outputs, effects."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from shared.effects import Effect as Effect
from shared.signals import Table

RESERVED = ("bnds", "disturbances", "split", "start", "system", "time", "time_bnds")
"""What a shard calls its own fields and dimensions: a variable of that name would take the place of one."""
ZERO_CELSIUS = 273.15
"""[K]"""


def names_fault(kind: str, names: Sequence[str]) -> str:
    """What is wrong with the names of a table such as ``outputs``, as a sentence; empty if nothing is."""
    for k, name in enumerate(names):
        if name in names[:k]:
            return f"{kind}: {name!r} is declared twice"
        if name not in RESERVED and "/" not in name:
            continue
        why = (
            "what datasets call a field of their own" if name in RESERVED else "no name for a variable of a NetCDF file"
        )
        another = {
            "outputs": 'another name, with the FMU\'s own as `variable = "..."`',
            "uncertain": "another name",
            "given": "another name",
        }.get(kind, "an FMU that calls it otherwise")
        return f"{kind}: {name!r} is {why}; expected {another}"
    return ""


def spaced(unit: str) -> str:
    """A unit as it stands after a number, with the space before it; nothing after a pure number, whose unit is 1."""
    return "" if unit == "1" else f" {unit}"


class FmuVariable(Table):
    """What a description says of one of the FMU's variables: its unit here, and there if the FMU states none."""

    unit: str = Field(description="of all numbers here, such as K, degC, W/m2; a pure number has 1")
    fmu_unit: str = Field("", description="unit that the FMU computes in, where the FMU states none")

    @model_serializer(mode="wrap")
    def _without_nothing(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A description that states no ``fmu_unit`` has the hash that it had before there was one."""
        made: dict[str, Any] = handler(self)
        if not self.fmu_unit:
            made.pop("fmu_unit", None)
        return made


class Parameter(FmuVariable):
    """An estimated parameter and its prior: uniform in ``scale`` between ``min`` and ``max``.

    Estimators are trained on the logarithm of a positive parameter (paper, section 2.4), and on one itself whose range
    reaches zero or goes below.
    """

    name: str = Field(description="of the FMU's variable")
    description: str = Field("", description="what it is, for reports")
    min: float = Field(description="least value [unit]; with max, it is the prior")
    max: float = Field(description="greatest value [unit]")
    scale: Literal["linear", "log"] = Field(
        "linear", description="what the prior is uniform in: the value, or its logarithm (min above 0)"
    )

    @model_validator(mode="after")
    def _range(self) -> Parameter:
        if not self.min < self.max:
            raise ValueError(f"range is reversed or empty: min {self.min:g}, max {self.max:g}; expected min < max")
        if self.scale == "log" and self.min <= 0:
            raise ValueError(
                f'min is {self.min:g} on a logarithmic scale; expected a positive one, or scale = "linear"'
            )
        return self

    def from_unit(self, u: np.ndarray | float) -> np.ndarray:
        """Map uniform numbers in [0, 1] to the parameter's prior [unit]."""
        u = np.asarray(u, dtype=float)
        if self.scale == "log":
            return self.min * (self.max / self.min) ** u
        return self.min + (self.max - self.min) * u

    def to_unit(self, value: np.ndarray | float) -> np.ndarray:
        """Place of values [unit] in the parameter's range as its scale has it, 0 at ``min`` and 1 at ``max``."""
        value = np.asarray(value, dtype=float)
        if self.scale == "log":
            return np.asarray(np.log(value / self.min) / np.log(self.max / self.min))
        return np.asarray((value - self.min) / (self.max - self.min))


class _Input(FmuVariable):
    name: str = Field(description="of the FMU's variable")
    interpolation: Literal["linear", "previous"] = Field(
        "linear", description="between two values: a straight line, or the earlier one until the next"
    )


class WeatherInput(_Input):
    """An input read from the weather table."""

    source: Literal["weather"]
    column: str = Field(description="a column of the weather, see below")


class OccupancyInput(_Input):
    """The number of persons present, the same in all inputs of this source; of several a diagnosis needs it counted."""

    source: Literal["occupancy"]
    interpolation: Literal["previous"] = Field("previous", description="persons come and go in steps")


class ScheduleInput(_Input):
    """An input that follows a schedule of the week."""

    source: Literal["schedule"]
    schedule: str = Field(description="name of one of [schedules]")
    interpolation: Literal["previous"] = Field("previous", description="a schedule changes in steps")


class ExcitationInput(_Input):
    """A sum of sinusoids added to a control action; zero when excitation is switched off."""

    source: Literal["excitation"]
    excitation: str = Field(description="name of one of [excitations]")


class ConstantInput(_Input):
    """An input that stays at one value [unit of the input].

    A temperature in degC or degF that is given for an input in K is refused; so would a difference of more than 10 K
    be: declare such an input as ``measured``, whose ``value`` may be any.
    """

    source: Literal["constant"]
    value: float = Field(description="[unit]")


class MeasuredInput(_Input):
    """An input that only a recording provides; ``value`` stands in where there is none.

    ``column`` may be an output, the meter that reads it.
    """

    source: Literal["measured"]
    column: str = Field(description="variable of the recording")
    value: float = Field(0.0, description="what stands in where there is no recording [unit]")

    def fault(self, outputs: Sequence[Output]) -> str:
        """What is wrong beside the output whose readings drive it as they are; nothing if all is well."""
        for one in outputs:
            if one.name != self.column:
                continue
            if one.unit != self.unit:
                return f"{self.name!r} is in {self.unit}, its column {self.column!r} in {one.unit}; expected one unit"
            held = self.interpolation == "previous"
            if held != (one.method == "mean"):
                is_, expected = self.interpolation, "previous" if one.method == "mean" else "linear"
                return (
                    f"{self.name!r} has interpolation {is_!r}; its column {self.column!r} is"
                    f" {'the mean over a step' if one.method == 'mean' else 'an instant'}: expected {expected!r}"
                )
        return ""


Input = Annotated[
    WeatherInput | OccupancyInput | ScheduleInput | ExcitationInput | ConstantInput | MeasuredInput,
    Field(discriminator="source"),
]


class Noise(Table):
    """A sensor: Gaussian noise, then quantisation, then dropouts."""

    sd: float = Field(0.0, ge=0, description="standard deviation [unit of the output]")
    quantum: float = Field(0.0, ge=0, description="resolution of the reading [unit of the output]; 0 is none")
    dropout: float = Field(0.0, ge=0, lt=1, description="share of readings lost")


class Output(FmuVariable):
    """A recorded output. ``method`` follows CF cell methods: an instant, or the mean since the last step."""

    name: str = Field(description="in datasets and recordings")
    variable: str = Field("", description="the FMU's variable, where that has another name")
    long_name: str = Field("", description="for axes and reports")
    standard_name: str = Field("", description="of the CF conventions, for the NetCDF files")
    method: Literal["point", "mean"] = Field(
        "point",
        description="an instant, as of a temperature; or the exact mean since the last step, as of a power that a meter"
        " adds up",
    )
    accuracy: float = Field(gt=0, description="what a noise-free value is good for [unit]: the numerical floor")
    noise: dict[str, Noise] = Field({}, description="sensors by the name of a preset; none is always there")

    @model_validator(mode="after")
    def _none(self) -> Output:
        if "none" in self.noise:
            raise ValueError("noise.none is set; expected another name: 'none' is no noise, for every output")
        return self

    @property
    def fmu_variable(self) -> str:
        """The FMU's variable behind this output."""
        return self.variable or self.name


class Source(Table):
    """A source that the model does not have: diagnosis puts pulses on an input of the FMU to see what it would do.

    One unit of ``input`` brings ``per`` of the source: a number [unit], or the name of an estimated parameter, whose
    fitted value counts. What it brings beside that are other sources, ``less``, which are taken off again.
    """

    name: str = Field(description="in reports")
    description: str = Field("", description="as a reader sees it, for example 'missing heat'")
    unit: str = Field(min_length=1, description="of what it brings, such as W or kg/s")
    input: str = Field(description="the FMU input that carries the pulses")
    parameters: dict[str, float] = Field({}, description="FMU parameters while it does [unit of each]")
    per: float | str = Field(1.0, description="what one unit of the input brings: a number, or an estimated parameter")
    less: dict[str, float] = Field({}, description="by name of a source declared before: its amount per unit of input")

    def fault(self, inputs: list[str], parameters: list[str], before: list[str]) -> str:
        """What is wrong with it in a system with these names, as a sentence; empty if nothing is."""
        if self.input not in inputs:
            return f"sources: {self.name!r} acts on {self.input!r}, which is not an input"
        if isinstance(self.per, str) and self.per not in parameters:
            return f"sources: {self.name!r} is measured per {self.per!r}, which is not an estimated parameter"
        if self.per == 0:
            return f"sources: {self.name!r} has per = 0; expected what one unit of {self.input!r} brings"
        if self.name in before:
            return f"sources: {self.name!r} is declared twice"
        for name in self.less:
            if name not in before:
                return f"sources: {self.name!r} is less {name!r}, which is no source that is declared before it"
        return ""


class Uncertain(Table):
    """FMU parameters that nobody wants to know and nobody knows exactly: the layers of a floor, say.

    All of them are multiplied by exp(``relative`` * N(0, 1)); their values are those of ``fixed``, or the FMU's own.
    Fits to measurements let them vary, and so do datasets that are to be like buildings (``datagen run --uncertain``).
    What ``fixed`` sets to 0 stays 0.
    """

    name: str = Field(description="in reports")
    description: str = Field("", description="what it is, for reports")
    parameters: list[str] = Field(min_length=1, description="names of FMU parameters, each positive")
    relative: float = Field(gt=0, le=1, description="standard deviation of the logarithm of their common factor")


def table_fault(
    table: str, declared: Iterable[Any], names: Collection[str], estimated: Collection[str], taken: Collection[str]
) -> str:
    """What is wrong with what a ``table`` sets in a system, as a sentence; empty if nothing is.

    Its entries, ``declared``, have a ``name`` and ``parameters`` each. ``names`` are of everything that has one of its
    own already, ``estimated`` those of the estimated parameters, and ``taken`` the FMU parameters that other tables
    set.
    """
    names, taken = {*names}, {*taken}
    for entry in declared:
        if entry.name in names:
            return f"{table}: {entry.name!r} is the name of two things; expected one"
        names.add(entry.name)
        for one in entry.parameters:
            if one in estimated:
                return f"{table}: {entry.name!r} holds {one!r}, which is an estimated parameter"
            if one in taken:
                return f"{table}: {entry.name!r} holds {one!r}, which is set elsewhere as well"
            taken.add(one)
    return ""
