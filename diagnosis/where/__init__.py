"""Where the gap lies: cells, episodes, correlations and missing sources, all against the pipeline's own twins.

:func:`locate` does everything; :class:`Residuals` is what it reads.
"""

from __future__ import annotations

from diagnosis.where.cells import Regime, find_regimes
from diagnosis.where.finding import Finding
from diagnosis.where.located import Where, locate
from diagnosis.where.series import Residuals
from diagnosis.where.sources import Operator

__all__ = ["Finding", "Operator", "Regime", "Residuals", "Where", "find_regimes", "locate"]
