"""FMI 3.0, Model Exchange and Co-Simulation.

Co-Simulation is run without event mode and without early return: the FMU handles its events within a step.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy.fmi3
import numpy as np
from fmpy.model_description import ModelDescription, ScalarVariable

from datagen.fmi import calls
from datagen.fmi.interface import DOUBLE_P, Interface

_MODEL_EXCHANGE = {
    calls.SET_TIME: "fmi3SetTime",
    calls.SET_STATES: "fmi3SetContinuousStates",
    calls.GET_STATES: "fmi3GetContinuousStates",
    calls.GET_DERIVATIVES: "fmi3GetContinuousStateDerivatives",
    calls.GET_INDICATORS: "fmi3GetEventIndicators",
    calls.ENTER_EVENT: "fmi3EnterEventMode",
    calls.NEW_DISCRETE: "fmi3UpdateDiscreteStates",
    calls.ENTER_CONTINUOUS: "fmi3EnterContinuousTimeMode",
    calls.STEP_DONE: "fmi3CompletedIntegratorStep",
}
_COMMON = {calls.SET_REAL: "fmi3SetFloat64", calls.GET_REAL: "fmi3GetFloat64"}
_NUMBERS = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")


class Fmi3(Interface):
    """An FMU of FMI 3.0."""

    version = 3

    def __init__(self, path: Path, folder: Path, description: ModelDescription) -> None:
        super().__init__(path, folder, description)
        self.functions = _COMMON | ({calls.DO_STEP: "fmi3DoStep"} if self.cosimulation else _MODEL_EXCHANGE)
        me = weakref.ref(self)

        def logger(_: Any, status: int, category: bytes | None, message: bytes | None) -> None:
            if speaker := me():
                speaker.hear(status, category, message)

        self._logger = logger
        self._experiment: dict[str, float] = {}

    def load(self, **arguments: str) -> Any:
        """Load the shared library through fmpy."""
        return fmpy.fmi3.FMU3Slave(**arguments) if self.cosimulation else fmpy.fmi3.FMU3Model(**arguments)

    def instantiate(self) -> None:
        """Make an instance."""
        self.binary.instantiate(loggingOn=True, logMessage=self._logger)

    def free(self) -> None:
        """Free the instance."""
        self.binary.fmi3FreeInstance(self.binary.component)
        self.binary.component = None

    def set_up(self, start: float, stop: float, tolerance: float) -> None:
        """Remember what FMI 3.0 wants to know on entering initialisation mode."""
        self._experiment = {"startTime": start, "stopTime": stop, "tolerance": tolerance}

    def enter_initialisation(self) -> None:
        """Enter initialisation mode."""
        self.binary.enterInitializationMode(**self._experiment)

    def set_floats(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set Float64s."""
        self.binary.setFloat64(references, values)

    def set_value(self, variable: ScalarVariable, value: float | bool) -> bool:
        """Set a scalar number or Boolean."""
        references = [variable.valueReference]
        if variable.shape:
            return False
        if variable.type in ("Float64", "Float32"):
            getattr(self.binary, f"set{variable.type}")(references, [float(value)])
        elif variable.type in _NUMBERS:
            getattr(self.binary, f"set{variable.type}")(references, [int(value)])
        elif variable.type == "Enumeration":
            self.binary.setInt64(references, [int(value)])
        elif variable.type == "Boolean":
            self.binary.setBoolean(references, [bool(value)])
        else:
            return False
        return True

    def new_discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """One iteration of event mode."""
        flags: tuple[bool, bool, bool, bool, bool, float] = self.binary.updateDiscreteStates()
        return flags

    def states(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Continuous states and their nominal values."""
        x, nominal = np.zeros(n), np.ones(n)
        self.binary.getContinuousStates(x.ctypes.data_as(DOUBLE_P), n)
        self.binary.getNominalsOfContinuousStates(nominal.ctypes.data_as(DOUBLE_P), n)
        return x, nominal

    def set_states(self, x: np.ndarray) -> None:
        """Set the continuous states."""
        self.binary.setContinuousStates(x.ctypes.data_as(DOUBLE_P), len(x))
