"""Warm-ups that are shared: runs that differ in the recording only begin it from the same states.

Most simulations of a fit differ in a pulse somewhere in the recording; what came before, which is often longer, is the
same. So every run is made in two parts, and the states between them are remembered. As all runs are cut there, an
outcome does not depend on what was remembered.

Continuous states are all that is handed over. An FMU with discrete variables may remember more, and so may one that
hides what it remembers: the former is never cut, and of every other the first run is made both ways.
"""

from __future__ import annotations

from collections import OrderedDict
from hashlib import blake2b
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from datagen.driving.tables import InputTable
from datagen.simulating.simulator import Simulator, Trajectory
from diagnosis.fitting.run import Run
from shared.errors import SimulationError

STATES = 64
"""States that are remembered: of so many parameters and pasts, the latest."""
SAME = 0.5
"""Difference between a run in two parts and one in one part that is the integrator's own [accuracy of the output]."""
ALIKE = 0.9
"""Share of the steps of each output that must be the same. Not all: a limiter's event moves by a moment now and then.
In the default room nine steps in ten agree to 0.03 of the accuracy, so it does not matter which run comes first."""


class Warmed:
    """Runs of one simulator; ``cut`` is None until the first run has told whether they can be cut."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        fmu = simulator.fmu
        remembers = fmu.cosimulation or not fmu.n_states or any(_discrete(one) for one in fmu.variables.values())
        self.cut: bool | None = False if remembers else None
        self._states: OrderedDict[bytes, np.ndarray] = OrderedDict()

    def outputs(self, run: Run) -> np.ndarray:
        """Outputs of a run, shape (outputs, steps) [unit of each].

        Raises
        ------
        SimulationError
            If the end was not reached.
        """
        if self.cut is False or run.record_from <= run.start:
            return self._whole(run)
        found = self._parts(run)
        if self.cut is None:
            whole = self._whole(run)
            apart = np.quantile(np.abs(found - whole), ALIKE, axis=1)
            self.cut = bool((apart <= SAME * np.array([one.accuracy for one in self.simulator.system.outputs])).all())
            if not self.cut:
                return whole
        return found

    def _simulated(self, run: Run, inputs: InputTable, **span: Any) -> Trajectory:
        span |= {"replay": run.replay, "tolerance": run.tolerance, "driven": False}
        return self.simulator.run(run.parameters, inputs, **span)

    def _whole(self, run: Run) -> np.ndarray:
        span = {"start": run.start, "stop": run.stop, "record_from": run.record_from}
        return self._simulated(run, run.inputs, **span).outputs

    def _parts(self, run: Run) -> np.ndarray:
        before = run.inputs.restricted(run.start, run.record_from)
        key = blake2b(digest_size=16)
        key.update(repr((sorted(run.parameters.items()), before.names, run.replay, run.tolerance)).encode())
        for values in (before.time, before.left, before.right, before.jump):
            key.update(values.tobytes())
        states = self._states.get(key.digest())
        if states is None:
            span = {"start": run.start, "stop": run.record_from, "step": run.record_from - run.start}
            states = self._simulated(run, before, **span, record_states=True).states[-1]
            if not np.isfinite(states).all():
                raise SimulationError("states at the start of the recording are not finite; expected numbers")
            self._states[key.digest()] = states
            if len(self._states) > STATES:
                self._states.popitem(last=False)
        return self._simulated(run, run.inputs, start=run.record_from, stop=run.stop, initial_states=states).outputs


_KNOWN: WeakKeyDictionary[Simulator, Warmed] = WeakKeyDictionary()


def warmed(simulator: Simulator) -> Warmed:
    """The simulator's runs, with what it remembers."""
    if simulator not in _KNOWN:
        _KNOWN[simulator] = Warmed(simulator)
    return _KNOWN[simulator]


def _discrete(variable: object) -> bool:
    return getattr(variable, "variability", None) == "discrete" and getattr(variable, "causality", None) != "input"
