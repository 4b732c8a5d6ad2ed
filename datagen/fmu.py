"""FMUs: unpacking, loading, and holding a system description against what the FMU really has."""

from __future__ import annotations

import atexit
import ctypes
import os
import shutil
import tempfile
import weakref
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
from fmpy.model_description import ModelDescription, ScalarVariable

from shared.errors import FmuError, SystemDescriptionError
from shared.store import sha256_of
from shared.system import System

_UNITLESS = {"", "1", "-"}


@lru_cache(maxsize=8)
def unpack(path: Path, sha256: str) -> tuple[Path, ModelDescription]:
    """Unpack an FMU once per process into a folder of our own, removed at exit.

    Raises
    ------
    FmuError
        If the file is missing or is not an FMU.
    """
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except FileNotFoundError:
        raise FmuError(f"{path}: no such file; expected an FMU") from None
    except Exception as error:  # fmpy raises bare exceptions of many kinds for broken archives
        raise FmuError(f"{path}: not a readable FMU: {error}") from None
    folder = Path(tempfile.mkdtemp(prefix="zeroshot-fmu-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    try:
        fmpy.extract(str(path), unzipdir=str(folder))
    except Exception as error:
        raise FmuError(f"{path}: cannot be unpacked: {error}") from None
    return folder, description


def fmu_sha256(path: Path) -> str:
    """sha256 of an FMU file.

    Raises
    ------
    FmuError
        If it cannot be read.
    """
    try:
        return sha256_of(path)
    except FileNotFoundError:
        raise FmuError(f"{path}: no such file; expected an FMU") from None
    except OSError as error:
        raise FmuError(f"{path}: cannot be read: {error}") from None


_NUMBERS = count(1)
_KEPT: list[Any] = []
_LOGS: dict[str, list[str]] = {}
"""What each living instance has said, by its name."""


@lru_cache(maxsize=1)
def _callbacks() -> fmpy.fmi2.fmi2CallbackFunctions:
    """One set of callbacks for the whole process, never freed.

    The proxy that formats the FMU's messages remembers a single logger for the process: one that belonged to an
    instance would be called after that instance is gone.
    """

    def logger(_environment: Any, instance: bytes, status: int, _category: Any, message: bytes) -> None:
        if status > 0:
            _LOGS.get(instance.decode(), []).append(message.decode("utf-8", "replace"))

    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(logger)
    callbacks.allocateMemory = fmpy.fmi2.defaultCallbacks.allocateMemory
    callbacks.freeMemory = fmpy.fmi2.defaultCallbacks.freeMemory
    _KEPT.append(callbacks.logger)
    fmpy.fmi2.addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


class Fmu:
    """An FMI 2.0 Model Exchange FMU, loaded into this process.

    ``variables`` maps names to the model description's variables; ``log`` collects what the FMU says.

    Raises
    ------
    FmuError
        If there is no Model Exchange interface or no binary for this platform.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.sha256 = fmu_sha256(path)
        folder, self.description = unpack(path, self.sha256)
        if self.description.fmiVersion != "2.0" or self.description.modelExchange is None:
            raise FmuError(
                f"{path}: FMI {self.description.fmiVersion} without Model Exchange 2.0; expected FMI 2.0 Model Exchange"
            )
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}
        self.log: list[str] = []
        name = f"instance-{next(_NUMBERS)}"
        _LOGS[name] = self.log
        weakref.finalize(self, _LOGS.pop, name, None)
        before = os.getcwd()
        try:
            self.binary: Any = fmpy.fmi2.FMU2Model(
                guid=self.description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=self.description.modelExchange.modelIdentifier,
                instanceName=name,
            )
        except Exception as error:
            raise FmuError(f"{path}: no usable binary for {fmpy.platform}: {error}") from None
        finally:
            os.chdir(before)  # fmpy's constructor changes the working directory
        self.n_states = self.description.numberOfContinuousStates
        self.n_indicators = self.description.numberOfEventIndicators

    def address(self, function: str) -> int:
        """Address of one of the FMU's C functions, for example ``fmi2GetReal``."""
        return ctypes.cast(getattr(self.binary.dll, function), ctypes.c_void_p).value or 0

    def instantiate(self) -> None:
        """Make a fresh instance in place of the last one; ``binary.component`` is its address."""
        self.release()
        self.log.clear()
        try:
            self.binary.instantiate(callbacks=_callbacks(), loggingOn=True)
        except Exception as error:
            raise FmuError(f"{self.path}: cannot be instantiated: {error}{self.last_words()}") from None

    def release(self) -> None:
        """Free the instance, if there is one."""
        if getattr(self.binary, "component", None) is not None:
            self.binary.fmi2FreeInstance(self.binary.component)
            self.binary.component = None

    def last_words(self) -> str:
        """The FMU's own last messages, for an error's text."""
        return f"; the FMU says: {' | '.join(self.log[-3:])}" if self.log else ""

    def set_value(self, name: str, value: float | bool) -> None:
        """Set a Real, Integer or Boolean variable by name."""
        variable = self.variables[name]
        if variable.type == "Real":
            self.binary.setReal([variable.valueReference], [float(value)])
        elif variable.type in ("Integer", "Enumeration"):
            self.binary.setInteger([variable.valueReference], [int(value)])
        elif variable.type == "Boolean":
            self.binary.setBoolean([variable.valueReference], [bool(value)])
        else:
            raise SystemDescriptionError(f"{self.path}: {name!r} is a {variable.type}; expected a number or a boolean")


def _unit(variable: ScalarVariable) -> str:
    unit = variable.unit or getattr(variable.declaredType, "unit", None) or ""
    return "1" if unit in _UNITLESS else unit


def check_system(system: System, fmu: Fmu) -> None:
    """Hold a system description against its FMU.

    Raises
    ------
    SystemDescriptionError
        For the first variable that the FMU lacks, or that has another causality, type or unit there.
    """
    where = f"{system.path}"

    def variable(kind: str, name: str) -> ScalarVariable:
        if name not in fmu.variables:
            raise SystemDescriptionError(
                f"{where}: {kind} {name!r} is not a variable of {fmu.path.name}{_similar(name, list(fmu.variables))}"
            )
        return fmu.variables[name]

    def unit(kind: str, name: str, declared: str) -> None:
        found = _unit(variable(kind, name))
        if found != ("1" if declared in _UNITLESS else declared):
            raise SystemDescriptionError(f"{where}: {kind} {name!r} is declared in {declared!r}; the FMU has {found!r}")

    for parameter in system.parameters:
        unit("parameter", parameter.name, parameter.unit)
        found = variable("parameter", parameter.name)
        if found.causality not in ("parameter", "input") or found.type != "Real":
            raise SystemDescriptionError(
                f"{where}: parameter {parameter.name!r} is a {found.causality} {found.type} in {fmu.path.name}; "
                "expected a Real parameter that can be set"
            )
    for one in system.inputs:
        unit("input", one.name, one.unit)
        found = variable("input", one.name)
        if found.causality != "input" or found.type != "Real":
            raise SystemDescriptionError(
                f"{where}: input {one.name!r} is a {found.causality} {found.type} in {fmu.path.name}; "
                "expected a Real input"
            )
    declared = set(system.input_names) | set(system.parameter_names)
    for name, found in fmu.variables.items():
        if found.causality == "input" and name not in declared:
            raise SystemDescriptionError(
                f"{where}: {fmu.path.name} has an input {name!r} that no [[inputs]] table names; expected one"
            )
    for output in system.outputs:
        unit("output", output.fmu_variable, output.unit)
        if variable("output", output.fmu_variable).type != "Real":
            raise SystemDescriptionError(f"{where}: output {output.name!r} is not a Real in {fmu.path.name}")
    for table, values in (("fixed", system.fixed), ("replay", system.replay)):
        for name in values:
            if variable(table, name).causality not in ("parameter", "input"):
                raise SystemDescriptionError(f"{where}: {table} {name!r} cannot be set in {fmu.path.name}")


def _similar(name: str, names: list[str]) -> str:
    import difflib

    close = difflib.get_close_matches(name, names, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; it has {len(names)} others"
