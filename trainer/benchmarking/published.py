"""Another work's figures beside ours: a JSON file, because a figure belongs to a system and the code knows none.

    {"source": "...", "figures": [{"part": "table4", "labels": ["24", "lstm"], "r2": {"parameter": 0.9}, "mean": 0.9}]}

``labels`` are those of a line of ours; ``r2`` by parameter and ``mean`` over them are both optional.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel

from shared.errors import EstimatorError
from shared.reading import read_json, validated
from shared.shipped import resolved

PUBLISHED = "published.json"
"""File beside a description that comes with the package."""


class Figure(BaseModel, extra="forbid"):
    """R2 of one line of one part."""

    part: str
    labels: list[str]
    r2: dict[str, float] = {}
    mean: float | None = None


class Published(BaseModel, extra="forbid"):
    """The file."""

    source: str = ""
    figures: list[Figure] = []

    def find(self, part: str, labels: tuple[str, ...], parameter: str | None) -> float | None:
        """R2 of a parameter, or the mean over them where ``parameter`` is None; None where nothing was published."""
        for one in self.figures:
            if (one.part, tuple(one.labels)) == (part, labels):
                if parameter is not None:
                    return one.r2.get(parameter)
                if one.mean is None and one.r2:
                    return sum(one.r2.values()) / len(one.r2)
                return one.mean
        return None


def read_published(path: Path | None) -> Published:
    """Read such a file, or the one of a system that comes with the package; nothing is published where there is none.

    Raises EstimatorError if a file that was named cannot be read.
    """
    if path is None:
        return Published()
    found = resolved(path)
    path = found / PUBLISHED if found.is_dir() else found
    expected = f"published figures as JSON, or the name of a system that comes with {PUBLISHED}"
    return validated(Published, read_json(path, EstimatorError, expected), f"{path}", EstimatorError, expected)
