"""What the truth of a blind check is made of: a TOML beside a truth FMU, read into forms.

A form is a way in which the truth differs from the model: parameters of the truth's FMU, true inputs that are not the
recorded ones, sensors that err. Each has one amplitude. A form that belongs to a candidate effect acts by another law
than the candidate; one that belongs to none is what no candidate can explain.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from shared.effects import Mode
from shared.errors import SystemDescriptionError
from shared.reading import read_toml, validated
from shared.signals import Span, Table
from shared.system import System, system_from_canonical


class Wander(Table):
    """A slow random walk about a mean: an AR(1) series on hours, cut off at ``low`` and ``high``."""

    kind: Literal["wander"]
    mean: float = 1.0
    sd: float = Field(ge=0)
    hours: float = Field(gt=0, description="correlation time [h]")
    low: float = -1e9
    high: float = 1e9
    key: str = Field("", description="wanders of one key, of inputs and of faults, take the same path")


class Daily(Table):
    """``mean`` + ``swing`` * cosine of the day with its maximum at hour ``peak``, and an AR(1) part."""

    kind: Literal["daily"]
    mean: float = 0.0
    swing: float = 1.0
    peak: float = Field(description="[h]")
    sd: float = Field(0.0, ge=0)
    hours: float = Field(24.0, gt=0, description="correlation time of the random part [h]")


class Hump(Table):
    """A bell over the hours of the day about ``peak``: a shadow that passes."""

    kind: Literal["hump"]
    peak: float = Field(description="[h]")
    width: float = Field(gt=0, description="[h]")


class Damped(Table):
    """A series over its reference (1 without one), divided by 1 + another over its reference."""

    kind: Literal["damped"]
    series: str = ""
    reference: float = 1.0
    by: str
    by_reference: float = Field(gt=0)


class Spans(Table):
    """Spans of hours on most days: each with its own probability, beginning, end and level, drawn day by day."""

    kind: Literal["spans"]
    hours: list[Span] = Field(min_length=1, description="(from, to) [h]; from > to runs past midnight")
    days: Literal["all", "weekday"] = "all"
    probability: float = Field(1.0, ge=0, le=1)
    jitter: float = Field(0.0, ge=0, description="standard deviation of beginning and end [h]")
    level: Span = (1.0, 1.0)


class Episodes(Table):
    """Episodes that begin at random while somebody is there, each with its own length and level."""

    kind: Literal["episodes"]
    presence: str
    rate: float = Field(gt=0, description="how many begin in an hour of presence [1/h]")
    hours: Span = Field(description="length [h]")
    level: Span = (1.0, 1.0)


class Glare(Table):
    """Blinds of an occupant: closed when a series passes a limit that varies, opened again in the morning or never."""

    kind: Literal["glare"]
    series: str
    presence: str
    limit: Span = Field(description="drawn anew for each step [unit of the series]")
    patience: float = Field(ge=0, le=1, description="probability that nobody opens them on a morning")


class Occupant(Table):
    """A window that an occupant opens and closes, hour by hour, feeling the room's temperature.

    The odds of opening, log(p / (1 - p)) = ``offset`` + ``indoors`` * T + ``outdoors`` * T_out in degC, have the form
    that field studies use (Rijal et al. 2007; Haldi and Robinson 2009); it is closed when the room is colder than
    ``cold``, and mostly when the last one leaves.
    """

    kind: Literal["occupant"]
    room: str = Field(description="output: room temperature [K]")
    outdoor: str = Field(description="input: outdoor temperature [K]")
    presence: str
    offset: float
    indoors: float
    outdoors: float
    cold: float = Field(description="[K]")
    forgets: float = Field(ge=0, le=1, description="probability that it stays open when the last one leaves")


Process = Annotated[Wander | Daily | Hump | Damped | Spans | Episodes | Glare | Occupant, Field(discriminator="kind")]


class Driven(Table):
    """A true input: the process itself (``set``), or what is recorded changed by amplitude * ``amount`` * process.

    ``add``, ``gain`` (x * (1 + ..)) or ``shift`` (later by .. [s]).
    """

    input: str
    use: Literal["set", "add", "gain", "shift"] = "set"
    amount: float = 1.0
    process: Process


class Fault(Table):
    """A sensor that errs by amplitude * ``amount``, at the truth's own fine steps.

    ``wander``: a bias that wanders; ``walk``: a saturating trend with a random walk; ``curve``: an error that grows
    with the square of the distance to ``about`` (equal at ``span``); ``slow``: two lags in a row; ``clock``: a clock
    that runs away, on average by the amplitude [s]; ``state``: a share of a state of the FMU; ``series``: a weather
    column or input over its ``reference``, less ``origin``.
    """

    outputs: list[str] = Field(min_length=1)
    kind: Literal["wander", "walk", "curve", "slow", "clock", "state", "series"]
    amount: float = 1.0
    about: float = 0.0
    span: float = Field(1.0, gt=0)
    series: str = ""
    origin: float = 0.0
    reference: float = 1.0
    sd: float = Field(0.3, ge=0)
    hours: float = Field(96.0, gt=0)
    key: str = Field("", description="see that of a wander")


class Form(Table):
    """One way in which the truth differs; see the module. ``effect``: the candidate whose cause it shares, if any."""

    name: str
    description: str
    effect: str = ""
    unit: str
    scale: float = Field(gt=0, description="a size that matters [unit]")
    limit: float = Field(gt=0, description="greatest amplitude [unit]")
    signed: bool = False
    modes: list[Mode] = ["control", "replay"]
    parameters: dict[str, float] = {}
    constants: dict[str, float] = {}
    inputs: list[Driven] = []
    faults: list[Fault] = []

    @model_validator(mode="after")
    def _acts(self) -> Form:
        if not (self.parameters or self.inputs or self.faults):
            raise ValueError(f"{self.name!r} does nothing; expected parameters, inputs or faults")
        lengths: dict[str, float] = {}
        wanders: list[Wander | Fault] = [*self.faults]
        wanders += [one.process for one in self.inputs if isinstance(one.process, Wander)]
        for one in wanders:
            if one.key and lengths.setdefault(one.key, one.hours) != one.hours:
                raise ValueError(
                    f"{self.name!r}: wanders of key {one.key!r} have hours of {lengths[one.key]:g} and {one.hours:g};"
                    " expected one length for one path"
                )
        if sum(isinstance(one.process, Occupant) for one in self.inputs) > 1:
            raise ValueError(f"{self.name!r} has two occupants; expected one at most")
        return self


class Strata(Table):
    """How many recordings of each block have no effect, a candidate's, its other form, two, or one of no candidate."""

    none: int = Field(ge=0)
    library: int = Field(ge=0)
    form: int = Field(ge=0)
    two: int = Field(ge=0)
    outside: int = Field(ge=0)

    @property
    def order(self) -> list[str]:
        """The strata of a block, each as often as it occurs."""
        return [name for name, count in self.model_dump().items() for _ in range(count)]


class Measuring(Table):
    """How a campaign measures: conditions that vary, and errors beyond the system's own sensor noise.

    ``constants``: no building is as described, so the system's uncertain constants are multiplied by factors that are
    drawn for each recording: in the model those of its FMU, in the room those of the truth's, which has them by the
    same names with start values of its own; or else all are as the FMUs have them.

    ``slow`` is the share of a sensor's variance that is correlated over ``hours`` (drawn within); ``inputs`` the
    standard deviations of errors of recorded inputs [unit of each]; ``controllers`` by what factors the true
    controllers' parameters differ where the actuators are replayed, so that nobody needs to know the control.
    """

    noise: str
    slow: float = Field(ge=0, lt=1)
    hours: Span
    inputs: dict[str, float] = {}
    unknown_occupancy: float = Field(ge=0, le=1)
    replay: float = Field(ge=0, le=1)
    constants: bool = True
    controllers: dict[str, tuple[float, float, float]] = Field({}, description="(value, least, greatest factor)")


class Constant(Table):
    """An input that only the truth has, and its value where no form drives it."""

    name: str
    unit: str
    value: float


class Truth(Table):
    """The TOML; see the module. ``amplitudes`` is the range of amplitude over scale: log-uniform, cut off at limits."""

    system: str
    fmu: str
    step: float = Field(gt=0, description="of the truth's own record, a part of the recordings' [s]")
    tolerance: float = Field(gt=0)
    amplitudes: Span
    strata: Strata
    measuring: Measuring
    inputs: list[Constant] = []
    forms: list[Form] = []
    path: Path = Path()

    @property
    def outside(self) -> list[Form]:
        """The forms that no candidate has."""
        return [form for form in self.forms if not form.effect]

    def described(self, system: System) -> System:
        """The truth as a system: its FMU, and the system's inputs with its own."""
        raw = json.loads(system.canonical())
        raw["fmu"] = str((self.path.parent / self.fmu).resolve())
        raw["inputs"] += [{**one.model_dump(), "source": "constant"} for one in self.inputs]
        raw["effects"] = []
        if not self.measuring.constants:
            raw["uncertain"] = []  # an FMU whose constants nobody draws may lack them
        raw["experiment"]["step"] = self.step
        return system_from_canonical(json.dumps(raw), system.path)


def default_truth(system: System) -> Path:
    """Where a system's truth is, if it is not said: ``truth/truth.toml`` beside the system's folder."""
    return (system.path.parent.parent / "truth" / "truth.toml").resolve()


def load_truth(path: Path | str, system: System) -> Truth:
    """Read a truth and hold it against the system.

    Raises
    ------
    SystemDescriptionError
        If the file is missing, not a truth, of another system, or names what the system does not have.
    """
    path = Path(path)
    raw = read_toml(path, SystemDescriptionError, "the truth of a blind check (TOML)")
    truth = validated(Truth, {**raw, "path": path}, f"{path}", SystemDescriptionError)
    if truth.system != system.name:
        raise SystemDescriptionError(f"{path}: is the truth of {truth.system!r}; expected that of {system.name!r}")
    if not truth.forms:
        raise SystemDescriptionError(f"{path}: forms: there is none; expected [[forms]], what the truth does otherwise")
    names = {form.name for form in truth.forms}
    if len(names) != len(truth.forms):
        raise SystemDescriptionError(f"{path}: forms: a name is declared twice")
    inputs = {*system.input_names, *(one.name for one in truth.inputs)}
    for form in truth.forms:
        for name in {one.input for one in form.inputs} - inputs:
            raise SystemDescriptionError(f"{path}: forms {form.name!r}: {name!r} is not an input of the truth")
        for name in {name for fault in form.faults for name in fault.outputs} - set(system.output_names):
            raise SystemDescriptionError(f"{path}: forms {form.name!r}: {name!r} is not an output of the system")
        if form.effect and form.effect not in {one.name for one in system.effects}:
            raise SystemDescriptionError(f"{path}: forms {form.name!r}: {form.effect!r} is not an effect of the system")
    for name in {*truth.measuring.inputs} - set(system.input_names):
        raise SystemDescriptionError(f"{path}: measuring.inputs: {name!r} is not an input of the system")
    if truth.measuring.noise not in system.noise_presets:
        raise SystemDescriptionError(
            f"{path}: measuring.noise is {truth.measuring.noise!r}; expected one of {', '.join(system.noise_presets)}"
        )
    low, high = truth.amplitudes
    if not 0 < low <= high:
        raise SystemDescriptionError(f"{path}: amplitudes are {low:g} to {high:g}; expected 0 < first <= last")
    _check_strata(truth, system)
    _check_series(truth, system)
    return truth


def _check_strata(truth: Truth, system: System) -> None:
    """Refuse strata of which there is nothing to draw."""
    if not truth.strata.order:
        raise SystemDescriptionError(f"{truth.path}: strata are all 0; expected a recording of some")
    effects, forms = bool(system.effects), any(form.effect for form in truth.forms)
    for stratum, there, needed in (
        ("library", effects, "[[effects]] of the system"),
        ("form", forms, "forms with an effect"),
        ("two", effects, "[[effects]] of the system"),
        ("outside", bool(truth.outside), "forms without an effect"),
    ):
        if getattr(truth.strata, stratum) and not there:
            raise SystemDescriptionError(f"{truth.path}: strata.{stratum} is above 0; expected {needed}")


def _check_series(truth: Truth, system: System) -> None:
    """Refuse processes that follow what the truth does not have."""
    inputs = {*system.input_names, *(one.name for one in truth.inputs)}
    for form in truth.forms:
        for one in form.inputs:
            for field in ("series", "by", "presence", "outdoor", "room"):
                name = getattr(one.process, field, "")
                known = set(system.output_names) if field == "room" else inputs
                if name and name not in known:
                    raise SystemDescriptionError(
                        f"{truth.path}: forms {form.name!r}: {field} {name!r} is not an"
                        f" {'output of the system' if field == 'room' else 'input of the truth'}"
                    )
