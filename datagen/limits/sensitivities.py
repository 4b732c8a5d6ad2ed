"""How the outputs of a random window of a random system move with all that is unknown about it.

All derivatives are differences of whole simulations, so saturation and events are in them: central ones, but for
persons, of whom one more is simulated (:mod:`datagen.limits.pulses`).
:mod:`datagen.limits.ceilings` makes limits of them.

Model Exchange begins a window from the state in which the record's past has left it. Co-Simulation keeps its states to
itself: each simulation has the past before the window, and the window after other pasts tells what its start does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from datagen.driving.inputs import build_inputs
from datagen.driving.occupancy import occupancy_prior, sized
from datagen.driving.sampling import record_start, sample_parameters, stream
from datagen.driving.tables import InputTable
from datagen.limits.pulses import responses
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.drawn import drawn_values
from datagen.simulating.simulator import Simulator
from shared.store import sha256_of
from shared.system import System
from shared.variables import Parameter

HOUR = 3600.0
PULSE = 600.0
"""Length of an occupancy pulse at most [s]: people come and go within the hour, and nobody knows when. Half-hours
would pass for known within: with 1800 here a day of clean readings has a mean R2 of 0.80, with 600 of 0.75, with 300 of
0.74 (the default system, two sensors, three rooms, seed 1)."""
SPIN_UP_HOURS = 240.0
"""Of a window's past, what is simulated before it at least, where its record goes back so far."""
PARAMETER_STEP = 0.02
"""Half-width of the difference for a parameter or a constant, in prior standard deviations of its own scale."""
STATE_STEP = 0.02
PASTS = 24
"""Other pasts of a window, of an FMU that keeps its states to itself: their ends lie evenly in its own past."""
FREE = 10.0
"""So many times as far as other pasts bring it is such a start taken to vary. A parameter that moves the past moves the
start as well: with a variance a hundred times as large, the start hardly tells of it, as with Model Exchange."""
PRIOR_DRAWS, DRAWS_EACH = 4000, 5
"""Of the occupancy: at least, and for each pulse, lest its covariance lack directions that nobody happened to take."""
TOLERANCE = 1e-8
"""Tighter than the farm's: differences of simulations are small."""

_SIMULATORS: dict[str, Simulator] = {}


@dataclass(frozen=True)
class Window:
    """Sensitivities of one random window.

    ``parameters`` (outputs, steps, parameters) per prior standard deviation; ``states`` (outputs, steps, states)
    [unit of output per unit of state], of Co-Simulation per unit of :data:`PASTS` independent numbers of variance one;
    ``constants`` (outputs, steps, constants) per prior standard deviation of the logarithm, without any constants where
    all are known; ``occupancy`` (outputs, steps, pulses) per person; ``occupancy_covariance`` (pulses, pulses)
    [persons^2]; ``occupancy_steps`` (pulses,), the step that each pulse lies in; ``visited`` (steps, states), states
    met on the way, for the prior of the start.
    """

    parameters: np.ndarray
    states: np.ndarray
    constants: np.ndarray
    occupancy: np.ndarray
    occupancy_covariance: np.ndarray
    occupancy_steps: np.ndarray
    visited: np.ndarray


def crowd_inputs(system: System) -> list[str]:
    """Names of the inputs that are the number of persons: one crowd, however many read it."""
    return [one.name for one in system.inputs if one.source == "occupancy"]


def around(parameter: Parameter, value: float, step: float = PARAMETER_STEP) -> tuple[float, float]:
    """Two values [unit of the parameter] about ``value``, of which the difference is taken; within its range.

    They are equally far in the parameter's own scale, ``step`` prior standard deviations: on the linear one a parameter
    that is drawn over decades would be moved by more than its value where that is small. Where the range ends, the
    difference is one-sided.
    """
    draws = parameter.from_unit(np.linspace(0, 1, 2001))
    if parameter.scale == "log":
        ratio = float(np.exp(step * np.std(np.log(draws))))
        low, high = value / ratio, value * ratio
    else:
        move = step * float(np.std(draws))
        low, high = value - move, value + move
    return max(low, parameter.min), min(high, parameter.max)


@dataclass(frozen=True)
class _Span:
    """Inputs from the past of a window to its end, and where in them the window is (all times [s])."""

    simulator: Simulator
    table: InputTable
    begin: float
    stop: float
    step: float

    @property
    def window(self) -> InputTable:
        """Inputs of the window alone."""
        return self.table.restricted(self.begin, self.stop)


class _FromStates:
    """Model Exchange: simulations of a window from the state in which its past has left it."""

    half = PARAMETER_STEP

    def __init__(self, span: _Span, values: dict[str, float]) -> None:
        self._span, self.window = span, span.window
        past = span.begin - span.table.start
        self.visited = np.empty((0, span.simulator.fmu.n_states))
        if past > 0:
            spacing = min(span.step, past)
            whole = spacing * np.floor(past / spacing + 1e-9)  # whole steps, lest there be no value at their end
            self.visited = span.simulator.run(
                values,
                span.table.restricted(span.table.start, span.begin),
                start=span.table.start,
                stop=span.begin,
                step=spacing,
                record_from=span.begin - whole,
                record_states=True,
            ).states
        self._start = self.visited[-1] if len(self.visited) else None

    def outputs(self, values: dict[str, float], inputs: InputTable, states: np.ndarray | None = None) -> np.ndarray:
        """Outputs of the window, shape (outputs, steps)."""
        return self._span.simulator.run(
            values,
            inputs,
            start=self._span.begin,
            stop=self._span.stop,
            tolerance=TOLERANCE,
            initial_states=self._start if states is None else states,
        ).outputs

    def by_start(self, values: dict[str, float]) -> list[np.ndarray]:
        """How outputs move with each state at the start; not at all where that is the FMU's own, which is known."""
        if self._start is None:
            return [np.zeros_like(self.outputs(values, self.window))] * self.visited.shape[1]
        found, spread = [], self.visited.std(axis=0)
        for k in range(len(self._start)):
            move = np.zeros_like(self._start)
            move[k] = max(STATE_STEP * spread[k], 1e-9 * abs(self._start[k]), 1e-12)
            ends = (self._start + move, self._start - move)
            up, down = (self.outputs(values, self.window, states=states) for states in ends)
            found.append((up - down) / (2 * move[k]))
        return found


class _FromThePast:
    """Co-Simulation: simulations of a window with the past before it."""

    def __init__(self, span: _Span, values: dict[str, float]) -> None:
        self._span, self.window = span, span.window
        past = span.begin - span.table.start
        self._past = span.table.restricted(span.table.start, span.begin) if past > 0 else None
        self.visited = np.empty((0, 0))
        if self._past is not None:  # independent, of variance one
            one = np.sqrt(PASTS) * np.eye(PASTS)
            self.visited = np.concatenate([one, -one])
        default = span.simulator.fmu.description.defaultExperiment
        own = float(default.tolerance) if default is not None and default.tolerance else 0.0
        # central differences are best at about the cube root of what numbers are good to (Press et al. 2007, 5.7)
        self.half = max(PARAMETER_STEP, np.cbrt(own or span.simulator.system.experiment.tolerance))

    def outputs(self, values: dict[str, float], inputs: InputTable) -> np.ndarray:
        """Outputs of the window, shape (outputs, steps)."""
        return self._after(self._past, values, inputs)

    def by_start(self, values: dict[str, float]) -> list[np.ndarray]:
        """How outputs move after other pasts: parts of the window's own, each moved to end where the window begins."""
        if self._past is None:
            return []
        first, last = self._past.start, self._past.stop
        found = []
        for end in np.linspace(first, last, PASTS + 1)[1:]:
            part = self._past.restricted(first, end)
            found.append(self._after(replace(part, time=part.time + (last - end)), values, self.window))
        mean = np.mean(found, axis=0)
        return [FREE / np.sqrt(PASTS) * (one - mean) for one in found]

    def _after(self, past: InputTable | None, values: dict[str, float], inputs: InputTable) -> np.ndarray:
        if past is not None:
            inputs = InputTable(
                inputs.names,
                np.concatenate([past.time[:-1], inputs.time]),
                np.concatenate([past.left, inputs.left]),
                np.concatenate([past.right, inputs.right]),
                np.concatenate([past.jump[:-1], [True], inputs.jump[1:]]),
            )
        return self._span.simulator.run(
            values, inputs, start=inputs.start, stop=self._span.stop, record_from=self._span.begin, tolerance=TOLERANCE
        ).outputs


def simulator_of(system: System) -> Simulator:
    """The simulator of a system: one in each process."""
    key = f"{system.canonical()} {system.fmu_path} {sha256_of(system.fmu_path)}"
    if key not in _SIMULATORS:
        _SIMULATORS[key] = Simulator(system)
    return _SIMULATORS[key]


def random_window(system: System, context: float, seed: int, index: int, uncertain: bool = False) -> Window:
    """Sensitivities of a random window of ``context`` [h] of a random system, from its record as the farm makes it.

    Where ``uncertain`` is set its uncertain constants are drawn, too, and the window has their sensitivities. Like the
    parameters they are moved from the window's start on alone: the state there is an unknown of its own. It is what the
    record's past leads to, so that a window on a record's first hours, where the record is not warmed up, begins with
    the state of the FMU itself, which is known, and shows how it settles.
    """
    simulator = simulator_of(system)
    step = system.experiment.step
    span = context * HOUR
    latest = max(int((system.experiment.hours * HOUR - span) // step), 0)
    since = step * int(stream(seed, index, "window").integers(latest + 1))
    begin = record_start(system, seed, index) + since
    theta = sample_parameters(system, seed, index)
    scale = np.array([float(np.std(p.from_unit(np.linspace(0, 1, 2001)))) for p in system.parameters])
    known = constants(system, simulator.fmu) if uncertain else ()
    drawn = sample_factors(system, seed, index) if uncertain else np.empty(0)
    warm_up = system.experiment.warm_up_hours * HOUR
    spin_up = min(step * np.ceil(max(SPIN_UP_HOURS * HOUR, warm_up) / step - 1e-9), since + warm_up)
    table = build_inputs(system, root_seed=seed, index=index, start=begin - spin_up, stop=begin + span)

    given = drawn_values(simulator, seed, index)

    def setting(values: np.ndarray = theta, factors: np.ndarray = drawn) -> dict[str, float]:
        return given | dict(zip(system.parameter_names, values.tolist(), strict=True)) | values_of(known, factors)

    each = int(np.ceil(step / PULSE - 1e-9))
    edges = begin + step / each * np.arange(round(span / step) * each + 1)
    kind = _FromThePast if simulator.fmu.cosimulation else _FromStates
    runs = kind(_Span(simulator, table.refined(edges), begin, begin + span, step), setting())
    by_parameter, by_constant = [], []
    for k, parameter in enumerate(system.parameters):
        ends = np.tile(theta, (2, 1))
        ends[:, k] = around(parameter, float(theta[k]), runs.half)
        low, high = (runs.outputs(setting(one), runs.window) for one in ends)
        by_parameter.append((high - low) / ((ends[1, k] - ends[0, k]) / scale[k]))
    for k, constant in enumerate(known):
        ratio = np.ones_like(drawn)
        ratio[k] = np.exp(runs.half * constant.relative)
        up, down = (runs.outputs(setting(factors=one), runs.window) for one in (drawn * ratio, drawn / ratio))
        by_constant.append((up - down) / (2 * runs.half))
    by_start = runs.by_start(setting())
    shape = (len(system.outputs), round(span / step), 0)
    by_pulse, covariance, within = np.empty(shape), np.empty((0, 0)), np.empty(0, dtype=int)
    crowd = [system.input_names.index(name) for name in crowd_inputs(system)]
    if crowd and system.occupancy is not None:
        undisturbed = runs.outputs(setting(), runs.window)

        def response(pulses: Sequence[tuple[float, float]]) -> np.ndarray:
            more = runs.window
            for column in crowd:
                for a, b in pulses:
                    more = more.with_pulse(column, a, b, 1.0)
            return runs.outputs(setting(), more) - undisturbed

        persons = system.occupancy
        if persons.per:
            persons = sized(persons, float(theta[system.parameter_names.index(persons.per)]))
        draws = occupancy_prior(persons, edges, max(PRIOR_DRAWS, DRAWS_EACH * (len(edges) - 1)), seed)
        some = np.flatnonzero(np.ptp(draws, axis=0) > 0)  # nobody comes at night
        if some.size:  # nor at weekends, say
            covariance, within = np.atleast_2d(np.cov(draws[:, some], rowvar=False)), some // each
            pulses = list(pairwise(edges))
            by_pulse = responses(response, [pulses[k] for k in some], begin + step * np.arange(1, shape[1] + 1))

    def stacked(columns: list[np.ndarray]) -> np.ndarray:
        return np.stack(columns, axis=-1) if columns else np.empty(shape)

    return Window(
        parameters=stacked(by_parameter),
        states=stacked(by_start),
        constants=stacked(by_constant),
        occupancy=by_pulse,
        occupancy_covariance=covariance,
        occupancy_steps=within,
        visited=runs.visited,
    )
