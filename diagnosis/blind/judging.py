"""The diagnosis as the blind check asks it: a recording and its public conditions in, a verdict out.

The only module of the blind check that knows the diagnosis itself. It can be replaced by any other that judges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from diagnosis.blind.source import source_sha256
from diagnosis.blind.verdicts import Moved, Place, Shrunk, Sized, Verdict
from shared.system import System

if TYPE_CHECKING:
    from diagnosis.effects import Effect
    from diagnosis.gap.concluded import Diagnosis
    from diagnosis.gap.schema import Report


class Judged(Protocol):
    """A recording that was judged, and can be judged again with less."""

    @property
    def verdict(self) -> Verdict:
        """With all candidates of the judge."""
        ...

    def without(self, name: str) -> Verdict:
        """With one candidate fewer."""
        ...


class Judge(Protocol):
    """What judges recordings. It must survive being pickled: every recording is judged in a process of its own."""

    def __call__(self, recording: Path, *, replay: bool, occupancy: str) -> Judged:
        """Judge one recording; the conditions are those that were published with it."""
        ...


@dataclass(frozen=True)
class Diagnoser:
    """Judges by :func:`diagnosis.gap.diagnosed.diagnose`.

    Parameters
    ----------
    without
        Candidates that are not to be considered at all.
    estimator
        Folder of an estimator, whose zero-shot estimate is the first start.
    seed
        Of twins, placebos and bootstraps.
    """

    system: System
    without: tuple[str, ...] = ()
    estimator: Path | None = None
    seed: int = 0

    def __call__(self, recording: Path, *, replay: bool, occupancy: str) -> Judged:
        """See :class:`Judge`."""
        return _Diagnosed(self, recording, replay, occupancy)

    def effects(self) -> list[Effect]:
        """The candidates that are left."""
        from diagnosis.effects import library

        return [one for one in library(self.system) if one.name not in self.without]


@dataclass(frozen=True)
class _Diagnosed:
    judge: Diagnoser
    recording: Path
    replay: bool
    occupancy: str

    @cached_property
    def done(self) -> Diagnosis:
        """The diagnosis with all candidates of the judge."""
        from diagnosis.gap.diagnosed import diagnose

        return diagnose(
            self.judge.system,
            self.recording,
            run=self.judge.estimator,
            replay=self.replay,
            occupancy=self.occupancy,
            effects=self.judge.effects(),
            seed=self.judge.seed,
        )

    @property
    def verdict(self) -> Verdict:
        return verdict_of(self.done.report)

    def without(self, name: str) -> Verdict:
        return verdict_of(self.done.without([name]).report)


def verdict_of(report: Report) -> Verdict:
    """What a score needs of ``report.json``."""
    probabilities = {one.name: one.probability for one in report.effects}
    return Verdict(
        verdict=report.verdict,
        probabilities=probabilities,
        none=report.none_of_these,
        nothing=report.no_gap,
        mistaken=report.mistaken,
        named=[one.name for one in report.effects if one.named],
        chosen=list(report.stages[-1].effects),
        sets=report.sets,
        alike={one.name: one.confusable for one in report.detectability},
        smallest={one.name: one.smallest for one in report.detectability},
        sizes={
            one.name: Sized(value=one.amplitude, low=one.low, high=one.high)
            for one in report.effects
            if one.named and one.amplitude is not None and one.low is not None and one.high is not None
        },
        where=[Place(channel=one.channel, kind=one.kind, cell=one.cell, p_value=one.p_value) for one in report.where],
        shrinkage={
            one.channel: Shrunk(share=one.share, low=one.low, high=one.high, before=one.before, floor=one.floor)
            for one in report.shrinkage
        },
        parameters={
            one.name: Moved.model_validate({key: getattr(one, key) for key in Moved.model_fields})
            for one in report.parameters
        },
        simulations=report.simulations,
        rejected=report.rejected,
        left_over=[one.left_over for one in report.stages],
    )


def program() -> str:
    """The sha256 of all source that a verdict depends on, so that two programs' verdicts are not mixed.

    Of the blind check that is what makes a verdict of a report: this module, and what a verdict is.
    """
    own = {f"diagnosis/blind/{name}.py" for name in ("judging", "verdicts")}
    return source_sha256(
        "shared",
        "datagen",
        "trainer",
        "diagnosis",
        counts=lambda path: path in own or not path.startswith("diagnosis/blind/"),
    )
