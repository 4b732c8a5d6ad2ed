"""Which effects there are: those of the system's TOML, and those of installed packages.

A package adds its own through the entry point group :data:`ENTRY_POINTS`: each entry is a function that gets the
system and returns effects (:class:`diagnosis.effects.base.Effect`)::

    [project.entry-points."zeroshot_fmu.effects"]
    mine = "my_package:effects"

Effects asked for what they do, and held to it: a package's own may do what the description's cannot.

Whatever goes wrong in a stranger's code is told with the effect's name; our own kinds show their bugs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

import numpy as np

from datagen.driving.tables import Piecewise
from datagen.fmi.baselines import check_baseline
from datagen.fmi.fmu import Fmu
from diagnosis.effects.base import Effect
from diagnosis.effects.kinds import ChangedInput, Declared, DeclaredKind, FmuParameters, Sensor, Shaped
from diagnosis.recording import Recording
from shared.effects import DiurnalShape, InputEffect, ParameterEffect, SensorEffect, Shape, ShapedEffect, TimetableShape
from shared.errors import SystemDescriptionError, ZeroshotError
from shared.system import System
from shared.variables import ConstantInput, MeasuredInput

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
    return kind(spec, outputs, frozenset(one.name for one in system.outputs if one.method == "mean"))


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


def check_baselines(effects: Iterable[Effect], system: System, fmu: Fmu, *, replay: bool) -> None:
    """Refuse effects whose parameters at an amplitude of zero are not those of the base model.

    Those of the description have been held against its FMU when that was loaded; a caller or a package may bring
    others. Effects that cannot act in this mode are not looked at. Those of other kinds that a package may have may
    follow any law, but must set what can be set: see :func:`~diagnosis.effects.library.check_parameters`.

    Parameters
    ----------
    replay
        Whether the recorded actuators replace the control loops: the description's [replay] counts then.

    Raises
    ------
    SystemDescriptionError
        For the first parameter that the FMU does not have or cannot set, or that has another value in the base model.
    """
    mode = "replay" if replay else "control"
    for effect in effects:
        if isinstance(effect, FmuParameters) and mode in effect.spec.modes:
            check_baseline(effect.spec, system, fmu, replay=replay)
        elif not isinstance(effect, DeclaredKind):
            check_parameters(effect, system, fmu)
