"""Which systems a run has seen, as its card says it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import BaseModel, field_serializer, field_validator

from shared.store import Records
from trainer.runs.spans import packed, unpacked


class Systems(BaseModel, extra="forbid"):
    """Systems of a dataset: with the system hash, (root seed, index) is what a simulated system is."""

    root_seeds: list[int]
    """of each system: a merged dataset has several"""
    indices: list[int]

    @field_serializer("root_seeds", "indices", when_used="json")
    def _pack(self, numbers: list[int]) -> str:
        return packed(numbers)

    @field_validator("root_seeds", "indices", mode="before")
    @classmethod
    def _unpack(cls, found: Any) -> Any:
        return unpacked(found) if isinstance(found, str) else found

    @classmethod
    def of(cls, records: Records, rows: np.ndarray) -> Systems:
        """The systems in some rows of records."""
        return cls._of_pairs(zip(records.seeds[rows].tolist(), records.systems[rows].tolist(), strict=True))

    @classmethod
    def _of_pairs(cls, pairs: Iterable[tuple[int, int]]) -> Systems:
        """In order, so that their numbers are few runs where they are written."""
        ordered = sorted((int(seed), int(index)) for seed, index in pairs)
        return cls(root_seeds=[seed for seed, _ in ordered], indices=[index for _, index in ordered])

    def rows_in(self, records: Records) -> np.ndarray:
        """Which rows of records are of these systems; bool (systems,)."""
        known = set(zip(self.root_seeds, self.indices, strict=True))
        rows = zip(records.seeds, records.systems, strict=True)
        return np.array([(int(seed), int(index)) in known for seed, index in rows], dtype=bool)

    def with_those(self, others: Systems) -> Systems:
        """These, and those of ``others`` that are not among them."""
        pairs = [zip(one.root_seeds, one.indices, strict=True) for one in (self, others)]
        return self._of_pairs({*pairs[0], *pairs[1]})
