"""The search for the cause: the best candidates refitted with the parameters, then, if more is left, a second effect.

Forward selection with the family's own null at each stage (Bacher and Madsen 2011 select grey-box models by
likelihood ratios; the null here is that of twins, Johansson 2014, and holds for all candidates together).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.fit import Fit
from diagnosis.gap.colours import estimated_colours
from diagnosis.gap.grams import Grams
from diagnosis.gap.linear import Linearised, applicable, linearised
from diagnosis.gap.nuisances import widened
from diagnosis.gap.refit import Refit, linear_start, refit
from diagnosis.gap.scan import NEGLIGIBLE
from diagnosis.gap.stages import LEVEL, Stage, examine
from shared.errors import SimulationError

MOST_REFITS = 6
LEAST_REFITS = 3
NEAR = 8.0
"""Log Bayes factor within which a candidate is as good as the best, as far as a straight line can tell."""
CLEAR = 5.0
"""Log Bayes factor that a further effect must reach."""
MOST_EFFECTS = 2
PARSIMONY = 0.6
"""A further effect must leave less than this share of what was left without a cause before it."""

Tell = Callable[[str], None]


@dataclass
class Search:
    """All stages, the base model's fit, the refits made at each stage (best first), and why candidates were not tried.

    ``simulations`` in all of the search.
    """

    stages: list[Stage]
    base: Refit
    refits: list[list[Refit]] = field(default_factory=list)
    excluded: dict[str, str] = field(default_factory=dict)
    simulations: int = 0

    @property
    def last(self) -> Stage:
        """The stage of the effects that were chosen."""
        return self.stages[-1]

    @property
    def chosen(self) -> tuple[Effect, ...]:
        """Effects that were chosen, in the order in which they were found."""
        return self.last.lin.chosen

    @property
    def share_left(self) -> float:
        """Share of what was left without a cause at first that the chosen effects do not explain."""
        first = max(self.stages[0].left_over, 1e-9)
        return float(np.clip(self.last.left_over / first, 0.0, 1.0)) if self.stages[0].left_over > 1.0 else 0.0


def search(
    base: Fit, effects: Sequence[Effect], observed: np.ndarray, size: np.ndarray, *, seed: int = 0, tell: Tell = print
) -> Search:
    """Search for the effects behind a gap, from the fit of the base model.

    Parameters
    ----------
    effects
        All candidates; those that cannot act here are left out and said why.
    observed
        Readings that take part, shape (outputs, steps).
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    problem, around, count = widened(base)
    usable, why = applicable(problem, effects)
    tell(f"sensitivities of {len(usable)} effects")
    one = settled(linearised(problem, base.z, around), observed, size)
    lin = linearised(one.lin.problem, one.lin.z, one.lin.around, usable, one.lin.by_unknown, one.lin.by_nuisance)
    count += one.simulations + lin.simulations
    found = Search([examine(lin, observed, size, seed=seed)], one, excluded=why, simulations=count)
    found.excluded |= dict.fromkeys(lin.failed, "its simulation fails")
    while len(found.chosen) < MOST_EFFECTS:
        stage = found.last
        if not stage.candidate_found:
            break
        first = not found.chosen
        refits = [one for one in refitted(stage, tell, found) if abs(one.lin.amplitudes[-1]) >= NEGLIGIBLE]
        if not refits:
            break
        best = refits[0]
        gain = best.evidence - stage.grams.evidence(stage.colours.best)
        if not first and gain < CLEAR:
            break
        after = examine(renewed(best, stage, effects, found), observed, size, seed=seed + len(found.stages))
        if not first and after.left_over > PARSIMONY * stage.left_over:
            break
        found.stages.append(after)
        found.refits.append(refits)
    return found


def settled(lin: Linearised, observed: np.ndarray, size: np.ndarray) -> Refit:
    """The base model's optimum with the colour of the noise and all nuisances, from a fit without them."""
    grams = Grams(lin, observed)
    one = refit(grams, estimated_colours(grams, size).best, lin.z, ())
    return replace(one, simulations=lin.simulations + one.simulations)


def refitted(stage: Stage, tell: Tell, found: Search) -> list[Refit]:
    """The most plausible candidates, each refitted with the parameters and with what was chosen before; best first."""
    best = stage.scan.evidence.max(initial=-np.inf)
    made = []
    for rank, j in enumerate(stage.scan.order[:MOST_REFITS]):
        close = rank < LEAST_REFITS or stage.scan.evidence[j] > best - NEAR
        if not close or stage.scan.ratio[j] <= 0:
            continue
        effect = stage.lin.effects[j]
        tell(f"refitting with {effect.name}")
        start = linear_start(stage.grams, stage.colours.best, [j])
        try:
            one = refit(stage.grams, stage.colours.best, start, [effect])
        except SimulationError:
            continue
        found.simulations += one.simulations
        made.append(one)
    return sorted(made, key=lambda one: -one.evidence)


def renewed(best: Refit, stage: Stage, effects: Sequence[Effect], found: Search) -> Linearised:
    """The refit linearised by the nuisance and all remaining candidates where it is."""
    problem = best.lin.problem
    counted = problem.simulations
    around = problem.linearise(best.lin.z, stage.lin.around.nuisance)
    usable, _ = applicable(problem, effects)
    # another response to the nuisance has another optimum
    grams = Grams(linearised(problem, best.lin.z, around), stage.grams.observed)
    one = refit(grams, stage.colours.best, best.lin.z, ())
    lin = linearised(one.lin.problem, one.lin.z, one.lin.around, usable, one.lin.by_unknown, one.lin.by_nuisance)
    found.simulations += problem.simulations - counted + grams.lin.simulations + one.simulations + lin.simulations
    return lin


__all__ = ["LEVEL", "MOST_EFFECTS", "Search", "search"]
