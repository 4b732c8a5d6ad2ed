"""Effects asked for what they do, and held to it: a package's own may do what the description's cannot.

Whatever goes wrong in a stranger's code is told with the effect's name; our own kinds show their bugs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from datagen.driving.tables import Piecewise
from datagen.fmi.fmu import Fmu
from diagnosis.effects.base import Effect
from diagnosis.effects.kinds import DeclaredKind
from diagnosis.recording import Recording
from shared.errors import SystemDescriptionError, ZeroshotError
from shared.system import System

T = TypeVar("T")


def parameters_of(effect: Effect, amplitude: float) -> dict[str, float]:
    """FMU parameters that an effect sets [unit of each].

    Raises
    ------
    SystemDescriptionError
        If it fails or gives no dictionary.
    """
    found = _asked(effect, "parameters", lambda: effect.parameters(amplitude))
    if not isinstance(found, dict):
        raise _wrong(effect, "parameters", f"gives a {type(found).__name__}; expected a dictionary")
    return found


def inputs_of(
    effect: Effect, amplitude: float, inputs: dict[str, Piecewise], recording: Recording
) -> dict[str, Piecewise]:
    """All inputs as an effect changes them; it gets a dictionary of its own, which it may write to.

    Raises
    ------
    SystemDescriptionError
        If it fails, or gives other inputs than there are, or one that is no signal.
    """
    found = _asked(effect, "inputs", lambda: effect.inputs(amplitude, dict(inputs), recording))
    if not isinstance(found, dict):
        raise _wrong(effect, "inputs", f"gives a {type(found).__name__}; expected a dictionary")
    if other := sorted(map(str, found.keys() ^ inputs.keys())):
        what = f"has {other[0]!r}, which is no input" if other[0] not in inputs else f"lacks {other[0]!r}"
        raise _wrong(effect, "inputs", f"{what}; expected {', '.join(inputs)}")
    for name, signal in found.items():
        if not isinstance(signal, Piecewise):
            raise _wrong(effect, "inputs", f"has a {type(signal).__name__} for {name!r}; expected a Piecewise")
    return found


def outputs_of(effect: Effect, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
    """What the sensors show with an effect, shape (outputs, steps) [unit of each output].

    Raises
    ------
    SystemDescriptionError
        If it fails or gives another shape.
    """
    found = _asked(effect, "outputs", lambda: np.asarray(effect.outputs(amplitude, outputs, time), dtype=float))
    if found.shape != outputs.shape:
        raise _wrong(effect, "outputs", f"gives the shape {found.shape}; expected {outputs.shape}")
    return found


def check_parameters(effect: Effect, system: System, fmu: Fmu | None = None) -> None:
    """Refuse an effect that sets what is estimated or uncertain, or what the FMU, if given, does not have or let set.

    At zero an effect sets nothing: what is unknown otherwise would jump from there to the effect's value. Looked at are
    amplitudes of its scale, as far as it may have them.

    Raises
    ------
    SystemDescriptionError
        For the first such parameter, or if the effect fails.
    """
    uncertain = {name for one in system.uncertain for name in one.parameters}
    for size in (min(effect.scale, effect.upper), max(-effect.scale, effect.lower)):
        for name in parameters_of(effect, size) if size else ():
            if name in system.parameter_names:
                raise _wrong(effect, "parameters", f"sets {name!r}, which is estimated; expected another parameter")
            if name in uncertain:
                raise _wrong(effect, "parameters", f"sets {name!r}, an uncertain constant; expected another parameter")
            if fmu is not None and name not in fmu.variables:
                raise _wrong(effect, "parameters", f"sets {name!r}; expected a variable of {fmu.path.name}")
            if fmu is not None and (causality := fmu.variables[name].causality) not in ("parameter", "input"):
                raise _wrong(
                    effect,
                    "parameters",
                    f"sets {name!r}, whose causality in {fmu.path.name} is {causality}; expected one that can be set",
                )


def _asked(effect: Effect, what: str, ask: Callable[[], T]) -> T:
    """An effect's answer; of a stranger's code the user must learn whose it is that fails."""
    if isinstance(effect, DeclaredKind):
        return ask()
    try:
        return ask()
    except ZeroshotError:
        raise
    except Exception as error:
        raise _wrong(effect, what, f"fails with {type(error).__name__}: {error}") from error


def _wrong(effect: Effect, what: str, found: str) -> SystemDescriptionError:
    return SystemDescriptionError(f"effect {effect.name!r} ({type(effect).__module__}): {what} {found}")


__all__ = ["check_parameters", "inputs_of", "outputs_of", "parameters_of"]
