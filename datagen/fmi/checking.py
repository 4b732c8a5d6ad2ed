"""A system description held against what its FMU really has."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence

import numpy as np
from fmpy.model_description import ScalarVariable

from datagen.fmi.baselines import check_effects
from datagen.fmi.fmu import UNITLESS, Fmu, unit_of, value_fault
from shared.errors import FmuError, SystemDescriptionError
from shared.possible import in_another_unit
from shared.reading import shown
from shared.system import System


def check_system(system: System, fmu: Fmu) -> None:
    """Hold a system description against its FMU.

    Raises
    ------
    SystemDescriptionError
        For the first variable that the FMU lacks, or that has another causality, type or unit there; or for an effect
        that at an amplitude of zero is not the base model.
    """
    where = f"{system.path}"
    real = "Real" if fmu.interface.version == 2 else "Float64"

    def variable(kind: str, name: str) -> ScalarVariable:
        if name not in fmu.variables:
            raise SystemDescriptionError(
                f"{where}: {kind} {name!r} is not a variable of {fmu.path.name}{_similar(name, list(fmu.variables))}"
            )
        return fmu.variables[name]

    def unit(kind: str, name: str, declared: str) -> None:
        found = unit_of(variable(kind, name))
        if found != ("1" if declared in UNITLESS else declared):
            raise SystemDescriptionError(f"{where}: {kind} {name!r} is declared in {declared!r}; the FMU has {found!r}")

    for parameter in system.parameters:
        unit("parameter", parameter.name, parameter.unit)
        found = variable("parameter", parameter.name)
        if found.causality not in ("parameter", "input") or not fmu.is_float(parameter.name):
            raise SystemDescriptionError(
                f"{where}: parameter {parameter.name!r} is a {found.causality} {_type(found)} in "
                f"{fmu.path.name}; expected a {real} parameter that can be set"
            )
        if not _is_difference(found) and (wrong := in_another_unit([parameter.min, parameter.max], parameter.unit)):
            raise SystemDescriptionError(
                f"{where}: parameter {parameter.name!r}: its range {wrong} (a difference of temperatures has"
                f' relativeQuantity="true" in {fmu.path.name})'
            )
    for one in system.inputs:
        unit("input", one.name, one.unit)
        found = variable("input", one.name)
        if found.causality != "input" or not fmu.is_float(one.name):
            raise SystemDescriptionError(
                f"{where}: input {one.name!r} is a {found.causality} {_type(found)} in {fmu.path.name}; "
                f"expected a {real} input"
            )
        if found.variability == "discrete" and one.interpolation == "linear" and one.source != "constant":
            raise SystemDescriptionError(
                f'{where}: input {one.name!r} is discrete in {fmu.path.name}; expected interpolation = "previous"'
            )
    declared = {*system.input_names, *system.parameter_names, *system.fixed}
    for name, found in fmu.variables.items():
        if found.causality == "input" and name not in declared:
            raise SystemDescriptionError(
                f"{where}: {fmu.path.name} has an input {name!r} that no [[inputs]] table names; expected one, or"
                " its value under [fixed]"
            )
    for output in system.outputs:
        unit("output", output.fmu_variable, output.unit)
        if not fmu.is_float(output.fmu_variable):
            kind = _type(fmu.variables[output.fmu_variable])
            raise SystemDescriptionError(
                f"{where}: output {output.name!r} is not a {real} but a {kind} in {fmu.path.name}"
            )
    for table, values in (("fixed", system.fixed), ("replay", system.replay)):
        if wrong := set_fault(table, values, system, fmu):
            raise SystemDescriptionError(f"{where}: {wrong}")
    for uncertain in system.uncertain:
        for name in uncertain.parameters:
            found = variable(f"uncertain {uncertain.name!r}:", name)
            value = system.fixed.get(name, found.start if fmu.is_float(name) else None)
            stays = name in system.fixed and value == 0
            if found.causality not in ("parameter", "input") or value is None or not (stays or float(value) > 0):
                raise SystemDescriptionError(
                    f"{where}: uncertain {uncertain.name!r}: {name!r} is a {found.causality} {_type(found)} with value"
                    f" {value} in {fmu.path.name}; expected a positive {real} parameter that can be set: give it"
                    " a value under [fixed], or leave it out of this table"
                )
    check_effects(system, fmu)


def set_fault(table: str, values: Mapping[str, float | bool], system: System, fmu: Fmu) -> str:
    """What is wrong with FMU parameters that a table sets, as a sentence about the table; empty if nothing is."""
    for name, given in values.items():
        if name not in fmu.variables:
            return f"{table} {name!r} is not a variable of {fmu.path.name}{_similar(name, list(fmu.variables))}"
        found = fmu.variables[name]
        if found.causality not in ("parameter", "input"):
            return f"{table} {name!r} cannot be set in {fmu.path.name}"
        if name in system.input_names:
            return f"{table} {name!r} is one of [[inputs]], which drives it; expected it in one of the two"
        if wrong := value_fault(found, given):
            return f"{table} {name!r} {wrong}"
    return ""


def fmu_of(system: System) -> Fmu:
    """The FMU that a description names.

    Raises
    ------
    FmuError
        If it is not there, as in a description that was copied without it, or cannot be loaded.
    """
    if not system.fmu_path.exists():
        raise FmuError(
            f"{system.path}: fmu is {shown(system.fmu)}, but {system.fmu_path} is not there; expected where the FMU"
            " lies, as seen from the description's folder"
        )
    return Fmu(system.fmu_path)


def check_held(system: System, fmu: Fmu, names: Sequence[str], left: np.ndarray, right: np.ndarray) -> None:
    """Refuse what changes a discrete input on straight lines: such are set at events alone, and would be stale.

    Parameters
    ----------
    names, left, right
        Of the discrete inputs; their values at both ends of each stretch between two knots, shapes (stretches, inputs).

    Raises
    ------
    SystemDescriptionError
        Naming the first.
    """
    bent = (left != right).any(axis=0)
    if bent.any():
        name = names[int(np.argmax(bent))]
        raise SystemDescriptionError(
            f"{system.path}: input {name!r} is discrete in {fmu.path.name}, and what drives it changes on straight"
            ' lines; expected interpolation = "previous"'
        )


def _is_difference(variable: ScalarVariable) -> bool:
    """Whether an FMU says of a variable, or of its declared type, that it is a difference: 20 K is no -253 degC."""
    return bool(variable.relativeQuantity or getattr(variable.declaredType, "relativeQuantity", False))


def _similar(name: str, names: list[str]) -> str:
    close = difflib.get_close_matches(name, names, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; it has {len(names)} others"


def _type(variable: ScalarVariable) -> str:
    return f"array of {variable.type}" if variable.shape else str(variable.type)
