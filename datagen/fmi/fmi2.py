"""FMI 2.0, Model Exchange and Co-Simulation."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy.fmi2
import numpy as np
from fmpy.model_description import ModelDescription, ScalarVariable

from datagen.fmi import calls
from datagen.fmi.interface import DOUBLE_P, Interface, text_of

_MODEL_EXCHANGE = {
    calls.SET_TIME: "fmi2SetTime",
    calls.SET_STATES: "fmi2SetContinuousStates",
    calls.GET_STATES: "fmi2GetContinuousStates",
    calls.GET_DERIVATIVES: "fmi2GetDerivatives",
    calls.GET_INDICATORS: "fmi2GetEventIndicators",
    calls.ENTER_EVENT: "fmi2EnterEventMode",
    calls.NEW_DISCRETE: "fmi2NewDiscreteStates",
    calls.ENTER_CONTINUOUS: "fmi2EnterContinuousTimeMode",
    calls.STEP_DONE: "fmi2CompletedIntegratorStep",
}
_COMMON = {calls.SET_REAL: "fmi2SetReal", calls.GET_REAL: "fmi2GetReal"}

_KEPT: list[Any] = []
_SPEAKERS: weakref.WeakValueDictionary[str, Interface] = weakref.WeakValueDictionary()
"""Each living FMU by its instance's name."""


@lru_cache(maxsize=1)
def _callbacks() -> fmpy.fmi2.fmi2CallbackFunctions:
    """One set of callbacks for the whole process, never freed.

    The proxy that formats the FMU's messages remembers a single logger for the process: one that belonged to an
    instance would be called after that instance is gone.
    """

    def logger(_: Any, instance: bytes | None, status: int, category: bytes | None, message: bytes | None) -> None:
        speaker = _SPEAKERS.get(text_of(instance)) or (Interface.latest and Interface.latest())
        if speaker:
            speaker.hear(status, category, message)

    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(logger)
    callbacks.allocateMemory = fmpy.fmi2.defaultCallbacks.allocateMemory
    callbacks.freeMemory = fmpy.fmi2.defaultCallbacks.freeMemory
    _KEPT.append(callbacks.logger)
    fmpy.fmi2.addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


class Fmi2(Interface):
    """An FMU of FMI 2.0."""

    version = 2

    def __init__(self, path: Path, folder: Path, description: ModelDescription) -> None:
        super().__init__(path, folder, description)
        self.functions = _COMMON | ({calls.DO_STEP: "fmi2DoStep"} if self.cosimulation else _MODEL_EXCHANGE)
        if self.cosimulation and description.coSimulation.canInterpolateInputs:
            self.functions = self.functions | {calls.SET_SLOPES: "fmi2SetRealInputDerivatives"}
        _SPEAKERS[self.name] = self

    def load(self, **arguments: str) -> Any:
        """Load the shared library through fmpy."""
        return fmpy.fmi2.FMU2Slave(**arguments) if self.cosimulation else fmpy.fmi2.FMU2Model(**arguments)

    def instantiate(self) -> None:
        """Make an instance."""
        self.binary.instantiate(callbacks=_callbacks(), loggingOn=True)

    def free(self) -> None:
        """Free the instance."""
        self.binary.fmi2FreeInstance(self.binary.component)
        self.binary.component = None

    def set_up(self, start: float, stop: float, tolerance: float) -> None:
        """Announce the simulation."""
        self.binary.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)

    def enter_initialisation(self) -> None:
        """Enter initialisation mode."""
        self.binary.enterInitializationMode()

    def set_floats(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set Reals."""
        self.binary.setReal(references, values)

    def set_value(self, variable: ScalarVariable, value: float | bool) -> bool:
        """Set a Real, Integer, Enumeration or Boolean."""
        if variable.type == "Real":
            self.binary.setReal([variable.valueReference], [float(value)])
        elif variable.type in ("Integer", "Enumeration"):
            self.binary.setInteger([variable.valueReference], [int(value)])
        elif variable.type == "Boolean":
            self.binary.setBoolean([variable.valueReference], [bool(value)])
        else:
            return False
        return True

    def new_discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """One iteration of event mode."""
        flags: tuple[bool, bool, bool, bool, bool, float] = self.binary.newDiscreteStates()
        return flags

    def states(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Continuous states and their nominal values."""
        x, nominal = np.zeros(n), np.ones(n)
        self.binary.fmi2GetContinuousStates(self.binary.component, x.ctypes.data_as(DOUBLE_P), n)
        self.binary.fmi2GetNominalsOfContinuousStates(self.binary.component, nominal.ctypes.data_as(DOUBLE_P), n)
        return x, nominal

    def set_states(self, x: np.ndarray) -> None:
        """Set the continuous states."""
        self.binary.fmi2SetContinuousStates(self.binary.component, x.ctypes.data_as(DOUBLE_P), len(x))

    def why_discarded(self) -> str:
        """Whether the FMU wants to end, and how far it came."""
        try:
            ended = self.binary.getBooleanStatus(3)  # fmi2Terminated
            reached = self.binary.getRealStatus(2)  # fmi2LastSuccessfulTime
        except Exception:  # an FMU need not have an answer
            return ""
        return f"; the FMU {'asked to terminate' if ended else 'came'} at t = {reached:g} s"
