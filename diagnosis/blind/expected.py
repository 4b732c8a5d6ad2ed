"""What can be expected of a verdict, from the sealed answers alone: which gaps anybody could see, and tell apart.

A gap is **detectable** when its length beyond what parameters and nuisance imitate
(:mod:`diagnosis.blind.detectability`) is longer than that of 95 % of the set's recordings without any effect and with
the same actuators (the truth's walls are finer than the model's), by as much as an observer needs who knows the gap's
shape, looks for as many shapes as there are candidates at 5 % in all (Bonferroni), and is to see it in 90 % of cases.
It is **unlike** the candidates when the same holds of its length beyond any one of them, too: only then can "none of
these" be expected.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from diagnosis.blind.opened import QUANTILE, LeftOut, Row

ALARMS, POWER = 0.05, 0.9
MOST = 0.5
"""Share of a gap's squared length that a candidate must imitate for the gap to be of its kind."""

DETECTABLE = (
    "A gap is detectable when its length in units of the sensors' noise, beyond all that parameters and what else"
    " nobody is told can imitate (unmeasured inputs and, but in sets of older versions, uncertain constants and the"
    " errors of replayed meters, with the parameters fitted to the gap), exceeds that of 95 % of this set's"
    " recordings without any effect and with the same actuators (of twenty or fewer, of all) by as much as an"
    " observer needs who knows its shape among as many as there are candidates (5 % false alarms in all, 90 %"
    " power). It is unlike the candidates when that holds beyond any one of them as well (with parameters along"
    " straight lines, so that of a gap that fitted parameters shorten it says little); where the answer is an"
    " effect, beyond any other. It is of its candidate's kind when that candidate can imitate at least half of its"
    " square: another law may look like another effect, or like none. All were worked out when the set was made, and"
    " sealed with the answers."
)


class Expected:
    """Which recordings of a set are detectable, and which unlike the candidates.

    A set without sealed lengths has none.

    Parameters
    ----------
    answers
        Of all recordings of the set, also of those that nobody diagnosed.
    library
        The candidates.
    """

    def __init__(self, answers: Sequence[dict[str, Any]], library: Sequence[str]) -> None:
        self.library = library
        self.needed = float(norm.isf(ALARMS / max(len(library), 1)) + norm.ppf(POWER))
        nothing = [one for one in answers if one["verdict"] == "no_gap" and one.get("detectability") is not None]
        self.walls = {}
        for replay in (False, True):
            like = [one for one in nothing if one["replay"] == replay] or nothing
            lengths = [float(one["detectability"]["length"]) for one in like]
            self.walls[replay] = float(np.quantile(lengths, QUANTILE, method="higher")) if lengths else 0.0

    def detectable(self, row: Row) -> bool:
        """Whether a gap goes beyond what parameters and nuisance imitate."""
        return row.truth != "no_gap" and self._long(row, row.length)

    def unlike(self, row: Row, but: Iterable[str] = ()) -> bool:
        """Whether it goes beyond what any one candidate with them imitates, ``but`` for some."""
        if row.length is None or row.truth == "no_gap":
            return False
        beside = row.answer["detectability"]["beside"]
        lengths = [beside[name] for name in self.library if name in beside and name not in set(but)]
        return self._long(row, min(lengths, default=row.length))

    def of_its_kind(self, row: Row) -> bool:
        """Whether a single effect's own candidate imitates most of its gap."""
        beside = (row.answer["detectability"] or {}).get("beside", {}) if row.length else {}
        left = [beside[name] for name in row.effects if name in beside]
        return bool(left) and min(left) ** 2 <= (1 - MOST) * (row.length or 0.0) ** 2

    def left_out_unlike(self, one: LeftOut) -> bool:
        """Whether a gap whose candidate was withheld goes beyond what any other imitates."""
        return self.unlike(one.row, one.row.effects)

    def _long(self, row: Row, length: float | None) -> bool:
        return length is not None and length >= self.walls[row.answer["replay"]] + self.needed
