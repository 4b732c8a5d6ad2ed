"""Cells of a table that end in a unit, as ``20.1 °C`` or ``1.2 kW``: what some dashboards export."""

from __future__ import annotations

import numpy as np
import pandas as pd

from diagnosis.measurements.units import convert
from diagnosis.measurements.vocabulary import measured_in, unit_in
from shared.errors import RecordingError

_FIRST = 20
"""Cells that are looked at before a column is."""
_MOST = 0.5
"""Share of a column's cells that end in a unit where it is one of such."""
_NUMBER = r"([+\-\u2212]?\d(?:[\d.,\s'\u2019]*\d)?)\s*([^\W\d_][^\s\d]*[23]?(?:/[^\W\d_]+[23]?)?|%|[°º]\s?[CFK])"


def bare(column: pd.Series, decimal: str, missing: list[str]) -> tuple[pd.Series, str]:
    """A column of text (rows,) without the unit that its cells end in, and that unit; as it is if they have none.

    Where cells have several units of one kind, all become numbers in that of most of them.

    >>> bare(pd.Series(["950 W", "1.2 kW", "800 W"]), ".", [])[0].tolist()
    ['950', '1200', '800']
    """
    text = column.str.strip()
    there = text.notna() & (text != "") & ~text.isin(missing)
    if not there.any() or text[there].head(_FIRST).str.fullmatch(_NUMBER).mean() <= _MOST:
        return column, ""
    parts = text.str.extract(f"^{_NUMBER}$")
    units = parts[1].map({one: _known(one) for one in parts[1].dropna().unique()})
    good = units.notna() & (units != "")
    if not good.any() or good.sum() <= _MOST * there.sum():
        return column, ""
    main = str(units[good].value_counts().idxmax())
    made = column.where(~good, parts[0])
    for unit in units[good & (units != main)].unique():
        rows = good & (units == unit)
        numbers = pd.to_numeric(parts[0][rows].str.replace(decimal, "."), errors="coerce")
        try:
            values = convert(numbers.to_numpy(dtype=np.float64), unit, main, density=1.2, where="")
        except RecordingError:  # of another kind: no column of one quantity
            return column, ""
        texts = [f"{one:.9g}".replace(".", decimal) for one in values]
        made[rows] = np.where(np.isfinite(values), texts, column[rows])
    return made, main


def _known(unit: str) -> str:
    """A unit in the spelling of the vocabulary; empty if it has none that something is measured in."""
    found = unit_in("", unit)[0]
    return found if measured_in(found) else ""
