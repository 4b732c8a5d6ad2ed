"""Systems that could not be simulated: ``failures.jsonl``, one line each, with what it takes to try again by hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from shared.errors import DatasetError
from shared.store import write_atomically

FILE_NAME = "failures.jsonl"


class Failures:
    """The failures of a dataset: ``system``, ``root_seed``, ``parameters``, ``cause``; one per system."""

    def __init__(self, records: Iterable[dict[str, Any]] = ()) -> None:
        self._by_system: dict[tuple[int, int], dict[str, Any]] = {}
        for record in records:
            self.put(record)

    @classmethod
    def read(cls, folder: Path) -> Failures:
        """Read a dataset's failures; none if the file is not there.

        Raises
        ------
        DatasetError
            If a line cannot be read.
        """
        path = folder / FILE_NAME
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
            return cls(json.loads(line) for line in lines if line.strip())
        except FileNotFoundError:
            return cls()
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise DatasetError(f"{path}: not a list of failures: {error}; expected one JSON object a line") from None

    def write(self, folder: Path) -> None:
        """Write ``failures.jsonl`` whole, in the order of the systems."""
        text = "".join(json.dumps(self._by_system[key]) + "\n" for key in sorted(self._by_system))
        write_atomically(folder / FILE_NAME, text.encode())

    def put(self, record: dict[str, Any]) -> None:
        """Add a failure in place of the one of the same system."""
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
