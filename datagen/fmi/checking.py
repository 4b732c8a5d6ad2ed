"""A system description held against what its FMU really has."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence

import numpy as np
from fmpy.model_description import ScalarVariable

from datagen.fmi.baselines import check_effects
from datagen.fmi.fmu import UNSET, Fmu, is_difference, start_of, unit_of, value_fault
from datagen.units import Conversion, conversion
from shared.errors import FmuError, SystemDescriptionError
from shared.given import Given
from shared.possible import in_another_unit
from shared.reading import shown
from shared.system import System
from shared.variables import FmuVariable, Input, Output, Parameter, Uncertain


def check_system(system: System, fmu: Fmu) -> None:
    """Hold a system description against its FMU, and say all that is wrong with it at once.

    Raises SystemDescriptionError for variables that the FMU lacks, or that have another causality, type or kind of unit
    there; inputs that nothing drives; effects that at an amplitude of zero are not the base model.
    """
    faults = [
        *(fault for one in system.parameters for fault in _parameter_faults(one, fmu)),
        *(fault for one in system.inputs for fault in _input_faults(one, fmu)),
        *_undriven(system, fmu),
        *(fault for one in system.outputs for fault in _output_faults(one, fmu)),
        *set_faults("fixed", system.fixed, system, fmu),
        *set_faults("replay", system.replay, system, fmu),
        *(fault for one in system.uncertain for fault in _uncertain_faults(one, system, fmu)),
        *(fault for one in system.given for fault in _given_faults(one, fmu)),
    ]
    if faults:
        raise SystemDescriptionError(f"{system.path}: {all_of(faults)}")
    check_effects(system, fmu)


def all_of(faults: Sequence[str]) -> str:
    """All mistakes of one description: a sentence, or how many there are and a line for each."""
    if len(faults) == 1:
        return faults[0]
    return f"{len(faults)} mistakes:" + "".join(f"\n  {one}" for one in faults)


def _parameter_faults(parameter: Parameter, fmu: Fmu) -> list[str]:
    kind = f"parameter {parameter.name!r}"
    found = fmu.variables.get(parameter.name)
    if found is None:
        return [f"{kind} {_lacking(parameter.name, fmu)}"]
    faults = unit_faults(kind, parameter, found, fmu)
    if found.causality not in ("parameter", "input") or not fmu.is_float(parameter.name):
        faults.append(
            f"{kind} is {_a_kind(found)} in {fmu.path.name}; expected a {_real(fmu)} parameter that can be set"
            f"{'' if _is_number(found) else _under_fixed(found)}"
        )
    elif not is_difference(found) and (wrong := in_another_unit([parameter.min, parameter.max], parameter.unit)):
        faults.append(
            f'{kind}: its range {wrong} (a difference of temperatures has relativeQuantity="true" in {fmu.path.name})'
        )
    return faults


def _input_faults(one: Input, fmu: Fmu) -> list[str]:
    kind = f"input {one.name!r}"
    found = fmu.variables.get(one.name)
    if found is None:
        return [f"{kind} {_lacking(one.name, fmu)}"]
    if found.causality != "input" or not fmu.is_float(one.name):
        instead = _under_fixed(found) if found.causality == "input" else ""
        return [f"{kind} is {_a_kind(found)} in {fmu.path.name}; expected a {_real(fmu)} input{instead}"]
    faults = unit_faults(kind, one, found, fmu)
    if found.variability == "discrete" and one.interpolation == "linear" and one.source != "constant":
        faults.append(f'{kind} is discrete in {fmu.path.name}; expected interpolation = "previous"')
    return faults


def _undriven(system: System, fmu: Fmu) -> list[str]:
    """Inputs of the FMU that no table of the description names."""
    declared = {*system.input_names, *system.parameter_names, *system.fixed}
    return [
        f"{fmu.path.name} has an input {name!r} that no [[inputs]] table names"
        + (_under_fixed(found) if not _is_number(found) else f"; expected one{_with_unit(found)}, or{_line(found)}")
        for name, found in fmu.variables.items()
        if found.causality == "input" and name not in declared and found.type not in UNSET
    ]


def _output_faults(output: Output, fmu: Fmu) -> list[str]:
    kind = f"output {output.name!r}"
    found = fmu.variables.get(output.fmu_variable)
    if found is None:
        return [f"{kind}: {output.fmu_variable!r} {_lacking(output.fmu_variable, fmu)}"]
    if not fmu.is_float(output.fmu_variable):
        return [f"{kind} is not a {_real(fmu)} but a {_type(found)} in {fmu.path.name}; expected another output"]
    return unit_faults(kind, output, found, fmu)


def _uncertain_faults(uncertain: Uncertain, system: System, fmu: Fmu) -> list[str]:
    faults = []
    for name in uncertain.parameters:
        kind = f"uncertain {uncertain.name!r}:"
        found = fmu.variables.get(name)
        if found is None:
            faults.append(f"{kind} {name!r} {_lacking(name, fmu)}")
            continue
        value = system.fixed.get(name, found.start if fmu.is_float(name) else None)
        stays = name in system.fixed and value == 0
        if found.causality not in ("parameter", "input") or value is None or not (stays or float(value) > 0):
            faults.append(
                f"{kind} {name!r} is a {found.causality} {_type(found)} with value {value} in {fmu.path.name};"
                f" expected a positive {_real(fmu)} parameter that can be set: give it a value under [fixed], or leave"
                " it out of this table"
            )
    return faults


def _given_faults(given: Given, fmu: Fmu) -> list[str]:
    faults = []
    for name in given.parameters:
        kind = f"given {given.name!r}:"
        found = fmu.variables.get(name)
        if found is None:
            faults.append(f"{kind} {name!r} {_lacking(name, fmu)}")
        elif found.causality != "parameter" or not fmu.is_float(name):
            faults.append(f"{kind} {name!r} is {_a_kind(found)}; expected a {_real(fmu)} parameter that can be set")
        elif given.of == "sum" and not (found.start is not None and float(found.start) > 0):
            faults.append(f"{kind} {name!r} starts at {found.start}; expected parameters of a sum that start above 0")
    return faults


def unit_faults(kind: str, declared: FmuVariable, found: ScalarVariable, fmu: Fmu) -> list[str]:
    """What is wrong with the unit of one variable of a description, beside that of the FMU's variable."""
    theirs = unit_of(found)
    stated = declared.fmu_unit
    if stated and theirs != "1":
        return [f"{kind} has fmu_unit = {stated!r}; the FMU states {theirs!r}; expected no fmu_unit"]
    own = declared.unit
    try:
        made = conversion(own, stated or theirs)
    except ValueError as error:
        return [f"{kind} is declared in {own!r}, and the FMU has {stated or theirs!r}: {error}; expected the FMU's"]
    if made is not None:
        return []
    if theirs == "1" and not stated:
        return [
            f"{kind} is declared in {own!r}; {fmu.path.name} states no unit of it; expected unit = '1', or"
            f" fmu_unit = {own!r} beside it if the FMU computes in that"
        ]
    return [f"{kind} is declared in {own!r}; the FMU has {stated or theirs!r}; expected a unit of the same kind"]


def conversion_of(declared: FmuVariable, found: ScalarVariable) -> Conversion:
    """From the unit of a description to that of the FMU's variable; both have been held against each other."""
    return (
        conversion(declared.unit, declared.fmu_unit or unit_of(found), difference=is_difference(found)) or Conversion()
    )


def set_faults(table: str, values: Mapping[str, float | bool], system: System, fmu: Fmu) -> list[str]:
    """What is wrong with FMU parameters that a table sets, a sentence about the table for each."""
    faults = []
    for name, given in values.items():
        found = fmu.variables.get(name)
        if found is None:
            faults.append(f"{table} {name!r} {_lacking(name, fmu)}")
        elif found.causality not in ("parameter", "input"):
            faults.append(f"{table} {name!r} is {_a_kind(found)} and cannot be set in {fmu.path.name}")
        elif name in system.input_names:
            faults.append(f"{table} {name!r} is one of [[inputs]], which drives it; expected it in one of the two")
        elif wrong := value_fault(found, given):
            faults.append(f"{table} {name!r} {wrong}")
    return faults


def fmu_of(system: System) -> Fmu:
    """The FMU that a description names.

    Raises FmuError if it is not there, as in a description that was copied without it, or cannot be loaded.
    """
    if not system.fmu_path.exists():
        raise FmuError(
            f"{system.path}: fmu is {shown(system.fmu)}, but {system.fmu_path} is not there; expected where the FMU"
            " lies, as seen from the description's folder"
        )
    return Fmu(system.fmu_path, system.kind)


def check_held(system: System, fmu: Fmu, names: Sequence[str], left: np.ndarray, right: np.ndarray) -> None:
    """Refuse what changes a discrete input on straight lines: such are set at events alone, and would be stale.

    ``left`` and ``right`` are the values of the discrete inputs ``names`` at both ends of each stretch between two
    knots, (stretches, inputs). Raises SystemDescriptionError naming the first.
    """
    bent = (left != right).any(axis=0)
    if bent.any():
        name = names[int(np.argmax(bent))]
        raise SystemDescriptionError(
            f"{system.path}: input {name!r} is discrete in {fmu.path.name}, and what drives it changes"
            ' linearly; expected interpolation = "previous"'
        )


def _lacking(name: str, fmu: Fmu) -> str:
    close = difflib.get_close_matches(name, list(fmu.variables), n=1)
    meant = f"did you mean {close[0]!r}?" if close else f"it has {len(fmu.variables)} others"
    return f"is not a variable of {fmu.path.name}; {meant}"


def _real(fmu: Fmu) -> str:
    return "Real" if fmu.interface.version == 2 else "Float64"


def _is_number(variable: ScalarVariable) -> bool:
    return variable.type in ("Real", "Float64", "Float32")


def _under_fixed(variable: ScalarVariable) -> str:
    """Where what is no number of the inputs stands instead, with the FMU's own value."""
    return f"; write under [fixed]:{_line(variable)}"


def _line(variable: ScalarVariable) -> str:
    return f' "{variable.name}" = {start_of(variable)}' + ("" if not _is_number(variable) else " under [fixed]")


def _with_unit(variable: ScalarVariable) -> str:
    return f' (its unit is "{unit_of(variable)}")'


def _a_kind(variable: ScalarVariable) -> str:
    return f"a {variable.causality} {_type(variable)}"


def _type(variable: ScalarVariable) -> str:
    return f"array of {variable.type}" if variable.shape else str(variable.type)
