"""What an effect is: something that the base model leaves out, with one amplitude whose zero is the base model.

An effect acts in up to three places: on parameters of the FMU, on its inputs, and on its outputs (a sensor). Which
effects there are is said in the system's TOML (:mod:`diagnosis.effects.library`) or by a user's own Python package.

Readings that some candidate would have to invent: they count for none, so that all are weighed by the same ones.

A late clock shows at the recording's end what was there after it, and a set point that comes early is then one that
nobody recorded. Whatever is put in its place is charged to the cause that is right: a heater that starts at six, in a
week that ends at six, costs a clock that is a quarter of an hour late forty in log likelihood. Leaving such readings
out of one candidate alone would not do, because evidences of different readings cannot be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.recording import Recording


@runtime_checkable
class Effect(Protocol):
    """A candidate cause of the gap.

    Attributes
    ----------
    name, description, kind
        ``kind`` is the generic kind: ``parameter``, ``shaped``, ``input``, ``sensor``, or a user's own.
    unit
        Of the amplitude.
    scale
        Standard deviation of the amplitude that is expected before anything is measured [unit], > 0.
    lower, upper
        What the amplitude may be [unit]; ``lower <= 0 <= upper``. Where ``lower`` is 0, derivatives at zero are
        one-sided.
    changes
        FMU parameters, inputs and (with ``output:`` before the name) outputs that the effect touches. Two effects
        that set the same parameter or replace the same shape cannot be combined (:func:`clash`).

    Notes
    -----
    An effect may say more of itself, in attributes that it need not have. ``owns``: of what it ``changes``, what no
    other effect may set at the same time; all of it without. ``moves_in_time``: inputs that it lets come earlier or
    later, none without (:func:`moved_in_time`). Persons whom nobody counted could have come at any time anyway, so that
    an effect that moves them is left out. ``invented(time)``: readings that it would have to take from beyond the
    recording, bool of shape (outputs, steps), by the recording's own time, shape (steps,) [s]; none without.
    """

    @property
    def name(self) -> str:
        """As users see it."""
        ...

    @property
    def description(self) -> str:
        """One sentence."""
        ...

    @property
    def kind(self) -> str:
        """The generic kind."""
        ...

    @property
    def unit(self) -> str:
        """Of the amplitude."""
        ...

    @property
    def scale(self) -> float:
        """Standard deviation expected of the amplitude [unit]."""
        ...

    @property
    def lower(self) -> float:
        """Least amplitude [unit]."""
        ...

    @property
    def upper(self) -> float:
        """Greatest amplitude [unit]."""
        ...

    @property
    def changes(self) -> frozenset[str]:
        """What the effect touches."""
        ...

    def obstacle(self, recording: Recording, *, replay: bool) -> str:
        """Why the effect cannot be tried on this recording, in one clause; empty if it can.

        ``replay``: whether measured actuators replace the control loops.
        """
        ...

    def parameters(self, amplitude: float) -> dict[str, float]:
        """FMU parameters to set, by name [unit of each]; empty at zero.

        None of them may be estimated, or one of the uncertain constants: these would jump from zero to the effect's.
        """
        ...

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """All inputs with the changed ones replaced; ``inputs`` itself, unchanged, at zero.

        There can be no inputs but those of the description: one that an effect needs is a ``constant`` there.

        ``inputs`` may begin before the recording (warm-up); what they return spans at least the same time. Persons whom
        nobody counted are in them as they drive the model in this simulation: half-hourly means that need not be whole
        numbers, before the recording not even positive. What follows them had better be smooth.
        """
        ...

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show, shape (outputs, steps) [unit of each output]; ``outputs`` itself at zero.

        ``time`` (steps,) are the ends of the recording's steps [s]; drifts are counted from the first.
        """
        ...


class Idle:
    """What an effect does at the places where it does not act; and what it says of itself."""

    name: str
    description: str
    kind: str
    unit: str
    scale: float
    lower: float
    upper: float

    @property
    def moves_in_time(self) -> frozenset[str]:
        """Inputs that the effect lets come earlier or later: none."""
        return frozenset()

    def parameters(self, amplitude: float) -> dict[str, float]:
        """No parameter."""
        return {}

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs as they are."""
        return inputs

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """The outputs as they are."""
        return outputs


@dataclass(frozen=True)
class Nothing(Idle):
    """An effect that acts nowhere, whatever its amplitude: the base of the others."""

    name: str
    unit: str = "1"
    scale: float = 1.0
    lower: float = -np.inf
    upper: float = np.inf
    description: str = ""
    kind: str = "nothing"

    @property
    def changes(self) -> frozenset[str]:
        """Nothing."""
        return frozenset()

    def obstacle(self, recording: Recording, *, replay: bool) -> str:
        """None."""
        return ""


def moved_in_time(effect: Effect) -> frozenset[str]:
    """Inputs that an effect lets come earlier or later: none if it does not say so."""
    return frozenset(getattr(effect, "moves_in_time", ()))


def clash(effects: Sequence[Effect]) -> str:
    """What several effects would both set, so that they cannot act together; empty if they can.

    Inputs that effects change one after another, and sensors in series, are no clash; a parameter of the FMU has one
    value, and a shape is one effect's own. Both are in ``owns`` of the kinds of this package; of others, all that
    they change counts.
    """
    taken: dict[str, str] = {}
    for effect in effects:
        for what in sorted(getattr(effect, "owns", effect.changes)):
            if what in taken:
                return f"{taken[what]} and {effect.name} both set {what}"
            taken[what] = effect.name
    return ""


def foreseen(effects: Sequence[Effect], recording: Recording) -> np.ndarray:
    """Readings that every effect derives from the recording's own time at any amplitude, shape (outputs, steps)."""
    kept = np.ones(recording.outputs.shape, dtype=bool)
    for effect in effects:
        invented = getattr(effect, "invented", None)  # of a package's own effects nothing is known
        if invented is not None:
            kept &= ~invented(recording.time)
    return kept
