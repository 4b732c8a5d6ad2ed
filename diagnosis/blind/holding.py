"""Do the 90 % intervals that a diagnosis states hold the truth? Those of an effect's size, and of the parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict

from diagnosis.blind.intervals import Figure, Share, figure, share
from diagnosis.blind.opened import Row
from diagnosis.blind.verdicts import Moved, Parameter
from diagnosis.intervals import HALF_WIDTH


class Held(BaseModel):
    """Of the intervals of one kind.

    ``held`` by recording: of its intervals the share that holds the truth, averaged over recordings, which are the
    independent draws; where each has but one interval, a share of recordings as any other; ``error``: root mean square
    of the estimate's distance to the truth over the half-width of the side that the truth lies on, times 1.645 (1 for
    honest intervals of a normal posterior); ``by_parameter``: each parameter's share.
    """

    model_config = ConfigDict(extra="forbid")
    what: str
    held: Share | Figure
    error: Figure
    by_parameter: dict[str, Share] = {}


_BLUNT = 1e-12


def sizes(rows: Sequence[Row], seed: int = 0) -> Held:
    """Intervals of the size of an effect that was rightly named, as the candidate has it; of others it has none."""
    found = []
    for row in rows:
        verdict = row.outcome.verdict
        if verdict is None or row.stratum != "library":
            continue
        true = row.true_sizes
        of_row = [
            _place(one.value, one.low, one.high, true[name])
            for name, one in verdict.sizes.items()
            if name in row.effects and name in true
        ]
        if of_row:
            found.append(of_row)
    return _held("size of an effect of the library that was rightly named", found, seed=seed)


def parameters(rows: Sequence[Row], estimated: Sequence[Parameter], seed: int = 0) -> list[Held]:
    """Intervals of the parameters: as they are stated in the end, and by what the answer was worth."""
    named = [row for row in rows if row.named]
    right = [row for row in named if set(row.effects) & set(row.named)]
    wrong = [row for row in named if not set(row.effects) & set(row.named)]
    quiet = [row for row in rows if row.outcome.answer == "no_gap"]
    kinds: list[tuple[str, list[Row], bool]] = [
        ("no gap found, and no effect there", [row for row in quiet if row.truth == "no_gap"], False),
        ("no gap found, but a cause there", [row for row in quiet if row.truth != "no_gap"], False),
        ("a true cause in the answer, before what was chosen is added", right, False),
        ("a true cause in the answer, after what was chosen is added", right, True),
        ("the same, controllers simulated", [row for row in right if not row.answer["replay"]], True),
        ("the same, in replay", [row for row in right if row.answer["replay"]], True),
        ("the same, nothing but true causes added", [row for row in right if row.only_true_added], True),
        ("only wrong causes named, after they are added", wrong, True),
        ("none of these", [row for row in rows if row.outcome.answer == "none_of_these"], False),
    ]
    return [_parameters(f"parameters: {what}", ones, estimated, after, seed) for what, ones, after in kinds]


def _parameters(what: str, rows: Sequence[Row], estimated: Sequence[Parameter], after: bool, seed: int) -> Held:
    found = []
    for row in rows:
        moved = row.outcome.verdict.parameters if row.outcome.verdict is not None else {}
        ends = [_ends(moved[one.name], after) for one in estimated if one.name in moved]
        if len(ends) == len(estimated) and all(one is not None for one in ends):
            # distances on the parameter's own scale, in which its posterior is nearest to a normal one
            places = []
            for one, told in zip(estimated, ends, strict=True):
                assert told is not None
                value, low, high, true = np.array([*told, row.answer["parameters"][one.name]], dtype=float)
                scaled = np.log([value, low, high, true]) if one.scale == "log" else (value, low, high, true)
                places.append(_place(*map(float, scaled)))
            found.append(places)
    return _held(what, found, [one.name for one in estimated], seed)


def _ends(one: Moved, after: bool) -> tuple[float, float, float] | None:
    found = (one.after, one.after_low, one.after_high) if after else (one.before, one.before_low, one.before_high)
    value, low, high = found
    return None if value is None or low is None or high is None else (value, low, high)


def _place(value: float, low: float, high: float, true: float) -> tuple[bool, float]:
    """Whether an interval holds the truth, and how far off the estimate is in standard deviations of that side."""
    width = (high - value) if true > value else (value - low)
    return low <= true <= high, HALF_WIDTH * (true - value) / max(width, _BLUNT * max(abs(value), 1.0))


def _held(what: str, found: Sequence[Sequence[tuple[bool, float]]], names: Sequence[str] = (), seed: int = 0) -> Held:
    single = all(len(row) == 1 for row in found)
    held = np.array([np.mean([one for one, _ in row]) for row in found])
    square = np.array([np.mean([off**2 for _, off in row]) for row in found])
    return Held(
        what=what,
        held=share(held) if single else figure(held, seed=seed),
        error=figure(square, lambda drawn: np.sqrt(drawn.mean(axis=1)), seed=seed),
        by_parameter={name: share([row[k][0] for row in found]) for k, name in enumerate(names)} if found else {},
    )
