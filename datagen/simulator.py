"""One simulation: a system, its parameters and inputs in; outputs on the output grid out."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from fmpy.fmi1 import FMICallException

from datagen import native
from datagen.fmu import Fmu, check_system
from datagen.solver import Cvode, plain
from datagen.tables import InputTable
from shared.errors import SimulationError
from shared.system import System

_FUNCTIONS = {
    native.SET_TIME: "fmi2SetTime",
    native.SET_REAL: "fmi2SetReal",
    native.GET_REAL: "fmi2GetReal",
    native.SET_STATES: "fmi2SetContinuousStates",
    native.GET_STATES: "fmi2GetContinuousStates",
    native.GET_DERIVATIVES: "fmi2GetDerivatives",
    native.GET_INDICATORS: "fmi2GetEventIndicators",
    native.ENTER_EVENT: "fmi2EnterEventMode",
    native.NEW_DISCRETE: "fmi2NewDiscreteStates",
    native.ENTER_CONTINUOUS: "fmi2EnterContinuousTimeMode",
    native.STEP_DONE: "fmi2CompletedIntegratorStep",
}
_CAUSES = {
    native.TERMINATED: "the FMU asked to terminate",
    native.ENDLESS_EVENT: f"an event did not settle in {native.MAX_EVENT_ITERATIONS} iterations",
    native.NOT_FINITE: "an output is not finite",
    -1: "CVODE: too many steps between two outputs",
    -2: "CVODE: accuracy beyond the machine's",
    -3: "CVODE: error test failed repeatedly",
    -4: "CVODE: corrector did not converge",
    -8: "CVODE: the right-hand side failed",
    -12: "CVODE: the event indicators failed",
}
_EXCLUDED = 1e100
"""Absolute tolerance of a quadrature: keeps it out of the error test."""


@dataclass(frozen=True)
class Trajectory:
    """The outputs of one simulation.

    ``time`` (steps,) ends of the output steps [s]; ``outputs`` (outputs, steps) and ``inputs`` (inputs, steps) in the
    order and units of the system description; ``states`` (steps + 1, states), from the start on, or empty;
    ``statistics`` counts right-hand sides, indicator calls and events.
    """

    time: np.ndarray
    outputs: np.ndarray
    inputs: np.ndarray
    states: np.ndarray
    statistics: dict[str, int]


class Simulator:
    """Simulates one system again and again: the FMU is loaded once, and each run gets a fresh instance.

    Raises
    ------
    FmuError, SystemDescriptionError
        If the FMU cannot be loaded or does not fit the description.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.fmu = Fmu(system.fmu_path)
        check_system(system, self.fmu)
        self._points = [k for k, o in enumerate(system.outputs) if o.method == "point"]
        self._means = [k for k, o in enumerate(system.outputs) if o.method == "mean"]
        references = {name: v.valueReference for name, v in self.fmu.variables.items()}
        outputs = [references[o.fmu_variable] for o in system.outputs]
        self._vr_points = np.array([outputs[k] for k in self._points], dtype=np.uint32)
        self._vr_means = np.array([outputs[k] for k in self._means], dtype=np.uint32)
        self._vr_inputs = np.array([references[name] for name in system.input_names], dtype=np.uint32)
        self._held = np.array([one.interpolation == "previous" for one in system.inputs], dtype=bool)

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
    ) -> Trajectory:
        """Simulate from ``start`` to ``stop`` and record every ``step`` from ``record_from`` on (all [s]).

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

        Raises
        ------
        SimulationError
            If the end was not reached; data are never short.
        """
        system = self.system
        step = system.experiment.step if step is None else step
        tolerance = system.experiment.tolerance if tolerance is None else tolerance
        record_from = start if record_from is None else record_from
        count = round((stop - record_from) / step)
        grid = record_from + step * np.arange(count + 1, dtype=np.float64)
        table = inputs.restricted(start, stop)
        points = np.full((count + 1, len(self._points)), np.nan)
        quadratures = np.full((count + 1, len(self._means)), np.nan)
        states = np.full((count + 1, self.fmu.n_states), np.nan) if record_states else np.empty((0, 0))
        plan, kept = self._plan(table)
        next_event = self._initialise(parameters, table, start, stop, tolerance, replay, initial_states, plan)
        component = self.fmu.binary.component
        x = np.zeros(self.fmu.n_states)
        nominal = np.ones(self.fmu.n_states)
        double_p = ctypes.POINTER(ctypes.c_double)
        if self.fmu.n_states:
            self.fmu.binary.fmi2GetContinuousStates(component, x.ctypes.data_as(double_p), len(x))
            self.fmu.binary.fmi2GetNominalsOfContinuousStates(component, nominal.ctypes.data_as(double_p), len(x))
        absolute = np.concatenate([tolerance * np.abs(nominal), np.full(len(self._means), _EXCLUDED)])
        cvode = Cvode(plan, start, np.concatenate([x, np.zeros(len(self._means))]), tolerance, absolute)
        reached = np.array([start])
        stops = np.unique(np.concatenate([[0], np.flatnonzero(table.jump), [len(table.time) - 1]])).astype(np.int64)
        try:
            outcome = native.drive(
                plan, cvode.state, stops, table.time, grid, points, quadratures, states, next_event, reached
            )
        finally:
            cvode.close()
            del kept
        if outcome != native.DONE:
            raise SimulationError(self._cause(outcome, plan, reached[0], stop))
        outputs = np.empty((len(system.outputs), count))
        outputs[self._points] = points[1:].T
        outputs[self._means] = (np.diff(quadratures, axis=0) / step).T
        return Trajectory(
            time=grid[1:],
            outputs=outputs,
            inputs=np.where(self._held[:, None], inputs.means(grid).T, inputs.at(grid[1:]).T),
            states=states,
            statistics={
                "right_hand_sides": int(plan[native.RHS_CALLS]),
                "indicator_calls": int(plan[native.INDICATOR_CALLS]),
                "events": int(plan[native.EVENTS]),
            },
        )

    def _plan(self, table: InputTable) -> tuple[np.ndarray, list[np.ndarray]]:
        """The plan without what instance and solver add, and the arrays that it points to."""
        plan = np.zeros(native.PLAN_SIZE, dtype=np.int64)
        for place, function in _FUNCTIONS.items():
            plan[place] = self.fmu.address(function)
        values = np.zeros(max(len(self._vr_inputs), 1))
        arrays: dict[int, np.ndarray] = {
            native.VR_INPUTS: self._vr_inputs,
            native.VR_POINTS: self._vr_points,
            native.VR_MEANS: self._vr_means,
            native.INPUTS: values,
            native.KNOT_TIME: table.time,
            native.KNOT_LEFT: table.left,
            native.KNOT_RIGHT: table.right,
        }
        for place, array in arrays.items():
            plan[place] = array.ctypes.data
        plan[native.N_STATES] = self.fmu.n_states
        plan[native.N_INDICATORS] = self.fmu.n_indicators
        plan[native.N_INPUTS] = len(self._vr_inputs)
        plan[native.N_POINTS] = len(self._points)
        plan[native.N_MEANS] = len(self._means)
        plan[native.N_KNOTS] = len(table.time)
        return plan, list(arrays.values())

    def _initialise(
        self,
        parameters: Mapping[str, float],
        table: InputTable,
        start: float,
        stop: float,
        tolerance: float,
        replay: bool,
        initial_states: np.ndarray | None,
        plan: np.ndarray,
    ) -> np.ndarray:
        """A fresh instance in continuous-time mode at ``start``; returns its next time event [s], shape (1,)."""
        fmu, system = self.fmu, self.system
        try:
            fmu.instantiate()
            binary = fmu.binary
            binary.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)
            for name, value in {**system.fixed, **(system.replay if replay else {}), **parameters}.items():
                fmu.set_value(name, value)
            first = table.at(np.array([start]))[0]
            if len(first):
                binary.setReal(self._vr_inputs.tolist(), first.tolist())
            binary.enterInitializationMode()
            binary.exitInitializationMode()
            next_event = self._settle()
            binary.enterContinuousTimeMode()
            if initial_states is not None:
                x = np.ascontiguousarray(initial_states, dtype=np.float64)
                binary.fmi2SetContinuousStates(
                    binary.component, x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), len(x)
                )
                binary.enterEventMode()
                next_event = self._settle()
                binary.enterContinuousTimeMode()
        except FMICallException as error:
            raise SimulationError(f"{fmu.path.name}: at t = {start:g} s: {error}{fmu.last_words()}") from None
        plan[native.COMPONENT] = plain(ctypes.c_void_p(binary.component))
        return next_event

    def _settle(self) -> np.ndarray:
        for _ in range(native.MAX_EVENT_ITERATIONS):
            needed, terminate, _, _, defined, next_time = self.fmu.binary.newDiscreteStates()
            if terminate:
                raise SimulationError(f"{self.fmu.path.name}: {_CAUSES[native.TERMINATED]} at its start")
            if not needed:
                return np.array([next_time if defined else np.inf])
        raise SimulationError(f"{self.fmu.path.name}: {_CAUSES[native.ENDLESS_EVENT]} at the start")

    def _cause(self, outcome: int, plan: np.ndarray, reached: float, stop: float) -> str:
        if plan[native.STATUS] > 1:
            cause = f"{_FUNCTIONS[int(plan[native.FAILED_CALL])]} returned status {plan[native.STATUS]}"
        else:
            cause = _CAUSES.get(int(outcome), f"CVODE: code {outcome}")
        return f"{self.fmu.path.name}: stopped at t = {reached:g} s of {stop:g} s: {cause}{self.fmu.last_words()}"
