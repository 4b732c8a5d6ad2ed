"""Which effects there are: those of the system's TOML, and those of installed packages.

A package adds its own through the entry point group :data:`ENTRY_POINTS`: each entry is a function that gets the
system and returns effects (:class:`diagnosis.effects.base.Effect`)::

    [project.entry-points."zeroshot_fmu.effects"]
    mine = "my_package:effects"
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points

from diagnosis.effects.asked import check_parameters
from diagnosis.effects.base import Effect
from diagnosis.effects.kinds import ChangedInput, Declared, FmuParameters, Sensor, Shaped
from shared.effects import DiurnalShape, InputEffect, ParameterEffect, SensorEffect, Shape, ShapedEffect, TimetableShape
from shared.errors import SystemDescriptionError
from shared.system import System
from shared.variables import ConstantInput, MeasuredInput

ENTRY_POINTS = "zeroshot_fmu.effects"


def library(system: System, *, names: Sequence[str] | None = None) -> list[Effect]:
    """All effects for a system, or those of ``names`` in that order.

    Raises
    ------
    SystemDescriptionError
        If an effect names what the system does not have, two have one name, or a package's effect is none, has a scale
        or bounds that none can have, or sets a parameter that is unknown otherwise.
    """
    found = [build(spec, system) for spec in system.effects]
    for entry in entry_points(group=ENTRY_POINTS):
        found += _loaded(entry, system)
    by_name: dict[str, Effect] = {}
    for effect in found:
        if effect.name in by_name:
            raise SystemDescriptionError(f"{system.path}: effects: {effect.name!r} is declared twice")
        by_name[effect.name] = effect
    if names is None:
        return found
    for name in names:
        if name not in by_name:
            raise SystemDescriptionError(
                f"{system.path}: {name!r} is not an effect; found {', '.join(by_name) or 'none'}"
            )
    return [by_name[name] for name in names]


def build(spec: Declared, system: System) -> Effect:
    """The effect of one declaration, held against the system's names.

    Raises
    ------
    SystemDescriptionError
        If it names an input, an output or a series that the system does not have.
    """
    inputs, outputs = tuple(system.input_names), tuple(system.output_names)
    where = f"{system.path}: effects {spec.name!r}"

    def known(name: str, kinds: Sequence[str], what: str) -> None:
        if name not in kinds:
            raise SystemDescriptionError(f"{where}: {name!r} is not {what}; found {', '.join(kinds) or 'none'}")

    shapes: list[Shape] = []
    if isinstance(spec, ParameterEffect | ShapedEffect):
        for name in {*spec.parameters, *spec.constants} & set(system.parameter_names):
            raise SystemDescriptionError(f"{where}: {name!r} is an estimated parameter; expected another one")
    if isinstance(spec, ShapedEffect | InputEffect):
        known(spec.input, inputs, "an input")
        shapes = spec.shape
    if isinstance(spec, ShapedEffect):
        driven = next(one for one in system.inputs if one.name == spec.input)
        if not (isinstance(driven, ConstantInput) and driven.value == 0):
            raise SystemDescriptionError(
                f"{where}: {spec.input!r} is no constant of 0; expected one, which the shape takes the place of"
            )
    if isinstance(spec, SensorEffect):
        for name in spec.outputs:
            known(name, outputs, "an output")
        for name in [*spec.fed_back, *spec.replayed.values()]:
            known(name, inputs, "an input")
        for output, name in spec.replayed.items():
            one = next(one for one in system.inputs if one.name == name)
            if not (isinstance(one, MeasuredInput) and one.column == output):
                raise SystemDescriptionError(
                    f"{where}: replayed: {name!r} is not what {output!r} measures; expected an input of source"
                    f" 'measured' with that column"
                )
    for shape in shapes:
        if not isinstance(shape, TimetableShape | DiurnalShape):
            known(shape.series, inputs + outputs, "an input or output")
    kind = {"parameter": FmuParameters, "shaped": Shaped, "input": ChangedInput, "sensor": Sensor}[spec.kind]
    return kind(spec, inputs, outputs, frozenset(one.name for one in system.outputs if one.method == "mean"))


def _loaded(entry: EntryPoint, system: System) -> list[Effect]:
    """The effects of one installed package."""
    where = f"entry point {entry.name!r} of {ENTRY_POINTS} ({entry.value})"
    try:
        effects = list(entry.load()(system))
    except Exception as error:  # a stranger's code: whatever it raises, the user must learn whose it is
        raise SystemDescriptionError(f"{where}: fails with {type(error).__name__}: {error}") from error
    for effect in effects:
        if not isinstance(effect, Effect):
            raise SystemDescriptionError(f"{where}: gives a {type(effect).__name__}; expected effects")
        if flaw := _flaw(effect):
            raise SystemDescriptionError(f"{where}: {effect.name!r} {flaw}")
        check_parameters(effect, system)
    return effects


def _flaw(effect: Effect) -> str:
    """What is wrong with an effect's scale and bounds; empty if nothing is. A declaration's are checked as it is read.

    Bounds may be infinite.
    """
    try:
        scale, low, high = float(effect.scale), float(effect.lower), float(effect.upper)
    except (TypeError, ValueError):
        return f"has scale {effect.scale!r}, from {effect.lower!r} to {effect.upper!r}; expected numbers"
    if not (math.isfinite(scale) and scale > 0):
        return f"has the scale {scale:g}; expected a finite number above 0"
    if not low <= 0 <= high or low == high:
        return f"goes from {low:g} to {high:g}; expected a range with 0, the base model"
    return ""
