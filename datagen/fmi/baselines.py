"""Whether effects on FMU parameters begin where the base model is: at zero they must not jump."""

from __future__ import annotations

import math

from datagen.fmi.fmu import Fmu
from shared.effects import ParameterEffect, ShapedEffect
from shared.errors import SystemDescriptionError
from shared.system import System

ALIKE = 1e-6
"""Values are equal that differ by no more than this share of themselves, or of what the effect usually adds."""
_BOOLEANS = {"true": 1.0, "false": 0.0}


def check_effects(system: System, fmu: Fmu) -> None:
    """Hold a description's effects on FMU parameters against its FMU, in each mode in which they act.

    Raises SystemDescriptionError as :func:`check_baseline`.
    """
    for spec in system.effects:
        if isinstance(spec, ParameterEffect | ShapedEffect):
            for mode in spec.modes:
                check_baseline(spec, system, fmu, replay=mode == "replay")


def check_baseline(spec: ParameterEffect | ShapedEffect, system: System, fmu: Fmu, *, replay: bool) -> None:
    """Refuse an effect whose parameters at an amplitude of zero are not those of the base model.

    An amplitude of zero sets nothing, so the FMU has its own start value then, or the description's; the least
    amplitude sets ``base``. Where these differ, a straight line through zero tells nothing of the effect. With
    ``replay`` the recorded actuators replace the control loops: the description's [replay] counts then. Raises
    SystemDescriptionError for the first parameter that the FMU does not have, that cannot be set there, or that has
    another value in the base model.
    """
    where = f"{system.path}: effects {spec.name!r}"
    for name in (*spec.parameters, *spec.constants):
        if name not in fmu.variables:
            raise SystemDescriptionError(f"{where}: {name!r} is not a variable of {fmu.path.name}; expected one")
        if (causality := fmu.variables[name].causality) not in ("parameter", "input"):
            raise SystemDescriptionError(
                f"{where}: {name!r} has the causality {causality} in {fmu.path.name}; expected one that can be set"
            )
    for name, change in spec.parameters.items():
        found, whose = _value(name, system, fmu, replay)
        base = spec.base.get(name, 0.0) if isinstance(spec, ParameterEffect) else 0.0
        if found is None or math.isclose(found, base, rel_tol=ALIKE, abs_tol=ALIKE * abs(change) * spec.scale):
            continue
        expected = (
            f'expected base = {{ "{name}" = {found:.10g} }}'
            if isinstance(spec, ParameterEffect)
            else "expected 0 there, for a shape takes the place of its input at once: set it to 0 under [fixed]"
        )
        raise SystemDescriptionError(f"{where}: {name!r} begins at {base:.10g} but is {found:.10g} {whose}; {expected}")


def _value(name: str, system: System, fmu: Fmu, replay: bool) -> tuple[float | None, str]:
    """What the base model has for a parameter, None if nobody says, and who says so."""
    if replay and name in system.replay:
        return float(system.replay[name]), "under [replay]"
    if name in system.fixed:
        return float(system.fixed[name]), "under [fixed]"
    start = fmu.variables[name].start
    try:
        return _BOOLEANS[start] if start in _BOOLEANS else float(start), f"in {fmu.path.name}"
    except (TypeError, ValueError):  # none, an array or a text: setting it says what is wrong
        return None, ""
