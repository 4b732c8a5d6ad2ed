"""What a search says for and against each answer, in a few numbers: what an answer's probabilities are told from."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.gap.searched import Search
from diagnosis.gap.weighing import worth


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
        Whether bootstrap replicates tell of a gap at the base model's fit; ``confirmed``: whether a refit does, too.
    candidates
        Log evidence of each candidate over the base model, by name: as it was fitted last, by straight lines where
        nothing was to be fitted.
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
    confirmed: bool
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
                base=search.compared.base if k == 0 and search.compared is not None else search.settled[k - 1],
                tried=search.tried[k],
                later=later,
                excluded=untried,
            )
        )
    if not values:
        found = zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True)
        values = [{name: one for name, one in found if name not in untried}]
    episode = first.episode.p_value if first.episode is not None else 1.0
    return Evidence(
        replay=bool(problem.replay),
        counted=not problem.nuisance.levels,
        converged=bool(search.base.settled),
        gap=bool(gap),
        confirmed=bool(search.confirmed),
        candidates={name: float(one) for name, one in values[0].items()},
        beside={name: float(one) for name, one in values[1].items()} if len(values) > 1 else {},
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
