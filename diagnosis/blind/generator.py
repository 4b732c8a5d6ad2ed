"""One recording of a blind check: the true room is lived in, measured, and set beside what the model would say.

Everything depends on (seed, index) alone, also which of its draws is the first that can be simulated: recordings can be
made in any order by any number of processes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import xarray as xr

from datagen.driving.inputs import build_inputs, system_weather
from datagen.driving.sampling import record_start, sample_parameters, stream
from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.simulator import Simulator
from diagnosis.blind.room import Lived, Window, autoregressive, coarse, drive, erring, live, signals_of, wandering
from diagnosis.blind.truth import Driven, Fault, Form, Occupant, Truth
from diagnosis.effects import Effect, clash, library
from diagnosis.recording import HOUR, Recording
from shared.errors import RecordingError, SimulationError, SystemDescriptionError
from shared.schema import EPOCH, methods_of
from shared.store import write_atomically
from shared.system import System
from shared.variables import Noise

Item = TypeVar("Item")
Acts = Effect | Form


@dataclass(frozen=True)
class Cause:
    """One effect in a recording: a candidate as it is, or a form of the truth, with its amplitude [unit]."""

    acts: Acts
    amplitude: float

    @property
    def label(self) -> str:
        """The candidate's name that is the right answer; empty if none is."""
        return self.acts.effect if isinstance(self.acts, Form) else self.acts.name

    @property
    def form(self) -> str:
        """The form's name; empty for a candidate as it is."""
        return self.acts.name if isinstance(self.acts, Form) else ""


@dataclass(frozen=True)
class Case:
    """What a recording is of. ``unknown_occupancy`` and ``replay`` are what the campaign could measure.

    ``attempt`` counts the draws before this one that could not be simulated.
    """

    seed: int
    index: int
    stratum: str
    causes: tuple[Cause, ...]
    unknown_occupancy: bool
    replay: bool
    attempt: int = 0

    @property
    def root(self) -> int:
        """The root seed of this recording's streams: the set's own but where it is drawn anew."""
        return _root(self.seed, self.attempt)

    def rng(self, purpose: str) -> np.random.Generator:
        """The stream of randomness of this recording for one purpose."""
        return stream(self.root, self.index, f"blind.{purpose}")


def draw_case(truth: Truth, effects: list[Effect], seed: int, index: int, attempt: int = 0) -> Case:
    """Draw one case. Strata come in shuffled blocks and causes in shuffled rounds, so that all occur about equally.

    Another ``attempt`` has the same stratum and causes; all else is drawn anew.
    """
    order = truth.strata.order
    block, place = divmod(index, len(order))
    shuffled = _shuffled(order, seed, f"strata.{block}")
    stratum = shuffled[place]
    turn = block * order.count(stratum) + shuffled[:place].count(stratum)
    root = _root(seed, attempt)
    acts = _acts(truth, effects, seed, index, stratum, turn)
    rng = stream(root, index, "blind.amplitudes")
    causes = tuple(Cause(one, _amplitude(one, truth, rng)) for one in acts)
    conditions = stream(root, index, "blind.conditions").random(2)
    modes = set.intersection({"control", "replay"}, *(set(_modes(one.acts)) for one in causes))
    wanted = "replay" if conditions[1] < truth.measuring.replay else "control"
    return Case(
        seed,
        index,
        stratum,
        causes,
        unknown_occupancy=bool(conditions[0] < truth.measuring.unknown_occupancy),
        replay="replay" in modes and (wanted == "replay" or "control" not in modes),
        attempt=attempt,
    )


def _root(seed: int, attempt: int) -> int:
    if not attempt:
        return seed
    return int.from_bytes(hashlib.sha256(f"blind attempt {attempt} of {seed}".encode()).digest()[:7], "big")


def _acts(truth: Truth, effects: list[Effect], seed: int, index: int, stratum: str, turn: int) -> list[Acts]:
    def pick(acts: Sequence[Acts], purpose: str) -> Acts:
        round_, place = divmod(turn, len(acts))
        return _shuffled(acts, seed, f"{purpose}.{round_}")[place]

    other: list[Acts] = [form for form in truth.forms if form.effect]
    chosen: list[Acts] = []
    if stratum == "library":
        chosen = [pick(effects, "library")]
    elif stratum == "form":
        chosen = [pick(other, "form")]
    elif stratum == "outside":
        chosen = [pick(truth.outside, "outside")]
    elif stratum == "two":
        partners = pairs(truth, effects)
        first = pick([one for one in effects if one.name in partners], "two")
        rest = partners[first.name]
        chosen = [first, rest[int(stream(seed, index, "blind.second").integers(len(rest)))]]
    return chosen


def pairs(truth: Truth, effects: list[Effect]) -> dict[str, list[Acts]]:
    """What may act together with each effect, by its name; effects that nothing goes with are left out."""
    every: list[Acts] = [*effects, *(form for form in truth.forms if form.effect)]
    found = {first.name: [one for one in every if _together(first, one, effects)] for first in effects}
    return {name: rest for name, rest in found.items() if rest}


def _together(first: Acts, second: Acts, effects: list[Effect]) -> bool:
    """Whether two causes differ, can be told as two candidates, and do not drive the same thing."""
    names = [one.effect if isinstance(one, Form) else one.name for one in (first, second)]
    if names[0] == names[1]:
        return False
    if clash([effect for effect in effects if effect.name in names]) or not set(_modes(first)) & set(_modes(second)):
        return False
    return not _driven(first) & _driven(second)


def _driven(acts: Acts) -> set[str]:
    if isinstance(acts, Form):
        return {*acts.parameters, *acts.constants, *(one.input for one in acts.inputs if one.use == "set")}
    return set(getattr(acts, "owns", acts.changes))


def _modes(acts: Acts) -> list[str]:
    if isinstance(acts, Form):
        return list(acts.modes)
    spec = getattr(acts, "spec", None)
    return list(spec.modes) if spec is not None else ["control", "replay"]


def _amplitude(acts: Acts, truth: Truth, rng: np.random.Generator) -> float:
    """Log-uniform over the range of sizes, cut off at its limit, of either sign where both are possible."""
    low, high = np.log(truth.amplitudes)
    size, sign = np.exp(low + (high - low) * rng.random()), rng.random()
    if isinstance(acts, Form):
        return float(min(size * acts.scale, acts.limit) * (-1.0 if acts.signed and sign < 0.5 else 1.0))
    negative = acts.lower < 0 and (acts.upper <= 0 or sign < 0.5)
    bound = -acts.lower if negative else acts.upper
    return float(min(size * acts.scale, bound) * (-1.0 if negative else 1.0))


def _shuffled(items: Sequence[Item], seed: int, purpose: str) -> list[Item]:
    order = stream(seed, 0, f"blind.order.{purpose}").permutation(len(items))
    return [items[k] for k in order]


def purpose(acts: Effect | Form, place: int, one: Driven | Fault) -> str:
    """What a stream of randomness is for: things of one key share it."""
    key = one.key if isinstance(one, Fault) else getattr(one.process, "key", "")
    return f"{acts.name}.{key}" if key else f"{acts.name}.{type(one).__name__}.{place}"


def describe(cause: Cause) -> dict[str, Any]:
    """A cause for the sealed file."""
    acts = cause.acts
    return {
        "effect": cause.label,
        "form": cause.form,
        "description": acts.description,
        "amplitude": cause.amplitude,
        "unit": acts.unit,
        "scale": acts.scale,
    }


_FORMAT: Literal["NETCDF3_64BIT"] = "NETCDF3_64BIT"
"""A format without time stamps, compression or creation order: equal contents give equal bytes and sizes."""


def measured(made: Made, system: System, truth: Truth) -> tuple[np.ndarray, dict[str, dict[str, float]]]:
    """The outputs as measured, shape (outputs, steps) [unit of each], NaN where lost; and each sensor's noise.

    A part of the noise's variance is white, the rest an AR(1) process; then come rounding and losses.
    """
    campaign, rng = truth.measuring, made.case.rng("noise")
    step = float(made.time[1] - made.time[0])
    shown, noises = made.clean.copy(), {}
    for k, output in enumerate(system.outputs):
        sensor = output.noise.get(campaign.noise, Noise())
        hours = float(np.exp(rng.uniform(*np.log(campaign.hours))))
        white = rng.standard_normal(len(made.time)) * sensor.sd * np.sqrt(1.0 - campaign.slow)
        slow = autoregressive(rng, len(made.time), hours * HOUR / step) * sensor.sd * np.sqrt(campaign.slow)
        shown[k] += white + slow
        if sensor.quantum:
            shown[k] = np.round(shown[k] / sensor.quantum) * sensor.quantum
        shown[k, rng.random(len(made.time)) < sensor.dropout] = np.nan
        noises[output.name] = {"sd": sensor.sd, "slow_share": campaign.slow, "hours": hours}
    return shown, noises


def published(made: Made, outputs: np.ndarray, system: System, truth: Truth) -> xr.Dataset:
    """The recording as the diagnosis gets it: variables and attributes depend on the public conditions alone."""
    rng = made.case.rng("inputs")
    variables: dict[str, Any] = {}
    methods = methods_of(system)
    for k, output in enumerate(system.outputs):
        attrs = {"long_name": output.long_name or output.name, "units": output.unit, "role": "output"}
        attrs["cell_methods"] = f"time: {methods[output.name]}"
        variables[output.name] = (("time",), outputs[k].astype(np.float32), attrs)
    for one in system.inputs:
        error = rng.standard_normal(len(made.time)) * truth.measuring.inputs.get(one.name, 0.0)
        if one.name not in made.inputs:
            continue
        attrs = {"long_name": f"input {one.name}", "units": one.unit, "role": "input"}
        attrs["cell_methods"] = f"time: {methods[one.name]}"
        variables[one.name] = (("time",), (made.inputs[one.name] + error).astype(np.float32), attrs)
    clock = {"long_name": "end of the step", "units": f"seconds since {EPOCH}", "calendar": "standard"}
    attrs = {
        "Conventions": "CF-1.11",
        "title": "Recording of a blind check",
        "system_name": system.name,
        "occupancy": "unknown" if made.case.unknown_occupancy else "measured",
        "actuators": "replayed" if made.case.replay else "controlled",
    }
    return xr.Dataset(variables, {"time": (("time",), made.time, clock)}, attrs)


def write(path: Path, recording: xr.Dataset) -> None:
    """Write a recording whole.

    Raises
    ------
    RecordingError
        If it cannot be written; what was there is as it was.
    """
    encoding = {str(name): {"_FillValue": None} for name in recording.variables}
    # in memory: where a disk is full, the C library loses its hold of a file of this format, and later the process
    content = recording.to_netcdf(None, engine="scipy", format=_FORMAT, encoding=encoding)
    try:
        write_atomically(path, bytes(content))
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be written ({error.strerror or error}); expected a place with free space; the same call"
            " goes on from there"
        ) from None


YEAR_HOURS = 8760.0
ROUNDS, MOST_ROUNDS = 6, 60
"""How often a candidate that follows a measured output is simulated, at least and at most, until both agree."""
DAMPED = 0.7
"""By how much steps towards agreement get shorter where output and effect have come no nearer."""


@dataclass(frozen=True)
class Made:
    """One recording and its answer.

    ``clean`` and ``base`` (outputs, steps) [unit of each]: what the sensors would show without noise, and what the
    base model says with the true parameters and constants, driven by what was recorded. ``case`` is the answer;
    ``inputs`` are those that were recorded, without their errors, each (steps,). ``constants``: by what each uncertain
    constant is multiplied. ``driven``: all true inputs, warm-up included, with the actuators as they were recorded in
    replay.
    """

    case: Case
    start: float
    time: np.ndarray
    clean: np.ndarray
    base: np.ndarray
    inputs: dict[str, np.ndarray]
    parameters: dict[str, float]
    constants: dict[str, float]
    controllers: dict[str, float]
    driven: dict[str, Piecewise]


class Generator:
    """Makes recordings of one system by one truth.

    Raises
    ------
    SystemDescriptionError, FmuError
        If truth and system do not fit each other, or their FMUs do not fit them.
    """

    def __init__(self, system: System, truth: Truth, *, hours: float) -> None:
        latest = max(YEAR_HOURS - hours, 0.0)
        self.system = system.with_experiment(hours=hours, start=(0.0, latest))
        self.truth, self.hours = truth, hours
        self.step = system.experiment.step
        if self.step % truth.step or HOUR % truth.step or self.step < truth.step or (hours * HOUR) % HOUR:
            raise SystemDescriptionError(
                f"{truth.path}: step is {truth.step:g} s; expected a part of an hour and of {self.step:g} s"
            )
        self.true_system = truth.described(self.system)
        self.effects = library(system)
        if truth.strata.two and not pairs(truth, self.effects):
            raise SystemDescriptionError(
                f"{truth.path}: strata.two is above 0, and no two effects can act together; expected 0, or [[effects]]"
                f" of {system.path} that do not drive the same thing"
            )
        self.model, self.room = Simulator(self.system), Simulator(self.true_system)
        drawn = truth.measuring.constants
        self.constants = constants(system, self.model.fmu) if drawn else ()
        # the truth's author may have given them other values on purpose
        self.true_constants = constants(self.true_system, self.room.fmu) if drawn else ()

    def make(self, seed: int, index: int, attempt: int = 0) -> Made:
        """Live, and compare with the base model; no noise yet.

        Raises
        ------
        SimulationError
            If this draw cannot be simulated; another ``attempt`` may be.
        """
        case = draw_case(self.truth, self.effects, seed, index, attempt)
        return self.make_case(case)

    def make_case(self, case: Case) -> Made:
        """The same for a given case."""
        start = record_start(self.system, case.root, case.index)
        steps = self._span(start)
        table = build_inputs(
            self.true_system, root_seed=case.root, index=case.index, start=steps.begin, stop=steps.stop
        )
        recorded = signals_of(table)
        drawn = sample_parameters(self.system, case.root, case.index).tolist()
        parameters = dict(zip(self.system.parameter_names, drawn, strict=True))
        factors = sample_factors(self.system, case.root, case.index)[: len(self.constants)]
        building = parameters | values_of(self.constants, factors)
        controllers = self._controllers(case)
        room = parameters | values_of(self.true_constants, factors) | controllers
        warm = round((start - steps.begin) / self.truth.step)
        lived, shown = self._agreed(building, room, case, recorded, steps, warm)
        for cause in case.causes:
            if not isinstance(cause.acts, Form):
                shown = cause.acts.outputs(cause.amplitude, shown, steps.time)
        driven = recorded | (self._actuators(case, lived, shown, warm, steps) if case.replay else {})
        base = self._base(building, driven, steps, replay=case.replay)
        multiplied = {one.name: float(factor) for one, factor in zip(self.constants, factors, strict=True)}
        inputs = self._recorded(case, table, steps)
        return Made(case, start, steps.time, shown, base, inputs, parameters, multiplied, controllers, driven)

    def _span(self, start: float) -> _Span:
        stop = start + self.hours * HOUR
        time = start + self.step * np.arange(1, round((stop - start) / self.step) + 1)
        return _Span(start - self.system.experiment.warm_up_hours * HOUR, start, stop, time)

    def _agreed(
        self,
        building: dict[str, float],
        room: dict[str, float],
        case: Case,
        recorded: dict[str, Piecewise],
        steps: _Span,
        warm: int,
    ) -> tuple[Lived, np.ndarray]:
        """The room, and what its sensors show (outputs, steps), where candidates follow what is shown.

        Raises
        ------
        SimulationError
            If what is shown does not settle to within each output's accuracy: nothing is then as the candidate has it.
        """

        def once(measured: np.ndarray) -> tuple[Lived, np.ndarray]:
            lived, signals = self._live(room, case, recorded, steps, measured)
            return lived, self._shown(case, lived, signals, warm, steps)

        # what does not say may look at anything that is measured
        some = frozenset(self.system.output_names)
        causes = [one for one in case.causes if not isinstance(one.acts, Form)]
        following = [one.label for one in causes if getattr(one.acts, "follows", some)]
        if not following:
            return once(np.zeros((len(self.system.outputs), len(steps.time))))
        accuracy = np.array([[one.accuracy] for one in self.system.outputs])
        guess = self._base(building, recorded, steps)
        damping, off = 0.5, np.inf
        for turn in range(1, MOST_ROUNDS + 1):
            lived, shown = once(guess)
            before, off = off, float(np.max(np.abs(shown - guess) / accuracy))
            if turn >= ROUNDS and off < 1.0:
                return lived, shown
            if turn > ROUNDS and off >= before:
                damping *= DAMPED
            guess = (1.0 - damping) * guess + damping * shown
        raise SimulationError(
            f"{self.truth.path}: {', '.join(following)} and the outputs that it follows do not agree after"
            f" {MOST_ROUNDS} simulations; expected a change within their accuracy, it is {off:.3g} times that"
        )

    def _live(
        self,
        parameters: dict[str, float],
        case: Case,
        recorded: dict[str, Piecewise],
        steps: _Span,
        measured: np.ndarray,
    ) -> tuple[Lived, dict[str, Piecewise]]:
        """The room with all causes at work; ``measured`` is what candidates that follow an output follow."""
        signals, values, window = dict(recorded), dict(parameters), None
        for cause in case.causes:
            if isinstance(cause.acts, Form):
                form = cause.acts
                values |= {**form.constants, **{k: v * cause.amplitude for k, v in form.parameters.items()}}
                for k, one in enumerate(form.inputs):
                    rng = case.rng(purpose(form, k, one))
                    if isinstance(one.process, Occupant):
                        window = (one.input, one.process.room, Window(one.process, signals, rng))
                    signals[one.input] = drive(one, cause.amplitude, signals, steps.begin, steps.stop, rng)
            else:
                values |= cause.acts.parameters(cause.amplitude)
                recording = Recording(path=Path("truth"), step=self.step, time=steps.time, outputs=measured, inputs={})
                signals = cause.acts.inputs(cause.amplitude, signals, recording)
        lived = live(
            self.room,
            values,
            signals,
            begin=steps.begin,
            stop=steps.stop,
            step=self.truth.step,
            tolerance=self.truth.tolerance,
            window=window,
        )
        return lived, signals

    def _shown(self, case: Case, lived: Lived, signals: dict[str, Piecewise], warm: int, steps: _Span) -> np.ndarray:
        """What the truth's own sensors show without noise, shape (outputs, steps)."""
        outputs, time = lived.outputs[:, warm:].copy(), lived.time[warm:]
        followed: dict[str, Any] = {name: values[warm:] for name, values in lived.states.items()} | signals
        for cause in case.causes:
            for k, fault in enumerate(cause.acts.faults if isinstance(cause.acts, Form) else []):
                if fault.kind == "series" and fault.series not in followed:
                    weather = system_weather(self.system, case.root, case.index)
                    followed[fault.series] = weather.signal(fault.series, steps.begin, steps.stop)
                path = wandering(case.rng(purpose(cause.acts, k, fault)), steps.begin, steps.stop, fault.hours)
                for name in fault.outputs:
                    row = self.system.output_names.index(name)
                    size = cause.amplitude * fault.amount
                    outputs[row] = erring(fault, size, outputs[row], time, followed, path)
        return coarse(outputs, [one.method for one in self.system.outputs], round(self.step / self.truth.step))

    def _base(
        self, parameters: dict[str, float], signals: dict[str, Piecewise], steps: _Span, replay: bool = False
    ) -> np.ndarray:
        """The base model, shape (outputs, steps)."""
        table = merge({name: signals[name] for name in self.system.input_names}, steps.begin, steps.stop)
        made = self.model.run(
            parameters, table, start=steps.begin, stop=steps.stop, record_from=steps.start, replay=replay
        )
        return made.outputs

    def _actuators(self, case: Case, lived: Lived, shown: np.ndarray, warm: int, steps: _Span) -> dict[str, Piecewise]:
        """The actuators as they were recorded, warm-up before them, by the inputs that replay them.

        A candidate's meter reads before the recording as it does in it: whatever clears the one clears the other.
        """
        ratio = round(self.step / self.truth.step)
        before = coarse(lived.outputs[:, :warm], [one.method for one in self.system.outputs], ratio)
        ends = np.concatenate([steps.time[0] - self.step * np.arange(before.shape[1], 0, -1), steps.time])
        replayed = {one.name for one in self.system.inputs if one.source == "measured"}
        for cause in case.causes:
            if not isinstance(cause.acts, Form) and cause.acts.changes & replayed:
                whole = cause.acts.outputs(cause.amplitude, np.concatenate([before, shown], axis=1), ends)
                before = whole[:, : before.shape[1]]
        signals = {}
        for one in self.system.inputs:
            if one.source == "measured" and one.column in self.system.output_names:
                row = self.system.output_names.index(one.column)
                values = np.concatenate([before[row], shown[row]])
                signals[one.name] = Piecewise(ends - self.step, values, "previous")
        return signals

    def _controllers(self, case: Case) -> dict[str, float]:
        """What the true controllers have otherwise, where nobody needs to know them."""
        if not case.replay:
            return {}
        rng, drawn = case.rng("controllers"), {}
        for name, (value, low, high) in self.truth.measuring.controllers.items():
            drawn[name] = float(value * np.exp(rng.uniform(np.log(low), np.log(high))))
        return drawn

    def _recorded(self, case: Case, table: InputTable, steps: _Span) -> dict[str, np.ndarray]:
        """Inputs that were measured: the weather always, persons if counted, the control's own unless replayed."""
        edges = np.concatenate([[steps.start], steps.time])
        means, instants = table.means(edges), table.at(steps.time)
        found = {}
        for one in self.system.inputs:
            column = table.names.index(one.name)
            known = {
                "weather": True,
                "occupancy": not case.unknown_occupancy,
                "schedule": not case.replay,
                "excitation": not case.replay,
            }.get(one.source, False)
            if known:
                found[one.name] = (means if one.interpolation == "previous" else instants)[:, column]
        return found


@dataclass(frozen=True)
class _Span:
    """Begin of the warm-up, start and stop of the recording [s]; ``time`` (steps,) ends of its steps [s]."""

    begin: float
    start: float
    stop: float
    time: np.ndarray
