"""Draw the pictures of ``docs/benchmark.md`` that its tables have all figures of, so that both say the same.

    python docs/making/benchmark.py --page docs/benchmark.md --out docs/pictures

The run's own files are not kept. Ceilings were computed anew after the run, and stand in the tables.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from trainer.figures import Line, Point, draw_scores, draw_series

BARS = {"table4": "Table 4: estimators and context", "channels": "What each added sensor buys"}
SERIES = {"systems": "R2 against the number of training systems"}
PROTOCOLS = {"R2 paper": "paper", "R2 unseen": "unseen"}
SCORE = re.compile(r"(-?[\d.]+) ± [\d.]+ \[(-?[\d.]+), (-?[\d.]+)\]")


def lines_of(page: str, title: str) -> list[tuple[tuple[str, ...], dict[str, Point], float | None]]:
    """Rows of the first table below a heading: labels, a point for each protocol, and the ceiling."""
    section = page.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in section.splitlines() if row.startswith("|")]
    head, columns = rows[0], len(rows[0])
    first = head.index("R2 paper")
    found = []
    for row in rows[2:]:
        if len(row) != columns or not SCORE.fullmatch(row[first]):
            break  # the table by parameters
        points = {name: _point(row[head.index(column)]) for column, name in PROTOCOLS.items()}
        limit = row[head.index("ceiling")]
        found.append((tuple(row[:first]), points, None if limit == "-" else float(limit)))
    return found


def _point(cell: str) -> Point:
    match = SCORE.fullmatch(cell)
    if match is None:
        raise ValueError(f"{cell!r} is no score: expected '0.1 ± 0.01 [0.09, 0.12]'")
    return Point(*map(float, match.groups()))


def draw(page: str, folder: Path) -> None:
    """Draw all pictures into a folder."""
    for name, title in BARS.items():
        lines: list[Line] = [(" ".join(labels), points, limit) for labels, points, limit in lines_of(page, title)]
        draw_scores(lines, title, folder / f"benchmark-{name}.png")
    for name, title in SERIES.items():
        series: dict[tuple[str, str], list[tuple[float, Point]]] = {}
        limits = set()
        for (model, at), points, limit in lines_of(page, title):
            limits.add(limit)
            for protocol, point in points.items():
                series.setdefault((model, protocol), []).append((float(at), point))
        (limit,) = limits
        draw_series(series, "training systems", title, limit, folder / f"benchmark-{name}.png")


def main() -> None:
    """Draw the pictures of a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    draw(given.page.read_text(encoding="utf-8"), given.out)


if __name__ == "__main__":
    main()
