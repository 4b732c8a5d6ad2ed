"""What a search says for and against each answer, in a few numbers: what an answer's probabilities are told from."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import Unfinished
from diagnosis.fitting.lines import Linearised
from diagnosis.fitting.refit import Refit
from diagnosis.gap.rivals import Rivals
from diagnosis.gap.stages import LEVEL, Stage

Names = tuple[str, ...]


@dataclass(frozen=True)
class Ranked:
    """What a candidate (the last of the names) is worth where the base model's fit began: its log evidence there."""

    names: Names
    evidence: float


@dataclass
class Made:
    """What a search has made, by what led to it: nothing is made twice, and a search among fewer candidates shares it.

    The first part of every key is the path of stages (:attr:`Search.path`) that led there. ``rivals``: all candidates
    where the base model's fit began, and the names of those that were asked. ``alike``: the foremost where the best of
    them is, by their names.
    ``refits``: of a second effect, by its name. ``renewed``: a refit linearised by the candidates that remain, by its
    effects' names and its unknowns' bytes. ``apart``: both lines of a fit to a part, by the bytes of what was fitted;
    its path is that of these stages alone. None is what cannot be simulated. ``first``: the base model's fit
    linearised by all candidates.
    """

    first: Linearised | None = None
    rivals: dict[Hashable, tuple[set[str], Rivals]] = field(default_factory=dict)
    alike: dict[tuple[Hashable, Names], Rivals] = field(default_factory=dict)
    refits: dict[tuple[Hashable, str], Refit] = field(default_factory=dict)
    renewed: dict[tuple[Hashable, Names, bytes], Linearised] = field(default_factory=dict)
    apart: dict[tuple[Hashable, bytes], tuple[Linearised, Linearised]] = field(default_factory=dict)


@dataclass
class Search:
    """All stages, the base model's fit, the refits made at each stage (best first), and why candidates were not tried.

    ``settled``: the best refit of each stage as the next stage has it.
    ``tried``: at the first stage what all candidates were worth where the base model's fit began; none at a later one.
    ``compared``: the foremost where the best of them is, and the base model there, whether or not a gap is there.
    ``confirmed``: whether what the straight line found at first is there in a refit, or in the residual itself.
    ``line``: the base model linearised where candidates begin.
    ``failed``: candidates whose simulation or algebra failed, at whatever step, and why. ``unfinished``: steps of the
    search that are lacking, and why; ``searched``: whether all candidates that stood out were refitted.
    ``dropped``: effects that were chosen and given up, because nothing shows that there is a gap.
    ``made``: what need not be made again.
    """

    stages: list[Stage]
    base: Refit
    line: Linearised
    refits: list[list[Refit]] = field(default_factory=list)
    settled: list[Refit] = field(default_factory=list)
    tried: list[Sequence[Ranked]] = field(default_factory=list)
    compared: Rivals | None = None
    excluded: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    unfinished: Unfinished = field(default_factory=Unfinished)
    searched: bool = True
    confirmed: bool = True
    dropped: tuple[str, ...] = ()
    made: Made = field(default_factory=Made)

    @property
    def path(self) -> Hashable:
        """What a refit depends on beside its own effect: of every stage, what was chosen, where it is, and the colours.

        The same effects come to another optimum where the colours are others.
        """
        return tuple(
            (tuple(e.name for e in one.lin.chosen), one.lin.z.tobytes(), tuple(sorted(one.colours.best.items())))
            for one in self.stages
        )

    @property
    def last(self) -> Stage:
        """The stage of the effects that were chosen."""
        return self.stages[-1]

    @property
    def chosen(self) -> tuple[Effect, ...]:
        """Effects that were chosen, in the order in which they were found."""
        return self.last.lin.chosen


def evidence_before(found: Search) -> float:
    """Log evidence of what was chosen so far, its amplitudes within their bounds as those of refits are."""
    stage = found.last
    if not found.settled:
        return stage.grams.evidence(stage.colours.best)
    return found.settled[-1].evidence_with(stage.colours.best)


@dataclass(frozen=True)
class Evidence:
    """What is known of a recording's gap when the search has ended.

    Attributes
    ----------
    replay, counted
        Whether actuators were replayed, and persons counted.
    strained
        Whether it has a parameter on an end of its range: the description is hardly that of the room.
    gap
        Whether bootstrap replicates tell of a gap at the base model's fit, and a refit where a candidate told of it.
    searched
        Whether all candidates that stood out were fitted.
    candidates
        Log evidence of each candidate over the base model, by name, 0 at least: as it was fitted last, chosen or not,
        and by straight lines where nothing was to be fitted.
    beside
        The same of a second effect, over the first alone; empty where none was found.
    chosen
        Effects that were chosen, in their order.
    rejected
        Whether bootstrap replicates tell of a gap beside what was chosen.
    before, left
        Gain in log evidence of a discrepancy without a cause, before anything was chosen and beside it.
    p_values
        Family-wise, by what was asked at the base model's fit.
    """

    replay: bool
    counted: bool
    strained: bool
    gap: bool
    searched: bool
    candidates: dict[str, float]
    beside: dict[str, float]
    chosen: tuple[str, ...]
    rejected: bool
    before: float
    left: float
    p_values: dict[str, float]

    @property
    def excess(self) -> float:
        """How much more log evidence a discrepancy has beside what was chosen, if anything was, than that took of it.

        0 where it has less, where bootstrap replicates do not reject what was chosen, and in a room that the
        description may be of: there a candidate that acts by a law of its own leaves as much.
        """
        return max(2 * self.left - self.before, 0.0) if self.rejected and self.strained else 0.0


def evidence_of(search: Search, gap: bool, rejected: bool, where_p: float) -> Evidence:
    """What a search says.

    Parameters
    ----------
    gap, rejected
        Whether there is a gap at the base model's fit, and beside what was chosen.
    where_p
        Family-wise p of where the base model's residual lies.
    """
    first, last = search.stages[0], search.last
    problem = first.lin.problem
    untried = {*search.excluded, *search.failed}
    values: list[dict[str, float]] = []
    for k, refits in enumerate(search.refits):
        later = [ones[0].names[-1] for ones in search.refits[k + 1 :]]
        values.append(
            worth(
                search.stages[k],
                refits,
                search.stages[k + 1],
                base=search.settled[k - 1] if k or search.compared is None else search.compared.base,
                tried=search.tried[k],
                later=later,
                excluded=untried,
            )
        )
    if not values and search.compared is not None:
        refits = [one for one in search.compared.refits if one.names[-1] not in untried]
        tried = [one for one in search.tried[0] if one.names[-1] not in untried]
        better = worth(first, refits, first, base=search.compared.base, tried=tried, excluded=untried)
        values = [{one.names[-1]: 0.0 for one in tried} | better]
    elif not values:
        found = zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True)
        values = [{name: one for name, one in found if name not in untried}]
    episode = first.episode.p_value if first.episode is not None else 1.0
    return Evidence(
        replay=bool(problem.replay),
        counted=not problem.nuisance.levels,
        strained=any(name in problem.system.parameter_names for name in search.base.at_bound),
        gap=bool(gap),
        searched=bool(search.searched),
        candidates=_at_least_none(values[0]),
        beside=_at_least_none(values[1]) if len(values) > 1 else {},
        chosen=tuple(one.name for one in last.lin.chosen),
        rejected=bool(rejected),
        before=float(first.left_over),
        left=float(last.left_over),
        p_values={
            "candidates": float(first.scan.p_value),
            "misfit": float(first.scan.misfit_p),
            "episode": float(episode),
            "where": float(where_p),
        },
    )


def _at_least_none(values: dict[str, float]) -> dict[str, float]:
    """Log evidence of candidates, at least that of the model without them, which each contains: its amplitude may be 0.

    Where one is judged to be far worse, its fit did not reach what it could.
    """
    return {name: max(one, 0.0) for name, one in values.items() if np.isfinite(one)}


def gap_found(stage: Stage, where_p: float, confirmed: bool = True) -> bool:
    """Whether model and recording differ in any of four ways, each against the same twins.

    A candidate that the straight line finds is a gap if a refit confirmed it (:attr:`.search.Search.confirmed`).
    A place alone is a gap only if a discrepancy without a cause is strong evidence, too: people who come and go within
    a step scatter more widely than the twins' do.
    """
    placed = where_p <= LEVEL / 2 and stage.discrepancy
    return (stage.candidate_found and confirmed) or stage.misfits or stage.episodic or placed


def worth(
    stage: Stage,
    refits: list[Refit],
    after: Stage,
    *,
    base: Refit | None = None,
    tried: Sequence[Ranked] = (),
    later: Collection[str] = (),
    excluded: Collection[str] = (),
) -> dict[str, float]:
    """Log evidence of a stage's candidates over the model without them, with the error that the best leaves.

    What was not fitted as others were is judged as before, moved by what these gained by it (the median), and is no
    better than the last of them.

    Parameters
    ----------
    refits
        Of the stage, the best first.
    after
        The stage with the best of them.
    base
        The model without them, fitted as they were; without, evidences are up to a constant.
    tried
        All that were looked at, as they were worth where the base model's fit began; without, the straight line counts.
    later
        Effects that were found beside it: they are no alternatives to it.
    excluded
        What could not be tried, beside what failed at this stage: only if it was refitted is it an alternative.
    """
    value = {one.names[-1]: one.evidence_with(after.discrepant) for one in refits}
    linear = dict(zip((one.name for one in stage.lin.effects), stage.scan.evidence.tolist(), strict=True))
    known = {one.names[-1]: one.evidence for one in tried} or linear
    gains = [one - known[name] for name, one in value.items() if name in known]
    if gains:
        gain, last = float(np.median(gains)), min(value.values())
        value = {name: min(one + gain, last) for name, one in known.items()} | value
    unknown = {*excluded, *stage.lin.failed} - {one.names[-1] for one in refits}
    without = 0.0 if base is None else base.evidence_with(after.discrepant)
    return {name: one - without for name, one in value.items() if name not in {*later, *unknown}}
