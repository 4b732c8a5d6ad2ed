"""Systems that could not be simulated: ``failures.jsonl``, one line each, with what it takes to try again by hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from shared.errors import DatasetError
from shared.reading import parse_json, read_text, short, validated
from shared.store import MOST_MANIFEST, write_atomically

FILE_NAME = "failures.jsonl"
MOST = MOST_MANIFEST
"""Bytes; every system of a dataset may have failed."""
_MOST_CAUSE = 2000
"""Characters; an FMU may say what it likes, and does so anew for each system."""


class _Record(BaseModel, extra="allow"):
    """A line; ``parameters`` and ``cause`` are for people."""

    root_seed: int
    system: int


class Failures:
    """The failures of a dataset: ``system``, ``root_seed``, ``parameters``, ``cause``; one per system."""

    def __init__(self, records: Iterable[dict[str, Any]] = ()) -> None:
        self._by_system: dict[tuple[int, int], dict[str, Any]] = {}
        for record in records:
            self.put(record)

    @classmethod
    def read(cls, folder: Path) -> Failures:
        """Read a dataset's failures; none if the file is not there.

        Raises DatasetError if a line cannot be read.
        """
        path = folder / FILE_NAME
        expected = "one JSON object a line, made by `datagen run`"
        if not path.exists():
            return cls()
        lines = read_text(path, DatasetError, expected, most=MOST).split("\n")
        found = []
        for number, line in enumerate(lines, 1):
            if line.strip():
                where = f"{path}: line {number}"
                found.append(validated(_Record, parse_json(line, where, DatasetError, expected), where, DatasetError))
        return cls(one.model_dump() for one in found)

    def write(self, folder: Path) -> None:
        """Write ``failures.jsonl`` whole, in the order of the systems."""
        text = "".join(json.dumps(self._by_system[key]) + "\n" for key in sorted(self._by_system))
        write_atomically(folder / FILE_NAME, text.encode())

    def put(self, record: dict[str, Any]) -> None:
        """Add a failure in place of the one of the same system; of a long cause the beginning and the end."""
        cause = record.get("cause")
        if isinstance(cause, str):
            record = {**record, "cause": short(cause, _MOST_CAUSE)}
        self._by_system[record["root_seed"], record["system"]] = record

    def drop(self, root_seed: int, systems: Iterable[int]) -> int:
        """Forget the failures of some systems; returns how many there were."""
        return sum(self._by_system.pop((root_seed, index), None) is not None for index in systems)

    def __contains__(self, key: tuple[int, int]) -> bool:
        return key in self._by_system

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter([self._by_system[key] for key in sorted(self._by_system)])

    def __len__(self) -> int:
        return len(self._by_system)
