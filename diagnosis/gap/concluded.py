"""What follows from the base model's fit to a recording: the search, the answer, and how far the gap shrinks."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from diagnosis.curves import curves, plot
from diagnosis.effects import Effect
from diagnosis.fitting.failures import NO_TIME
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.starting import Begun
from diagnosis.gap.evidence import evidence_of, gap_found
from diagnosis.gap.places import operators, place
from diagnosis.gap.reporting import Answered, Began, reported
from diagnosis.gap.schema import HOW_FAR, Report, ShrinkageOf
from diagnosis.gap.search import search
from diagnosis.gap.shrinkage import Apart, fitted_apart, left_by, shrinkages
from diagnosis.gap.verdict import decide
from diagnosis.verdicts import Verdicts
from diagnosis.where import Operator
from shared.results import Result

SOURCES = "what the balances may lack"


@dataclass(frozen=True, repr=False)
class Diagnosis(Result, Answered):
    """A diagnosis: its report, and all that it was made from."""

    report: Report

    def without(self, names: Collection[str]) -> Diagnosis:
        """The same recording diagnosed with some candidates withheld.

        The readings that count (a clock takes some from the ends), the fit of the base model, the sensitivities and
        what is missing from the balances are kept; colours, twins, scan and decision are made anew, and refits that
        were not made yet.
        """
        left = [one for one in self.candidates if one.name not in names]
        began = Began.now(self.whole.simulations)
        return concluded(self.whole, self.origin, left, self.scored, self.seed, began, self.by, self)

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        return self.report.headline

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each candidate: its probability, and its size with the 90 % interval if it was fitted."""
        return self.report.to_dataframe()

    def plot(self) -> Figure:
        """Measured, the base model, and the model with the chosen effects, output by output."""
        return plot(self.curves())

    def curves(self) -> xr.Dataset:
        """What was measured, the base model, and the model with the chosen effects if there are any."""
        first, last, record = self.search.stages[0], self.search.last, self.whole.recording
        before, after = first.twins.residual, None
        if last.lin.chosen:
            after = record.outputs - left_by(last.lin, last.colours, self.whole.observed)
        system = self.whole.system
        return curves(
            record.time,
            record.zero,
            system.outputs,
            measured=record.outputs,
            before=record.outputs - before,
            after=after,
        )


def concluded(
    whole: Problem,
    origin: Begun,
    candidates: list[Effect],
    scored: np.ndarray,
    seed: int,
    began: Began,
    by: tuple[Verdicts, str],
    known: Diagnosis | None = None,
) -> Diagnosis:
    """What follows from the base model's fit.

    Parameters
    ----------
    scored
        The part that is kept from the fits that say how far the gap shrinks, shape (steps,).
    began
        When the diagnosis began.
    by
        How evidence becomes an answer, from :func:`diagnosis.verdicts.verdicts_of`.
    known
        A diagnosis from the same fit among these candidates and others; what does not depend on the others is kept.
    """
    cut = whole.runner.time_up
    found = search(origin, candidates, whole.observed, seed=seed, known=None if known is None else known.search)
    if cut:
        found.unfinished.why = {"the base model's fit to its end": NO_TIME, **found.unfinished.why}
    attempt = found.unfinished.attempt
    first = found.stages[0]
    whole.runner.stage("finding where the gap lies")
    problem = first.lin.problem
    sources: list[Operator] = []
    unknown: dict[str, str] = {}
    if known is None:
        heights = first.lin.around.heights
        sources, unknown = attempt(SOURCES, lambda: operators(problem, first.lin.z, heights), (sources, unknown))
    else:
        sources, unknown = known.sources, known.unknown
    where = attempt(SOURCES, lambda: place(first, whole.observed, sources), None) or place(first, whole.observed, [])
    where_left = None
    if found.chosen:
        where_left = attempt("what is left, and where", lambda: place(found.last, whole.observed, []), None)
    left = gap_found(found.last, (where_left or where).p_value)
    evidence = evidence_of(found, gap_found(first, where.p_value, found.confirmed), left, where.p_value)
    decision = decide(evidence, by[0], own=not by[1])
    if found.chosen and decision.verdict == "no_gap":
        dropped = tuple(one.name for one in found.chosen)
        found, where_left = replace(found, stages=[first], refits=[], settled=[], dropped=dropped), None
    apart: Apart | None = None
    shrinkage: list[ShrinkageOf] = []
    if found.chosen and (whole.observed & ~scored).any():
        whole.runner.stage("scoring on a part that is kept from the fit")
        apart = attempt(HOW_FAR, lambda: fitted_apart(found, whole.observed & ~scored), None)
    if apart is not None:
        fits, colours = apart, found.last.colours
        shrinkage = attempt(
            HOW_FAR, lambda: shrinkages(fits, first, colours, scored, whole.observed, seed=seed), shrinkage
        )
    done = Answered(
        whole,
        origin,
        candidates,
        found,
        decision,
        evidence,
        by,
        sources,
        unknown,
        where,
        where_left,
        apart,
        shrinkage,
        scored,
        seed,
    )
    return Diagnosis(**vars(done), report=reported(done, began))
