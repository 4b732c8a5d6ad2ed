"""Sources that would close a residual: what they do to the outputs, and what was found of them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from diagnosis.where.finding import Finding
from diagnosis.where.significance import MaxTest

STRONG = 3.0
"""Log likelihood ratio that Kass and Raftery (1995) call strong."""

SUSPECT = "suspect that sensor"
FAINT = "too little for a gap"
OTHERWISE = "that is of the base model, and the answer explains it otherwise"
"""Of a source whose rival, or of a sensor whose source, is beside the answer."""

Verdict = Literal["balance", "sensor", "undecided", "none"]


@dataclass(frozen=True)
class Operator:
    """Response of the outputs to a source, linearised at the calibrated model.

    ``response`` (outputs, steps, pulses) [unit of the output per unit of the source]; pulse ``j`` holds from
    ``edges[j]`` to ``edges[j + 1]`` [s].
    """

    name: str
    label: str
    unit: str
    response: np.ndarray
    edges: np.ndarray


@dataclass(frozen=True)
class Source:
    """A source that would close the residual.

    ``estimate``, ``uncertainty`` (pulses,) [unit]: posterior mean and standard deviation; ``low``, ``high``: where 95 %
    of the twins' lie, which have no gap. ``adjusted`` (pulses,): family-wise p of each pulse. ``gain``: log
    likelihood over noise alone; ``p_value`` of that against the twins. ``roughness``: von Neumann's ratio of the source
    estimated without any smoothness asked of it: 0 a smooth series, 2 white noise, towards 4 a derivative of spikes;
    ``roughness_p``: how rarely a twin is rougher. ``rival``: the channel, of those that the source moves, whose own
    error explains most; ``balance``: the source's gain less the rival's. ``verdict``: ``balance``, ``sensor``,
    ``undecided`` by that difference, or ``none`` when neither explains more than in twins.
    """

    name: str
    label: str
    unit: str
    edges: np.ndarray
    estimate: np.ndarray
    uncertainty: np.ndarray
    low: np.ndarray
    high: np.ndarray
    adjusted: np.ndarray
    gain: float
    p_value: float
    roughness: float
    roughness_p: float
    rival: str
    balance: float
    verdict: Verdict

    def needed(self, alpha: float = 0.05) -> bool:
        """Whether the source itself explains more than in twins, whatever its rival does."""
        return self.p_value <= alpha


@dataclass(frozen=True)
class SourceTest:
    """Result of :func:`scan_sources`.

    ``sensor_gains``: log likelihood over noise, by channel, of an error on that channel alone; ``suspect``: the channel
    of which it explains most of all, if that is more than in twins. The cells of ``test`` are the sources, then the
    sensors. ``stands``: whether what they explain is more than in twins when all other places are tested with them.
    """

    test: MaxTest
    sources: list[Source]
    sensor_gains: dict[str, float]
    suspect: str | None
    findings: list[Finding]
    stands: bool = True

    def words(self, one: Source, rival: str, alpha: float = 0.05, *, answered: Collection[Verdict] = ()) -> str:
        """What the tests say of a source and its rival, whose label is given; goes on after the source's own label.

        Where a source explains no more than in twins, its rival may still be what another source explains better: a
        sensor is suspected only where the sensors' own test says so, of all sources and sensors together.
        All that is of the base model alone: ``answered`` says of which sort the effects are that an answer names, which
        were fitted with the parameters and are not contradicted; "none" where the answer is that there is no gap.
        """
        if one.verdict == "none":
            return "explains no more than in replicates without a gap"
        # a page that finds no place must not name a sensor or a balance
        suspected = self.stands and self.verdict == "sensor" and self.suspect == one.rival
        suspect = OTHERWISE if "balance" in answered else SUSPECT
        off = OTHERWISE if "sensor" in answered else "this balance is off"
        if "none" in answered:
            suspect = off = FAINT
        if not one.needed(alpha):
            instead = f"; an error of {rival} alone explains more: {suspect}" if suspected else ""
            return f"explains no more than in replicates without a gap: none of it is needed{instead}"
        if not self.stands:
            return "explains more than in replicates without a gap, but not once all places are tested together"
        if one.verdict == "balance":
            better = f"explains the residual better than an error of {rival} alone"
            return f"{better}: {off}" if self.verdict == "balance" else better
        if one.verdict == "undecided":
            return f"and an error of {rival} alone explain the residual about equally well"
        worse = f"explains the residual worse than an error of {rival} alone"
        return f"{worse}: {suspect}" if suspected else worse

    @property
    def verdict(self) -> Verdict:
        """That of the source which, with its rival, explains most, unless a sensor that no source moves explains more.

        Of sources that one and the same sensor can be mistaken for, the one that itself explains most. Parameters that
        make up for such a sensor's error leave in other channels what looks like a source.
        """
        foremost = max(self.sources, key=lambda one: (max(one.gain, self.sensor_gains[one.rival]), one.gain))
        if self.suspect is None or self.suspect == foremost.rival:
            return foremost.verdict
        balance = foremost.gain - self.sensor_gains[self.suspect]
        return foremost.verdict if balance > STRONG else verdict_of(balance)


def verdict_of(balance: float) -> Verdict:
    """Whether a source or a sensor explains more, by the log likelihood of the one over the other."""
    return "balance" if balance > STRONG else "sensor" if balance < -STRONG else "undecided"
