"""Everything about where the gap lies, in one call and one result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from diagnosis.where.cells import CellTest, Regime, scan_cells
from diagnosis.where.correlation import CorrelationTest, scan_correlations
from diagnosis.where.episodes import EpisodeTest, scan_episodes
from diagnosis.where.finding import Finding
from diagnosis.where.series import ALPHA, MaxTest, Residuals, combine, rank_p
from diagnosis.where.sources import Operator, SourceTest, Verdict, scan_sources


@dataclass(frozen=True)
class Where:
    """Result of :func:`locate`. ``whole`` is one test of all families; ``families`` their names, in its order."""

    residuals: Residuals
    cells: CellTest
    correlations: CorrelationTest | None
    episodes: EpisodeTest
    sources: SourceTest | None
    families: list[str]
    whole: MaxTest

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
                p_value = max(float(self._p_of_all(name, abs(one.t))), one.p_value)
                if p_value <= ALPHA:
                    found.append(replace(one, p_value=p_value))
        return found

    def among_all(self) -> Where:
        """The same, each place's p over all families: what pictures mark is then what :attr:`findings` names."""
        episodes = [
            replace(one, p_value=max(float(self._p_of_all("episodes", abs(one.t))), one.p_value))
            for one in self.episodes.findings
        ]
        return replace(
            self,
            cells=replace(self.cells, test=self._told("cells", self.cells.test)),
            episodes=replace(self.episodes, test=self._told("episodes", self.episodes.test), findings=episodes),
            correlations=None
            if self.correlations is None
            else replace(self.correlations, test=self._told("correlations", self.correlations.test)),
        )

    def _told(self, family: str, test: MaxTest) -> MaxTest:
        return replace(test, adjusted=np.maximum(self._p_of_all(family, np.abs(test.t)), test.adjusted))

    def _p_of_all(self, family: str, size: float | np.ndarray) -> np.ndarray:
        """Family-wise p over all families of studentised values in one of them, of the same shape."""
        if family not in self.families:
            return np.ones(np.shape(size))
        j = self.families.index(family)
        if not self.whole.kept[j]:
            return np.ones(np.shape(size))
        t = (np.asarray(size) - self.whole.typical[j]) / self.whole.spread[j]
        return rank_p(t, self._twins)

    @cached_property
    def _twins(self) -> np.ndarray:
        """The largest of all families in each twin, against the twins alone, as the recording is: shape (twins,).

        In the maxima of the test itself each row has all others for its yardstick. A gap that is far beyond the twins
        would stretch theirs, and with it make all that is found beside it look surer than it is.
        """
        tests = {"cells": self.cells, "correlations": self.correlations, "episodes": self.episodes}
        by_name = {name: one.test for name, one in (tests | {"sources": self.sources}).items() if one is not None}
        maxima = np.stack([by_name[name].maxima[1:] for name in self.families], axis=1)[:, self.whole.kept]
        typical, spread = self.whole.typical[self.whole.kept], self.whole.spread[self.whole.kept]
        return np.asarray(((maxima - typical) / spread).max(axis=1, initial=-np.inf))

    @property
    def verdict(self) -> Verdict:
        """Whether a balance or a sensor is off; ``none`` when sources and sensors explain no more than in twins."""
        if self.sources is None or self._p_of_all("sources", float(self.sources.test.maxima[0])) > ALPHA:
            return "none"
        return self.sources.verdict


def locate(
    residuals: Residuals,
    *,
    inputs: Mapping[str, np.ndarray],
    regimes: Sequence[Regime] = (),
    operators: Sequence[Operator] = (),
    left: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Where:
    """Find where a recording differs from its calibrated model by more than the model's own twins do from theirs.

    Parameters
    ----------
    inputs
        Recorded inputs by name, each (steps,).
    regimes
        From :func:`~diagnosis.where.cells.find_regimes`.
    operators, left
        Responses to missing sources, and what calibration leaves of series that are added to the outputs; without
        operators no source is sought.
    """
    cells = scan_cells(residuals, regimes)
    episodes = scan_episodes(residuals)
    correlations = scan_correlations(residuals, inputs)
    sources = scan_sources(residuals, operators, left=left) if operators else None
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
        families=list(used),
        whole=combine(list(used.values())),
    )
    if sources is None or found.verdict != "none":
        return found
    return replace(found, sources=replace(sources, stands=False))
