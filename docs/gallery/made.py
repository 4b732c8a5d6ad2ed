"""What the scripts of the gallery write for their pages: tables in Markdown."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path


def table(columns: Sequence[str], rows: Iterable[Sequence[str | float]]) -> str:
    """A table in Markdown; numbers with three digits."""
    lines = [columns, ["---"] * len(columns)]
    lines += [[one if isinstance(one, str) else f"{one:.3g}" for one in row] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write(path: Path, *tables: str) -> None:
    """Write tables to a file and print them."""
    text = "\n".join(tables)
    path.write_text(text, encoding="utf-8")
    sys.stdout.write(text)
