"""What a search says for and against each answer, in a few numbers: what an answer's probabilities are told from."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.gap.refit import Refit
from diagnosis.gap.searched import Judged, Search
from diagnosis.gap.stages import LEVEL, Stage


@dataclass(frozen=True)
class Evidence:
    """What is known of a recording's gap when the search has ended.

    Attributes
    ----------
    replay, counted
        Whether actuators were replayed, and persons counted.
    converged
        Whether the base model's fit came to rest.
    gap
        Whether bootstrap replicates tell of a gap at the base model's fit, and a refit where a candidate told of it.
    searched
        Whether all candidates that stood out were fitted.
    candidates
        Log evidence of each candidate over the base model, by name: as it was fitted last, chosen or not, and by
        straight lines where nothing was to be fitted.
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
    converged: bool
    gap: bool
    searched: bool
    candidates: dict[str, float]
    beside: dict[str, float]
    chosen: tuple[str, ...]
    rejected: bool
    before: float
    left: float
    p_values: dict[str, float]


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
        refits, tried = list(search.compared.refits), search.tried[0]
        values = [worth(first, refits, first, base=search.compared.base, tried=tried, excluded=untried)]
    elif not values:
        found = zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True)
        values = [{name: one for name, one in found if name not in untried}]
    episode = first.episode.p_value if first.episode is not None else 1.0
    return Evidence(
        replay=bool(problem.replay),
        counted=not problem.nuisance.levels,
        converged=bool(search.base.settled),
        gap=bool(gap),
        searched=bool(search.searched),
        candidates=_finite(values[0]),
        beside=_finite(values[1]) if len(values) > 1 else {},
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


def _finite(values: dict[str, float]) -> dict[str, float]:
    """Candidates whose evidence is a number."""
    return {name: float(one) for name, one in values.items() if np.isfinite(one)}


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
    tried: Sequence[Judged] = (),
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
