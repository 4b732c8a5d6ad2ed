"""Tables of text: one row of cells a line, the first column names what the others are figures of."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table

Row = tuple[str, ...]


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def terminal_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, whole: int = 0) -> Table:
    """For the terminal, with a line above the last row, which sums up.

    Parameters
    ----------
    whole
        So many columns, from the first on, are never wrapped.
    """
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for k, name in enumerate(header):
        table.add_column(name, justify="left" if k == 0 else "right", no_wrap=k < whole)
    for k, row in enumerate(rows):
        table.add_row(*row, end_section=k == len(rows) - 2)
    return table
