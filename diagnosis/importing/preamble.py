"""Lines of a measurement file that are no readings: what a logger writes above the column names, and units below."""

from __future__ import annotations

import csv
import io
import re
from itertools import islice
from pathlib import Path

import pandas as pd

from diagnosis.importing.mapping import File
from shared.errors import RecordingError
from shared.reading import shown

_LOOKED_AT = 200
"""Lines among which the column names are looked for."""


def skipped(text: str, settings: File, column: str) -> str:
    """What to skip so that the names are read, of a file in whose first lines ``column`` is named; else empty."""
    for number, line in enumerate(islice(io.StringIO(text), _LOOKED_AT)):
        try:
            names = next(csv.reader([line], delimiter=settings.separator), [])
        except (csv.Error, ValueError, TypeError):  # what csv does not take stands in no line of names
            continue
        if number != settings.skip and column in (one.strip() for one in names):
            return f"; the column names are in line {number + 1}: expected file.skip = {number}"
    return ""


def check_first_row(frame: pd.DataFrame, name: str, used: list[str], path: Path) -> None:
    """Refuse a first row that has neither a time nor numbers where the second has a time: units stand there.

    Parameters
    ----------
    frame
        Rows as text.
    name, used
        The column of the time stamps, and those that are mapped.

    Raises
    ------
    RecordingError
        Naming what the row holds.
    """
    first, second = (str(one).strip() for one in frame[name].iloc[:2])
    columns = [one for one in dict.fromkeys(used) if one in frame and one != name]
    cells = [str(frame[one].iloc[0]).strip() for one in columns if isinstance(frame[one], pd.Series)]
    if re.search(r"\d", first) or not re.search(r"\d", second) or any(re.match(r"[+-]?[.,]?\d", one) for one in cells):
        return
    found = ", ".join(shown(one) for one in [first, *cells[:3]])
    raise RecordingError(
        f"{path}: the row below the column names has no time and no numbers but {found}: units? expected readings:"
        " remove that line (the mapping says the units)"
    )
