"""How far the gap was shrunk, against an oracle that knows the cause; and what became of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict

from diagnosis.blind.opened import Limits, Row
from diagnosis.blind.rates import Figure, figure, median
from diagnosis.blind.verdicts import Parameter, Verdict

WORST = -1.0
"""A share below counts as this in means: a gap that was doubled, however much more."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Shrinkage(_Table):
    """Of one channel, over recordings whose gap can be seen in it.

    ``share``: mean of what was removed (nothing where no effect was named); ``oracle``: of what an oracle would have;
    ``ratio``: mean of the first over mean of the second; ``median``: median of the recordings' own ratios. ``unknown``:
    recordings without a figure, because the diagnosis named effects but gave no share on the part that it scored (it
    saw no gap above the noise there, or had too few readings); ``unseen``: further recordings that were asked about
    whose gap can be seen in no channel; ``least``: the ratio if nothing had been removed from any of both.
    """

    channel: str
    share: Figure
    oracle: Figure
    ratio: Figure
    median: Figure
    unknown: int
    least: Figure | None = None
    unseen: int = 0

    @property
    def asked(self) -> int:
        """How many recordings there are, with a figure or without."""
        return self.share.n + self.unknown + self.unseen


class Error(_Table):
    """Of one parameter: distance to the truth in shares of its range (in its scale), without and with the effect.

    ``change`` is the second less the first: below zero is better.
    """

    parameter: str
    before: Figure
    after: Figure
    change: Figure


@dataclass(frozen=True)
class Removed:
    """Of one recording and channel: the share that was removed, and that an oracle removes."""

    row: Row
    channel: str
    share: float
    oracle: float


def removed(rows: Sequence[Row], limits: Limits) -> tuple[list[Removed], list[Removed], list[Removed]]:
    """Shares of recordings with causes of the library, in the channels where the gap can be seen; and those without.

    Of the second the diagnosis has no share: it stands as nothing. So it does of the third, whose gap can be seen in no
    channel: they stand with the one where it is largest over noise.

    The oracle knows cause and amplitude and takes the whole sealed gap away, but for what recordings without any effect
    have as well (the truth's finer walls; the median of those with the same actuators): 1 - structural^2 / gap^2. A
    share above one, where what is left is below the noise that was assumed, is all of the gap and no more.
    """
    found, lost, unseen = [], [], []
    for row in rows:
        if row.truth != "effect":
            continue
        if not row.visible:
            channel = _largest(row, tuple(row.gap))
            unseen.append(Removed(row, channel, 0.0, _oracle(row, channel, limits)))
        for channel in row.visible:
            oracle = _oracle(row, channel, limits)
            share = _share(row.outcome.verdict, channel) if row.named else 0.0
            if share is None:
                lost.append(Removed(row, channel, 0.0, oracle))
            else:
                found.append(Removed(row, channel, min(max(share, WORST), 1.0), oracle))
    return found, lost, unseen


def _oracle(row: Row, channel: str, limits: Limits) -> float:
    left, gap = limits[row.answer["replay"], channel], row.gap[channel]
    return 1.0 - (left / gap) ** 2 if gap > left else 0.0


def _share(verdict: Verdict | None, channel: str) -> float | None:
    one = verdict.shrinkage.get(channel) if verdict is not None else None
    return None if one is None else one.share


def by_channel(found: Sequence[Removed], lost: Sequence[Removed], seed: int = 0) -> list[Shrinkage]:
    """Shrinkage channel by channel; channels in which no gap can be seen are left out."""
    every, scored = [*found, *lost], []
    for channel in every[0].row.gap if every else ():
        ones, unknown = ([one for one in some if one.channel == channel] for some in (found, lost))
        if ones or unknown:
            scored.append(_scored(channel, ones, unknown, seed))
    return scored


def where_largest(
    found: Sequence[Removed], lost: Sequence[Removed], unseen: Sequence[Removed] = (), *, seed: int = 0
) -> Shrinkage:
    """The same, of each recording only the channel where its sealed gap over noise is largest.

    Parameters
    ----------
    unseen
        Recordings that are asked about, too, though no channel shows their gap.
    """
    ones, unknown = (
        [one for one in some if one.channel == _largest(one.row, one.row.visible)] for some in (found, lost)
    )
    return _scored("where the gap is largest", ones, unknown, seed, unseen)


def _largest(row: Row, channels: Sequence[str]) -> str:
    return max(channels, key=lambda channel: row.gap[channel])


def _scored(
    channel: str, ones: Sequence[Removed], unknown: Sequence[Removed], seed: int, unseen: Sequence[Removed] = ()
) -> Shrinkage:
    both = _pairs(ones)
    # of a gap that is no larger than the walls' an oracle removes nothing either: such a recording moves no ratio
    least = [*ones, *unknown, *(one for one in unseen if one.oracle > 0)]
    return Shrinkage(
        channel=channel,
        share=figure(both[:, 0], seed=seed),
        oracle=figure(both[:, 1], seed=seed),
        ratio=figure(both, _ratio, seed=seed),
        median=figure(both, lambda rows: median(rows[..., 0] / rows[..., 1]), seed=seed),
        unknown=len(unknown),
        least=figure(_pairs(least), _ratio, seed=seed),
        unseen=len(unseen),
    )


def _pairs(ones: Sequence[Removed]) -> np.ndarray:
    """Shares and the oracle's, shape (recordings, 2)."""
    return np.array([[one.share, one.oracle] for one in ones]).reshape(-1, 2)


def _ratio(rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows[..., 0].mean(axis=1) / rows[..., 1].mean(axis=1))


def errors(rows: Sequence[Row], parameters: Sequence[Parameter], seed: int = 0) -> list[Error]:
    """Errors of the parameters where effects were named; last, their mean over all parameters."""
    made = [row for row in rows if row.named and _moved(row, parameters)]
    table = np.array([[_errors(row, one) for one in parameters] for row in made]).reshape(-1, len(parameters), 2)
    names = [one.name for one in parameters]
    found = [_error(name, table[:, k], seed) for k, name in enumerate(names)]
    return [*found, _error("all parameters", table.mean(axis=1), seed)] if names else []


def _moved(row: Row, parameters: Sequence[Parameter]) -> bool:
    verdict = row.outcome.verdict
    return verdict is not None and all(
        one.name in verdict.parameters and verdict.parameters[one.name].after is not None for one in parameters
    )


def _errors(row: Row, parameter: Parameter) -> tuple[float, float]:
    assert row.outcome.verdict is not None
    moved, true = row.outcome.verdict.parameters[parameter.name], row.answer["parameters"][parameter.name]
    return _distance(moved.before, true, parameter), _distance(moved.after, true, parameter)


def _distance(value: float | None, true: float, parameter: Parameter) -> float:
    """Share of the range, shape (): on the parameter's own scale."""
    if value is None:
        return float("nan")
    if parameter.scale == "log":
        return float(abs(np.log(value / true)) / np.log(parameter.max / parameter.min))
    return abs(value - true) / (parameter.max - parameter.min)


def _error(name: str, pairs: np.ndarray, seed: int) -> Error:
    return Error(
        parameter=name,
        before=figure(pairs[:, 0], seed=seed),
        after=figure(pairs[:, 1], seed=seed),
        change=figure(pairs[:, 1] - pairs[:, 0], seed=seed),
    )
