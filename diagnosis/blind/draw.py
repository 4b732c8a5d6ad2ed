"""Which recording a number stands for: stratum, effects and amplitudes, drawn by (seed, index) alone."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from datagen.driving.sampling import stream
from diagnosis.blind.truth import Driven, Fault, Form, Truth
from diagnosis.effects import Effect, clash

Item = TypeVar("Item")
Acts = Effect | Form


@dataclass(frozen=True)
class Cause:
    """One effect in a recording: a candidate as it is, or a form of the truth, with its amplitude [unit]."""

    acts: Acts
    amplitude: float

    @property
    def label(self) -> str:
        """The candidate's name that is the right answer; empty if none is."""
        return self.acts.effect if isinstance(self.acts, Form) else self.acts.name

    @property
    def form(self) -> str:
        """The form's name; empty for a candidate as it is."""
        return self.acts.name if isinstance(self.acts, Form) else ""


@dataclass(frozen=True)
class Case:
    """What a recording is of. ``unknown_occupancy`` and ``replay`` are what the campaign could measure.

    ``attempt`` counts the draws before this one that could not be simulated.
    """

    seed: int
    index: int
    stratum: str
    causes: tuple[Cause, ...]
    unknown_occupancy: bool
    replay: bool
    attempt: int = 0

    @property
    def root(self) -> int:
        """The root seed of this recording's streams: the set's own but where it is drawn anew."""
        return _root(self.seed, self.attempt)

    def rng(self, purpose: str) -> np.random.Generator:
        """The stream of randomness of this recording for one purpose."""
        return stream(self.root, self.index, f"blind.{purpose}")


def draw_case(truth: Truth, effects: list[Effect], seed: int, index: int, attempt: int = 0) -> Case:
    """Draw one case. Strata come in shuffled blocks and causes in shuffled rounds, so that all occur about equally.

    Another ``attempt`` has the same stratum and causes; all else is drawn anew.
    """
    order = truth.strata.order
    block, place = divmod(index, len(order))
    shuffled = _shuffled(order, seed, f"strata.{block}")
    stratum = shuffled[place]
    turn = block * order.count(stratum) + shuffled[:place].count(stratum)
    root = _root(seed, attempt)
    acts = _acts(truth, effects, seed, index, stratum, turn)
    rng = stream(root, index, "blind.amplitudes")
    causes = tuple(Cause(one, _amplitude(one, truth, rng)) for one in acts)
    conditions = stream(root, index, "blind.conditions").random(2)
    modes = set.intersection({"control", "replay"}, *(set(_modes(one.acts)) for one in causes))
    wanted = "replay" if conditions[1] < truth.measuring.replay else "control"
    return Case(
        seed,
        index,
        stratum,
        causes,
        unknown_occupancy=bool(conditions[0] < truth.measuring.unknown_occupancy),
        replay="replay" in modes and (wanted == "replay" or "control" not in modes),
        attempt=attempt,
    )


def _root(seed: int, attempt: int) -> int:
    if not attempt:
        return seed
    return int.from_bytes(hashlib.sha256(f"blind attempt {attempt} of {seed}".encode()).digest()[:7], "big")


def _acts(truth: Truth, effects: list[Effect], seed: int, index: int, stratum: str, turn: int) -> list[Acts]:
    def pick(acts: Sequence[Acts], purpose: str) -> Acts:
        round_, place = divmod(turn, len(acts))
        return _shuffled(acts, seed, f"{purpose}.{round_}")[place]

    other: list[Acts] = [form for form in truth.forms if form.effect]
    chosen: list[Acts] = []
    if stratum == "library":
        chosen = [pick(effects, "library")]
    elif stratum == "form":
        chosen = [pick(other, "form")]
    elif stratum == "outside":
        chosen = [pick(truth.outside, "outside")]
    elif stratum == "two":
        partners = pairs(truth, effects)
        first = pick([one for one in effects if one.name in partners], "two")
        rest = partners[first.name]
        chosen = [first, rest[int(stream(seed, index, "blind.second").integers(len(rest)))]]
    return chosen


def pairs(truth: Truth, effects: list[Effect]) -> dict[str, list[Acts]]:
    """What may act together with each effect, by its name; effects that nothing goes with are left out."""
    every: list[Acts] = [*effects, *(form for form in truth.forms if form.effect)]
    found = {first.name: [one for one in every if _together(first, one, effects)] for first in effects}
    return {name: rest for name, rest in found.items() if rest}


def _together(first: Acts, second: Acts, effects: list[Effect]) -> bool:
    """Whether two causes differ, can be told as two candidates, and do not drive the same thing."""
    names = [one.effect if isinstance(one, Form) else one.name for one in (first, second)]
    if names[0] == names[1]:
        return False
    if clash([effect for effect in effects if effect.name in names]) or not set(_modes(first)) & set(_modes(second)):
        return False
    return not _driven(first) & _driven(second)


def _driven(acts: Acts) -> set[str]:
    if isinstance(acts, Form):
        return {*acts.parameters, *acts.constants, *(one.input for one in acts.inputs if one.use == "set")}
    return set(getattr(acts, "owns", acts.changes))


def _modes(acts: Acts) -> list[str]:
    if isinstance(acts, Form):
        return list(acts.modes)
    spec = getattr(acts, "spec", None)
    return list(spec.modes) if spec is not None else ["control", "replay"]


def _amplitude(acts: Acts, truth: Truth, rng: np.random.Generator) -> float:
    """Log-uniform over the range of sizes, cut off at its limit, of either sign where both are possible."""
    low, high = np.log(truth.amplitudes)
    size, sign = np.exp(low + (high - low) * rng.random()), rng.random()
    if isinstance(acts, Form):
        return float(min(size * acts.scale, acts.limit) * (-1.0 if acts.signed and sign < 0.5 else 1.0))
    negative = acts.lower < 0 and (acts.upper <= 0 or sign < 0.5)
    bound = -acts.lower if negative else acts.upper
    return float(min(size * acts.scale, bound) * (-1.0 if negative else 1.0))


def _shuffled(items: Sequence[Item], seed: int, purpose: str) -> list[Item]:
    order = stream(seed, 0, f"blind.order.{purpose}").permutation(len(items))
    return [items[k] for k in order]


def purpose(acts: Effect | Form, place: int, one: Driven | Fault) -> str:
    """What a stream of randomness is for: things of one key share it."""
    key = one.key if isinstance(one, Fault) else getattr(one.process, "key", "")
    return f"{acts.name}.{key}" if key else f"{acts.name}.{type(one).__name__}.{place}"


def describe(cause: Cause) -> dict[str, Any]:
    """A cause for the sealed file."""
    acts = cause.acts
    return {
        "effect": cause.label,
        "form": cause.form,
        "description": acts.description,
        "amplitude": cause.amplitude,
        "unit": acts.unit,
        "scale": acts.scale,
    }
