"""Everything about where the gap lies, in one call and one result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.scores import Guideline14, guideline14
from diagnosis.where.cells import CellTest, scan_cells
from diagnosis.where.correlation import CorrelationTest, scan_correlations
from diagnosis.where.episodes import EpisodeTest, scan_episodes
from diagnosis.where.finding import Finding
from diagnosis.where.regimes import Regime
from diagnosis.where.series import Residuals
from diagnosis.where.significance import MaxTest, combine, rank_p
from diagnosis.where.source import Operator, SourceTest, Verdict
from diagnosis.where.sources import scan_sources


@dataclass(frozen=True)
class Where:
    """Result of :func:`locate`. ``whole`` is one test of all families; ``families`` their names, in its order."""

    residuals: Residuals
    cells: CellTest
    correlations: CorrelationTest | None
    episodes: EpisodeTest
    sources: SourceTest | None
    guideline: list[Guideline14]
    families: list[str]
    whole: MaxTest
    alpha: float = 0.05

    @property
    def p_value(self) -> float:
        """One family-wise p for all that was looked at: small means that something lies beyond what twins show."""
        return self.whole.p_value

    @property
    def findings(self) -> list[Finding]:
        """Findings that stand when all families are tested at once: cells, episodes, correlations, sources."""
        by_family = {
            "cells": self.cells.findings,
            "episodes": self.episodes.findings,
            "correlations": self.correlations.findings if self.correlations is not None else [],
            "sources": self.sources.findings if self.sources is not None else [],
        }
        found = []
        for name, ones in by_family.items():
            for one in ones:
                p_value = float(self._p_of_all(name, abs(one.t)))
                if p_value <= self.alpha:
                    found.append(replace(one, p_value=p_value))
        return found

    def alpha_in(self, family: str) -> float:
        """A family's own p up to which its places stand among all families: what its pictures mark; -1 if none does."""
        tests: dict[str, CellTest | EpisodeTest | CorrelationTest | None] = {
            "cells": self.cells,
            "episodes": self.episodes,
            "correlations": self.correlations,
        }
        one = tests[family]
        if one is None:
            return -1.0
        some = one.test.adjusted <= self.alpha
        stands = self._p_of_all(family, np.abs(one.test.t[some])) <= self.alpha
        return float(one.test.adjusted[some][stands].max(initial=-1.0))

    def _p_of_all(self, family: str, size: float | np.ndarray) -> np.ndarray:
        """Family-wise p over all families of studentised values in one of them, of the same shape."""
        if family not in self.families:
            return np.ones(np.shape(size))
        j = self.families.index(family)
        if not self.whole.kept[j]:
            return np.ones(np.shape(size))
        t = (np.asarray(size) - self.whole.typical[j]) / self.whole.spread[j]
        return rank_p(t, self.whole.maxima[1:])

    @property
    def verdict(self) -> Verdict:
        """Whether a balance or a sensor is off; ``none`` when sources and sensors explain no more than in twins."""
        if self.sources is None or self._p_of_all("sources", float(self.sources.test.maxima[0])) > self.alpha:
            return "none"
        return self.sources.verdict


def locate(
    residuals: Residuals,
    *,
    inputs: Mapping[str, np.ndarray],
    measured: np.ndarray,
    regimes: Sequence[Regime] = (),
    operators: Sequence[Operator] = (),
    left: Callable[[np.ndarray], np.ndarray] | None = None,
    alpha: float = 0.05,
) -> Where:
    """Find where a recording differs from its calibrated model by more than the model's own twins do from theirs.

    Parameters
    ----------
    inputs
        Recorded inputs by name, each (steps,).
    measured
        Recorded outputs, shape (outputs, steps), for the figures of Guideline 14.
    regimes
        From :func:`~diagnosis.where.regimes.find_regimes`.
    operators, left
        Responses to missing sources, and what calibration leaves of series that are added to the outputs; without
        operators no source is sought.
    alpha
        Family-wise level of what is reported.
    """
    cells = scan_cells(residuals, regimes, alpha=alpha)
    episodes = scan_episodes(residuals, alpha=alpha)
    correlations = scan_correlations(residuals, inputs, alpha=alpha)
    sources = scan_sources(residuals, operators, left=left, alpha=alpha) if operators else None
    tests = {
        "cells": cells.test,
        "correlations": correlations.test if correlations is not None else None,
        "episodes": episodes.test,
        "sources": sources.test if sources is not None else None,
    }
    used = {name: test for name, test in tests.items() if test is not None}
    found = Where(
        residuals=residuals,
        cells=cells,
        correlations=correlations,
        episodes=episodes,
        sources=sources,
        guideline=[
            guideline14(residuals.names[k], residuals.units[k], measured[k], residuals.observed[k], residuals.step)
            for k in residuals.measured
        ],
        families=list(used),
        whole=combine(list(used.values())),
        alpha=alpha,
    )
    if sources is None or found.verdict != "none":
        return found
    return replace(found, sources=replace(sources, stands=False))
