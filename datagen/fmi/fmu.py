"""FMUs: unpacking and loading."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from copy import copy
from functools import lru_cache
from pathlib import Path

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ScalarVariable

from datagen.fmi.fmi2 import Fmi2
from datagen.fmi.fmi3 import Fmi3
from datagen.fmi.interface import Interface
from datagen.fmi.unpacking import check_descriptions, check_identifier, unpack_archive
from datagen.units import UNITLESS
from shared.errors import FmuError, SystemDescriptionError
from shared.places import no_temporary_place
from shared.reading import shown, size_of, why
from shared.store import sha256_of
from shared.watchdog import clean_at_end, watched

SCRATCH = "ZEROSHOT_FMU_SCRATCH"
"""Environment variable of a process that may be killed: a folder that another process clears away afterwards."""
UNSET = ("String", "Binary", "Clock")
"""Types of variables that no description can set: their start values stay."""
MOST_INDICATORS = 1_000_000
"""More than any model has, and few enough to make room for."""


@lru_cache(maxsize=8)
def unpack(path: Path, sha256: str) -> tuple[Path, ModelDescription]:
    """Unpack an FMU once per process into a folder of our own, removed at exit.

    Raises FmuError if the file is missing or is not an FMU.
    """
    size_of(path, FmuError, "an FMU")
    scratch = os.environ.get(SCRATCH)
    place = scratch if scratch and Path(scratch).is_dir() else None
    try:
        folder = Path(tempfile.mkdtemp(prefix="zeroshot-fmu-", dir=place))
    except OSError as error:
        reason = no_temporary_place(error, Path(place) if place else None)
        raise FmuError(f"{path}: cannot be unpacked: {reason}") from None
    clean_at_end(_remove, folder, os.getpid())
    unpack_archive(path, folder)
    try:
        check_descriptions(path, folder)
        return folder, _description(path, folder)
    except FmuError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _remove(folder: Path, process: int) -> None:
    if os.getpid() == process:  # a child that was forked off would take the files from its parent
        shutil.rmtree(folder, ignore_errors=True)


def _description(path: Path, folder: Path) -> ModelDescription:
    try:
        found = fmpy.read_model_description(str(folder), validate=False)
    except Exception as error:  # fmpy raises whatever it meets in a description that is not one
        raise FmuError(f"{path}: not a readable FMU: {why(error)}") from None
    for kind in (found.modelExchange, found.coSimulation):
        if kind is not None:
            check_identifier(path, kind.modelIdentifier)
    if not 0 <= found.numberOfEventIndicators <= MOST_INDICATORS:
        raise FmuError(
            f"{path}: has {shown(found.numberOfEventIndicators)} event indicators; expected 0 to {MOST_INDICATORS}"
        )
    return found


def fmu_sha256(path: Path) -> str:
    """sha256 of an FMU file; an FmuError if it cannot be read."""
    try:
        size_of(path, FmuError, "an FMU")
        return sha256_of(path)
    except OSError as error:
        raise FmuError(f"{path}: cannot be read: {error}") from None


class Fmu:
    """An FMU of FMI 2.0 or 3.0, loaded into this process.

    ``kind``: ``ModelExchange`` or ``CoSimulation``; without, it is Model Exchange if it has that, else Co-Simulation.

    ``variables`` maps names to the model description's variables; ``interface`` calls its functions; ``cosimulation``
    tells the kind, and ``n_states`` is 0 then, for such an FMU keeps its states to itself. ``told_each_step``: the
    integrator's steps are its business too, for it keeps a history of them (a delay, a plug flow). Raises FmuError if
    it is of another version or kind, or has no binary for this platform.
    """

    def __init__(self, path: Path, kind: str | None = None) -> None:
        self.path = path
        self.sha256 = fmu_sha256(path)
        folder, self.description = unpack(path, self.sha256)
        if kind is not None:
            self.description = _only(kind, self.description, path)
        version = str(self.description.fmiVersion)
        if version != "2.0" and not version.startswith("3."):
            raise FmuError(f"{path}: FMI {version}; expected FMI 2.0 or 3.0")
        if self.description.modelExchange is None and self.description.coSimulation is None:
            raise FmuError(f"{path}: FMI {version} without Model Exchange or Co-Simulation; expected one of the two")
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}
        with watched(str(path)):
            self.interface: Interface = (Fmi2 if version == "2.0" else Fmi3)(path, folder, self.description)
        self.cosimulation = self.interface.cosimulation
        self.n_states = 0 if self.cosimulation else self.description.numberOfContinuousStates
        self.n_indicators = 0 if self.cosimulation else self.description.numberOfEventIndicators
        me = self.description.modelExchange
        self.told_each_step = not self.cosimulation and bool(me.needsCompletedIntegratorStep)
        self.seconds_to_instantiate = 0.0

    def instantiate(self, *, reuse: bool = False) -> None:
        """Make a fresh instance in place of the last one, or reset that one.

        Parameters
        ----------
        reuse
            Reset the living instance, if there is one; see :mod:`datagen.simulating.canary`.
        """
        if reuse and self.interface.instance:
            try:
                self.interface.binary.reset()
                self.interface.begin()
                return
            except FMICallException:  # it failed before and does not come back: start afresh
                pass
        self.release()
        self.interface.begin()
        began = time.perf_counter()
        try:
            self.interface.instantiate()
        except Exception as error:
            raise FmuError(f"{self.path}: cannot be instantiated: {error}{self.last_words()}") from None
        self.seconds_to_instantiate = time.perf_counter() - began

    def release(self) -> None:
        """Free the instance, if there is one."""
        if self.interface.instance:
            self.interface.free()

    def last_words(self) -> str:
        """The FMU's own last messages, for an error's text."""
        said = self.interface.last_words()
        return f"; the FMU says: {said}" if said else ""

    def set_value(self, name: str, value: float | bool) -> None:
        """Set a number or a boolean by name."""
        variable = self.variables[name]
        if wrong := value_fault(variable, value):
            raise SystemDescriptionError(f"{self.path}: {name!r} {wrong}")
        if not self.interface.set_value(variable, value):
            what = f"an array of {variable.type}" if variable.shape else f"a {variable.type}"
            raise SystemDescriptionError(f"{self.path}: {name!r} is {what}; expected a number or a boolean")

    def is_float(self, name: str) -> bool:
        """Whether a variable is a scalar double."""
        variable = self.variables[name]
        return variable.type in ("Real", "Float64") and not variable.shape


def _only(kind: str, description: ModelDescription, path: Path) -> ModelDescription:
    """A model description as if its FMU were of one kind alone."""
    one = copy(description)
    if kind == "CoSimulation":
        one.modelExchange = None
        found, other = one.coSimulation, "ModelExchange"
    else:
        one.coSimulation = None
        found, other = one.modelExchange, "CoSimulation"
    if found is None:
        raise FmuError(f"{path}: is no FMU of kind {kind!r}; expected kind = {other!r}, or none")
    return one


def value_fault(variable: ScalarVariable, value: float | bool) -> str:
    """Why a variable cannot hold a value, to follow its name; empty if it can, or is neither a number nor a boolean."""
    if variable.type == "Boolean":
        return "" if value in (0, 1) else f"is set to {value:g} and is a Boolean; expected true or false"
    kind = _WHOLE.get(str(variable.type))
    if kind is None:
        return ""
    low, high = kind
    if float(value).is_integer() and low <= value <= high:
        return ""
    article = "an" if str(variable.type)[0] in "IE" else "a"
    return f"is set to {value:g} and is {article} {variable.type}; expected a whole number from {low} to {high}"


_WHOLE = {
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    **dict.fromkeys(("Integer", "Enumeration"), (-(2**31), 2**31 - 1)),
}
"""Types of whole numbers, and the first and last that each holds."""


def unit_of(variable: ScalarVariable) -> str:
    """Unit of an FMU's variable, or of its declared type; ``1`` where it has none, or says that it is a pure number."""
    unit = variable.unit or getattr(variable.declaredType, "unit", None) or ""
    return "1" if unit in UNITLESS else unit


def is_difference(variable: ScalarVariable) -> bool:
    """Whether an FMU says of a variable, or of its declared type, that it is a difference: 20 K is no -253 degC."""
    return bool(variable.relativeQuantity or getattr(variable.declaredType, "relativeQuantity", False))


def start_of(variable: ScalarVariable) -> str:
    """The start value of a variable as a description would write it; 0 or false where the FMU states none."""
    if variable.type == "Boolean":
        return "true" if str(variable.start).lower() in ("true", "1") else "false"
    return str(variable.start) if variable.start not in (None, "") else "0"
