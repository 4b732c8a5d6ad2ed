"""One recording of a blind check: the true room is lived in, measured, and set beside what the model would say.

Everything depends on (seed, index) alone, also which of its draws is the first that can be simulated: recordings can be
made in any order by any number of processes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from datagen.driving.inputs import build_inputs, system_weather
from datagen.driving.sampling import record_start, sample_parameters
from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.simulator import Simulator
from diagnosis.blind.draw import Case, draw_case, pairs, purpose
from diagnosis.blind.faults import erring
from diagnosis.blind.processes import Window, drive, signals_of, wandering
from diagnosis.blind.room import Lived, coarse, live
from diagnosis.blind.truth import Form, Occupant, Truth
from diagnosis.effects import Effect, library
from diagnosis.recording import HOUR, Recording
from shared.errors import SimulationError, SystemDescriptionError
from shared.system import System

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
    constant is multiplied. ``driven`` and ``building``: all true inputs, warm-up included, with the actuators as they
    were recorded in replay, and the parameters, constants included, from which the base model makes ``base``.
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
    building: dict[str, float]


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
        return Made(case, start, steps.time, shown, base, inputs, parameters, multiplied, controllers, driven, building)

    def signature(self, made: Made, effect: Effect, amplitude: float) -> np.ndarray:
        """What a candidate of an amplitude [its unit] does to ``base``, shape (outputs, steps) [unit of each].

        It acts as a cause does, on the true inputs over warm-up and recording and, in replay, on the recorded
        actuators. What follows a measured output follows ``clean``, which has felt the cause already: nothing is fed
        back.

        Raises
        ------
        SimulationError
            If the base model cannot be simulated with it.
        """
        recording = Recording(path=Path("truth"), step=self.step, time=made.time, outputs=made.clean, inputs={})
        values = made.building | effect.parameters(amplitude)
        signals = effect.inputs(amplitude, made.driven, recording)
        outputs = self._base(values, signals, self._span(made.start), replay=made.case.replay)
        return np.asarray(effect.outputs(amplitude, outputs, made.time) - made.base)

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
            start=steps.begin,
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
