"""An FMU's instance before and after a simulation: how it gets ready, and the words for how it failed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from fmpy.fmi1 import FMICallException

from datagen.fmi import calls
from datagen.fmi.fmu import Fmu
from shared.errors import SimulationError

_CAUSES = {
    calls.TERMINATED: "the FMU asked to terminate",
    calls.ENDLESS_EVENT: "events without end",
    calls.NOT_FINITE: "an output is not finite",
    calls.CUT_SHORT: "the FMU returned early from a step",
    -1: "CVODE: too many steps between two outputs; expected fewer: a shorter experiment.step, or a larger tolerance",
    -2: "CVODE: accuracy beyond the machine's",
    -3: "CVODE: error test failed repeatedly",
    -4: "CVODE: corrector did not converge",
    -8: "CVODE: the right-hand side failed",
    -12: "CVODE: the event indicators failed",
}
_DISCARD = 2


def initialise(
    fmu: Fmu,
    values: Mapping[str, float | bool],
    inputs: tuple[list[int], list[float]],
    *,
    start: float,
    stop: float,
    tolerance: float,
    initial_states: np.ndarray | None,
    reuse: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make a clean instance, ready to integrate or step at ``start``; ``reuse`` resets the living one.

    ``inputs`` are references and values of the inputs at the start. Returns its next time event [s], shape (1,), and
    its continuous states and their nominal values, shape (states,). Raises FmuError if the FMU cannot be instantiated;
    SimulationError if it fails, or wants to end, before the simulation has begun.
    """
    try:
        fmu.instantiate(reuse=reuse)
        interface = fmu.interface
        interface.set_up(start, stop, tolerance)
        floats = {name: value for name, value in values.items() if fmu.is_float(name)}
        if floats:  # in one call: an FMU may have hundreds
            interface.set_floats([fmu.variables[name].valueReference for name in floats], list(floats.values()))
        for name, value in values.items():
            if name not in floats:
                fmu.set_value(name, value)
        if inputs[0]:
            interface.set_floats(*inputs)
        interface.enter_initialisation()
        if inputs[0]:
            interface.set_floats(*inputs)
        interface.binary.exitInitializationMode()
        if fmu.cosimulation:
            return np.array([np.inf]), np.empty(0), np.empty(0)
        next_event = _settle(fmu)
        interface.binary.enterContinuousTimeMode()
        if initial_states is not None:
            interface.set_states(np.ascontiguousarray(initial_states, dtype=np.float64))
            interface.binary.enterEventMode()
            next_event = _settle(fmu)
            interface.binary.enterContinuousTimeMode()
        states = interface.states(fmu.n_states) if fmu.n_states else (np.empty(0), np.empty(0))
    except FMICallException as error:
        raise SimulationError(f"{fmu.path.name}: at t = {start:g} s: {error}{fmu.last_words()}") from None
    return next_event, *states


def _settle(fmu: Fmu) -> np.ndarray:
    for _ in range(calls.MAX_EVENT_ITERATIONS):
        needed, terminate, _, _, defined, next_time = fmu.interface.new_discrete_states()
        if terminate:
            raise SimulationError(f"{fmu.path.name}: {_CAUSES[calls.TERMINATED]} at its start{fmu.last_words()}")
        if not needed:
            return np.array([next_time if defined else np.inf])
    raise SimulationError(f"{fmu.path.name}: {_CAUSES[calls.ENDLESS_EVENT]} at the start{fmu.last_words()}")


def cause(fmu: Fmu, outcome: int, plan: np.ndarray, reached: float, stop: float, timeout: float) -> str:
    """One sentence for a simulation that did not reach its end, with the FMU's own last words."""
    if plan[calls.EXPIRED]:
        why = f"timed out after {timeout:g} s; expected its end by then, or a longer timeout"
    elif plan[calls.STATUS] > 1:
        failed = int(plan[calls.FAILED_CALL])
        why = f"{fmu.interface.functions[failed]} returned status {plan[calls.STATUS]}"
        if failed == calls.DO_STEP and plan[calls.STATUS] == _DISCARD:
            why += fmu.interface.why_discarded()
    else:
        why = _CAUSES.get(int(outcome), f"CVODE: code {outcome}")
    return f"{fmu.path.name}: stopped at t = {reached:g} s of {stop:g} s: {why}{fmu.last_words()}"
