"""How two system descriptions fit each other, so that the same systems can be simulated with both."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from datagen.driving.tables import InputTable
from datagen.fmi.fmu import Fmu, unit_of
from shared.errors import SystemDescriptionError
from shared.system import System
from shared.variables import ConstantInput, MeasuredInput, Output


def matched(system: System, other: System) -> tuple[list[Output], System]:
    """The outputs that both have, and the other description with them, recorded as the first one does.

    Raises SystemDescriptionError if parameters or inputs of the other are not those of the first, or no output is.
    """
    for name in system.parameter_names:
        if name not in other.parameter_names and name not in other.fixed:
            raise SystemDescriptionError(
                f"{other.path}: has no parameter {name!r}, which {system.path} draws; "
                f"found {', '.join(other.parameter_names)}"
            )
    _same_units(system, other)
    theirs = {one.name: one for one in other.outputs}
    outputs = [one for one in system.outputs if one.name in theirs]
    if not outputs:
        raise SystemDescriptionError(
            f"{other.path}: outputs are {', '.join(theirs)}; expected some of {', '.join(system.output_names)}"
        )
    recorded = [one.model_copy(update={"variable": theirs[one.name].fmu_variable}) for one in outputs]
    return outputs, other.model_copy(update={"outputs": recorded})


def handed_on(system: System, other: System, fmus: tuple[Fmu, Fmu]) -> dict[str, float | bool]:
    """What the first description fixes and the other model has, too, and leaves open: by name [unit of the FMUs].

    Where the other's ``[fixed]`` states a value, that stays: two models may be told apart by nothing else. ``fmus`` are
    those of the two. Raises SystemDescriptionError if one of these, or a parameter that the first draws, has another
    unit in the other FMU.
    """
    for name in system.parameter_names:  # which the other may have under [fixed], where nothing states a unit
        ours, theirs = (unit_of(fmu.variables[name]) for fmu in fmus)
        if ours != theirs:
            raise SystemDescriptionError(
                f"{system.path}: parameter {name!r} has unit {ours!r} in {fmus[0].path.name} and {theirs!r} in "
                f"{fmus[1].path.name}; expected the same, for both get the value that is drawn"
            )
    found = {name: value for name, value in system.fixed.items() if _open(name, other, fmus[1])}
    for name in found:
        ours, theirs = (unit_of(fmu.variables[name]) for fmu in fmus)
        if ours != theirs:
            raise SystemDescriptionError(
                f"{system.path}: fixed {name!r} has unit {ours!r} in {fmus[0].path.name} and {theirs!r} in "
                f"{fmus[1].path.name}; expected the same, or a value for it under [fixed] of {other.path}"
            )
    return found


def _open(name: str, other: System, fmu: Fmu) -> bool:
    """Whether an FMU has a parameter of this name that its description neither fixes nor drives."""
    there = name in fmu.variables and fmu.variables[name].causality == "parameter"
    return there and name not in other.fixed and name not in other.input_names


def told_apart(system: System, other: System) -> tuple[str, str]:
    """What two systems are called: their FMUs, or where those have one name their descriptions, by name or by path."""
    ways = [(one.fmu_path.name, one.name, str(one.path)) for one in (system, other)]
    return next(((a, b) for a, b in zip(*ways, strict=True) if a != b), (ways[0][0], ways[1][0]))


def unmatched(system: System, other: System, fmu: Fmu) -> list[str]:
    """In a sentence each, what one of the two has and the other has not, so that they differ in it by themselves.

    What both fix, at two values, is such a difference, too; what one fixes and the other draws is drawn for both. The
    other's ``fmu`` holds a parameter that nobody sets at the value that it was made with.
    """
    ours, theirs = told_apart(system, other)
    held = [
        f"{p.name} ({fmu.variables[p.name].start} {p.unit})"
        for p in other.parameters
        if p.name not in system.parameter_names and p.name not in {*system.fixed, *other.fixed}
    ]
    apart = [
        f"{name} ({other.fixed[name]:g} in place of {value:g})"
        for name, value in system.fixed.items()
        if name in other.fixed and other.fixed[name] != value
    ]
    drawn = [
        f"{name} ({other.fixed[name]:g})"
        for name in system.parameter_names
        if name in other.fixed and name not in other.parameter_names
    ]
    lacking = [name for name in system.fixed if name not in other.fixed and not _open(name, other, fmu)]
    unused = [name for name in system.input_names if name not in other.input_names]
    resting = [
        f"{one.name} ({one.value:g} {one.unit})"
        for one in other.inputs
        if one.name not in system.input_names and isinstance(one, ConstantInput | MeasuredInput)
    ]
    found = (
        (held, "parameters of {theirs} that {ours} does not draw are held at its own values: {names}"),
        (apart, "values under [fixed] of {theirs} are not those of {ours}: {names}"),
        (drawn, "values under [fixed] of {theirs} give way to those that {ours} draws: {names}"),
        (lacking, "parameters that {ours} has under [fixed] are none of {theirs}: {names}"),
        (unused, "inputs of {ours} are not used by {theirs}: {names}"),
        (resting, "inputs of {theirs} that {ours} does not have rest at their declared values: {names}"),
    )
    return [words.format(ours=ours, theirs=theirs, names=", ".join(names)) for names, words in found if names]


def _same_units(system: System, other: System) -> None:
    for kind in ("parameters", "inputs", "outputs"):
        ours: Mapping[str, str] = {one.name: one.unit for one in getattr(system, kind)}
        for one in getattr(other, kind):
            if ours.get(one.name, one.unit) != one.unit:
                raise SystemDescriptionError(
                    f"{other.path}: {kind} {one.name!r} has unit {one.unit!r}; expected {ours[one.name]!r}, "
                    f"as in {system.path}"
                )


def inputs_for(other: System, table: InputTable) -> InputTable:
    """The same inputs in the other description's order; one that the first lacks rests at its declared value.

    Raises SystemDescriptionError if an input that the first lacks is neither constant nor measured.
    """
    columns = {name: k for k, name in enumerate(table.names)}
    left, right = (np.empty((len(table.time) - 1, len(other.inputs))) for _ in range(2))
    for k, one in enumerate(other.inputs):
        if one.name in columns:
            left[:, k], right[:, k] = table.left[:, columns[one.name]], table.right[:, columns[one.name]]
        elif isinstance(one, ConstantInput | MeasuredInput):
            left[:, k] = right[:, k] = one.value
        else:
            raise SystemDescriptionError(
                f"{other.path}: input {one.name!r} comes from {one.source}, but the first description has no such "
                f"input; found {', '.join(table.names)}"
            )
    return InputTable(tuple(other.input_names), table.time, left, right, table.jump)
