"""Tables of text: one row of cells a line, the first column names what the others are figures of."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

Row = tuple[str, ...]
NONE = "-"


def number(value: float | None, digits: int = 3) -> str:
    """A number, or a dash where there is none."""
    return NONE if value is None or math.isnan(value) else f"{value:.{digits}f}"


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV, the first of names."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def terminal_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, width: int) -> Table:
    """For the terminal, with a line above the last row, which sums up.

    The last columns are left out, and named below, where figures would not fit ``width`` [characters].
    """
    count = len(header)
    while (table := _table(title, header, rows, count)) and count > 2 and _width_of(table) > width:
        count -= 1
    if count < len(header):
        table.caption = f"for lack of width in the files alone: {', '.join(header[count:])}"
    return table


def _table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], count: int) -> Table:
    """The first columns of a table; none of them is wrapped."""
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for k, name in enumerate(header[:count]):
        table.add_column(name, justify="left" if k == 0 else "right", no_wrap=True)
    for k, row in enumerate(rows):
        table.add_row(*row[:count], end_section=k == len(rows) - 2)
    return table


def _width_of(table: Table) -> int:
    """How wide a table is where there is room [characters], its title apart."""
    console = Console(width=1000)
    return Measurement.get(console, console.options, table).maximum
