"""One simulation: a system, its parameters and inputs in; outputs on the output grid out."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from datagen.driving.tables import InputTable
from datagen.fmi import calls, instances
from datagen.fmi.checking import check_held, check_system, conversion_of, fmu_of
from datagen.simulating import cosimulation, native
from datagen.simulating.canary import resets_cleanly
from datagen.simulating.solver import Cvode
from shared import watchdog
from shared.errors import SimulationError
from shared.system import System
from shared.variables import WeatherInput

_SHARE = 1e4
"""Error of a mean that a step may make, relative to the tolerance and the output's accuracy."""
_YEAR = 8760 * 3600.0
"""Of the weather and of whatever an FMU reads by its time [s]."""
_HOUR = 3600.0
"""The solver's longest step [s], where outputs are not further apart: the error test may let everything pass."""
_SLOW = 0.02
"""An FMU that takes longer than this to instantiate [s] is reset between runs, if that is clean."""


@dataclass(frozen=True)
class Trajectory:
    """The outputs of one simulation.

    ``time`` (steps,) ends of the output steps [s]; ``outputs`` (outputs, steps) and ``inputs`` (inputs, steps), or
    none, in the order and units of the system description; ``states`` (steps + 1, states), from the start on, or empty;
    ``statistics`` counts right-hand sides, indicator calls and events, or communication steps.
    """

    time: np.ndarray
    outputs: np.ndarray
    inputs: np.ndarray
    states: np.ndarray
    statistics: dict[str, int]


class Simulator:
    """Simulates one system again and again: the FMU is loaded once, and each run gets a clean instance.

    Model Exchange is integrated here; of an FMU that has only Co-Simulation, :mod:`datagen.simulating.cosimulation`
    tells how its steps are chosen. An output that falls on an event is taken just before it.

    ``reuse`` tells whether instances are reset between runs instead of made afresh: None until it is decided, which
    happens when the FMU turns out slow to instantiate, by a canary (:mod:`datagen.simulating.canary`).

    Raises
    ------
    FmuError, SystemDescriptionError
        If the FMU cannot be loaded or does not fit the description.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.fmu = fmu_of(system)
        check_system(system, self.fmu)
        self.reuse: bool | None = None
        self._finished = False
        self._lock = threading.RLock()  # one instance: threads take turns
        self._points = [k for k, o in enumerate(system.outputs) if o.method == "point"]
        self._means = [k for k, o in enumerate(system.outputs) if o.method == "mean"]
        variables = self.fmu.variables
        outputs = [variables[o.fmu_variable].valueReference for o in system.outputs]
        discrete = np.array([variables[name].variability == "discrete" for name in system.input_names], dtype=bool)
        self._order = np.argsort(discrete, kind="stable")  # discrete inputs last
        inputs = [variables[system.input_names[k]].valueReference for k in self._order]
        self._n_continuous = int(np.sum(~discrete))
        self._vr_points = np.array([outputs[k] for k in self._points], dtype=np.uint32)
        self._vr_means = np.array([outputs[k] for k in self._means], dtype=np.uint32)
        self._vr_inputs = np.array(inputs, dtype=np.uint32)
        self._inputs_to_fmu = [conversion_of(system.inputs[k], variables[system.inputs[k].name]) for k in self._order]
        self._parameters_to_fmu = {one.name: conversion_of(one, variables[one.name]) for one in system.parameters}
        self._outputs_to_fmu = [conversion_of(one, variables[one.fmu_variable]) for one in system.outputs]
        self._held = np.array([one.interpolation == "previous" for one in system.inputs], dtype=bool)
        read = [one.column if isinstance(one, WeatherInput) else "" for one in system.inputs]
        self._directions = [k for k, column in enumerate(read) if column == "wind_direction"]

    def run(
        self,
        parameters: Mapping[str, float],
        inputs: InputTable,
        *,
        start: float,
        stop: float,
        step: float | None = None,
        record_from: float | None = None,
        tolerance: float | None = None,
        replay: bool = False,
        initial_states: np.ndarray | None = None,
        record_states: bool = False,
        driven: bool = True,
        timeout: float | None = None,
    ) -> Trajectory:
        """Simulate from ``start`` to ``stop`` and record every ``step`` from ``record_from`` on (all [s]).

        The FMU's own time is never negative: what begins before time 0 is simulated whole years later.

        Parameters
        ----------
        parameters
            Values by name [unit of the description]; ``fixed`` ones may be overridden.
        inputs
            Knots that span at least ``start`` to ``stop``.
        replay
            Measured actuators replace the control loops: sets the description's ``replay`` table.
        initial_states
            Continuous states at ``start`` in place of the FMU's own, shape (states,).
        driven
            Whether the inputs of each step are wanted as well.
        timeout
            Wall-clock limit of the simulation [s]; that of the command or of its worker, if not given. An FMU that
            hangs in one of its own functions ends such a process, and is not interrupted in any other
            (:mod:`shared.watchdog`).

        Raises
        ------
        SimulationError
            If the end was not reached; data are never short.
        SystemDescriptionError
            If a discrete input of the FMU changes other than in steps.
        ValueError
            If the span is not a whole number of steps.
        """
        system = self.system
        step = system.experiment.step if step is None else step
        tolerance = system.experiment.tolerance if tolerance is None else tolerance
        record_from = start if record_from is None else record_from
        count = round((stop - record_from) / step)
        if count < 1 or not start <= record_from or abs(record_from + count * step - stop) > 1e-6 * step:
            raise ValueError(f"{record_from:g} to {stop:g} s is not a whole number of steps of {step:g} s")
        grid = np.minimum(record_from + step * np.arange(count + 1, dtype=np.float64), stop)
        if self.fmu.cosimulation and (initial_states is not None or record_states):
            raise SimulationError(
                f"{self.fmu.path.name}: Co-Simulation; expected Model Exchange, which shows its states"
            )
        table = self._arranged(inputs.restricted(start, stop))
        # many an FMU fails, or never returns, before its time 0: a warm-up wraps into the year before
        years = max(float(np.ceil(-start / _YEAR)), 0.0) * _YEAR
        recorded = grid
        if years:
            table = replace(table, time=table.time + years)
            start, stop, grid = start + years, stop + years, grid + years
        n = self._n_continuous
        check_held(system, self.fmu, table.names[n:], table.left[:, n:], table.right[:, n:])
        records = _Records(
            points=np.full((count + 1, len(self._points)), np.nan),
            quadratures=np.full((count + 1, len(self._means)), np.nan),
            states=np.full((count + 1, self.fmu.n_states), np.nan) if record_states else np.empty((0, 0)),
        )
        with self._lock:
            if self.reuse is None and self.fmu.seconds_to_instantiate > _SLOW:
                self.reuse = False
                span = {"start": start - years, "stop": stop - years, "step": step}
                self.reuse = resets_cleanly(self, parameters, inputs, **span, timeout=timeout)
            plan, kept = self._plan(table)
            timeout = watchdog.limit() if timeout is None else timeout
            with watchdog.watched(str(self.fmu.path), partial(plan.__setitem__, calls.EXPIRED, 1), timeout):
                next_event, *states = instances.initialise(
                    self.fmu,
                    {**system.fixed, **(system.replay if replay else {}), **self._in_fmu_units(parameters)},
                    (self._vr_inputs.tolist(), table.at(np.array([start]))[0].tolist()),
                    start=start,
                    stop=stop,
                    tolerance=tolerance,
                    initial_states=initial_states,
                    reuse=bool(self.reuse) and self._finished,
                )
                self._finished = False
                plan[calls.COMPONENT] = self.fmu.interface.instance
                reached = np.array([start])
                if self.fmu.cosimulation:
                    outcome = self._step(plan, table, grid, step, records, reached)
                else:
                    outcome = self._integrate(plan, table, grid, step, tolerance, records, next_event, states, reached)
            del kept
            if outcome != calls.DONE:
                where = (float(reached[0]) - years, stop - years)
                raise SimulationError(instances.cause(self.fmu, outcome, plan, *where, timeout))
            self._finished = True  # an instance that failed is not used again
        outputs = np.empty((len(system.outputs), count))
        outputs[self._points] = records.points[1:].T
        outputs[self._means] = (np.diff(records.quadratures, axis=0) / step).T
        for k, one in enumerate(self._outputs_to_fmu):
            if not one.nothing:
                outputs[k] = one.from_fmu(outputs[k])
        counts = {"right_hand_sides": calls.RHS_CALLS, "indicator_calls": calls.INDICATOR_CALLS, "events": calls.EVENTS}
        if self.fmu.cosimulation:
            counts = {"communication_steps": calls.STEPS}
        return Trajectory(
            time=recorded[1:],
            outputs=outputs,
            inputs=self.driven(inputs, recorded) if driven else np.empty((0, count)),
            states=records.states,
            statistics={name: int(plan[place]) for name, place in counts.items()},
        )

    def _integrate(
        self,
        plan: np.ndarray,
        table: InputTable,
        grid: np.ndarray,
        step: float,
        tolerance: float,
        records: _Records,
        next_event: np.ndarray,
        initial: list[np.ndarray],
        reached: np.ndarray,
    ) -> int:
        """Model Exchange: CVODE over the compiled callbacks, from states (and nominal values); returns an outcome."""
        share = _SHARE if self.fmu.n_states else 1.0  # without states nothing else tells the solver how far it may go
        accuracies = [self.system.outputs[k].accuracy * abs(self._outputs_to_fmu[k].factor) for k in self._means]
        areas = share * tolerance * step * np.array(accuracies)
        nominal = np.where(initial[1] == 0, 1.0, np.abs(initial[1]))  # some exporters write 0 for what they do not know
        absolute = np.concatenate([tolerance * nominal, areas])
        cvode = Cvode(
            plan,
            table.start,
            np.concatenate([initial[0], np.zeros(len(self._means))]),
            tolerance,
            absolute,
            max(step, _HOUR),
        )
        stops = np.unique(np.concatenate([[0], np.flatnonzero(table.jump), [len(table.time) - 1]])).astype(np.int64)
        try:
            return native.drive(
                plan,
                cvode.state,
                stops,
                table.time,
                grid,
                records.points,
                records.quadratures,
                records.states,
                next_event,
                reached,
            )
        finally:
            cvode.close()

    def _step(
        self,
        plan: np.ndarray,
        table: InputTable,
        grid: np.ndarray,
        step: float,
        records: _Records,
        reached: np.ndarray,
    ) -> int:
        """Co-Simulation: from one communication point to the next; returns an outcome."""
        kind, experiment = self.fmu.description.coSimulation, self.fmu.description.defaultExperiment
        own = float(experiment.stepSize) if experiment is not None and experiment.stepSize else None
        internal = float(kind.fixedInternalStepSize) if kind.fixedInternalStepSize else None
        try:
            steps = cosimulation.plan_steps(
                table,
                grid,
                cosimulation.longest_step(step, own, internal, means=bool(self._means)),
                variable=kind.canHandleVariableCommunicationStepSize,
                slopes=bool(plan[calls.SET_SLOPES]),
                n_continuous=self._n_continuous,
            )
        except ValueError as error:
            raise SimulationError(f"{self.fmu.path.name}: {error}") from None
        return cosimulation.march(plan, *steps, records.points, records.quadratures, reached)

    def driven(self, inputs: InputTable, grid: np.ndarray) -> np.ndarray:
        """Inputs of each step between the points of a grid, shape (inputs, steps): means of what is held, else ends."""
        found = np.where(self._held[:, None], inputs.means(grid).T, inputs.at(grid[1:]).T)
        found[self._directions] %= 360.0  # as a vane shows it; the FMU's has no jump from 360 to 0
        return found

    def _in_fmu_units(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Parameters as the FMU takes them; those that the description does not declare are in its unit already."""
        known = self._parameters_to_fmu
        return {name: known[name].to_fmu(value) if name in known else value for name, value in parameters.items()}

    def _arranged(self, table: InputTable) -> InputTable:
        """The table in the FMU's units and with discrete inputs last, as the compiled code wants it."""
        order, units = self._order, self._inputs_to_fmu
        if (order[:-1] < order[1:]).all() and all(one.nothing for one in units):
            return table
        factor, offset = np.array([one.factor for one in units]), np.array([one.offset for one in units])
        left, right = (np.ascontiguousarray(factor * one[:, order] + offset) for one in (table.left, table.right))
        return InputTable(tuple(table.names[k] for k in order), table.time, left, right, table.jump)

    def _plan(self, table: InputTable) -> tuple[np.ndarray, list[np.ndarray]]:
        """The plan without what instance and solver add, and the arrays that it points to."""
        plan = np.zeros(calls.PLAN_SIZE, dtype=np.int64)
        for place, function in self.fmu.interface.functions.items():
            plan[place] = self.fmu.interface.address(function)
        if not self._n_continuous:
            plan[calls.SET_SLOPES] = 0
        arrays: dict[int, np.ndarray] = {
            calls.VR_INPUTS: self._vr_inputs,
            calls.VR_POINTS: self._vr_points,
            calls.VR_MEANS: self._vr_means,
            calls.INPUTS: np.zeros(max(len(self._vr_inputs), 1)),
            calls.KNOT_TIME: table.time,
            calls.KNOT_LEFT: table.left,
            calls.KNOT_RIGHT: table.right,
        }
        for place, array in arrays.items():
            plan[place] = array.ctypes.data
        plan[calls.FMI] = self.fmu.interface.version
        plan[calls.EACH_STEP] = self.fmu.told_each_step
        plan[calls.N_STATES] = self.fmu.n_states
        plan[calls.N_INDICATORS] = self.fmu.n_indicators
        plan[calls.N_INPUTS] = len(self._vr_inputs)
        plan[calls.N_CONTINUOUS] = self._n_continuous
        plan[calls.N_POINTS] = len(self._points)
        plan[calls.N_MEANS] = len(self._means)
        plan[calls.N_KNOTS] = len(table.time)
        return plan, list(arrays.values())


@dataclass(frozen=True)
class _Records:
    """What a simulation fills in, a row for each output time; ``states`` may be empty."""

    points: np.ndarray
    quadratures: np.ndarray
    states: np.ndarray
