"""Which systems a run has seen, as its card says it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, field_serializer, field_validator

from shared.store import Records

MOST = 10_000_000
"""Numbers of a list: a short text could stand for any number of them."""


def packed(numbers: Sequence[int]) -> str:
    """A list of whole numbers, none negative, as text: stretches that count up, and repetitions."""
    parts, k = [], 0
    while k < len(numbers):
        rise = k
        while rise + 1 < len(numbers) and numbers[rise + 1] == numbers[rise] + 1:
            rise += 1
        same = k
        while same + 1 < len(numbers) and numbers[same + 1] == numbers[k]:
            same += 1
        if same > k:
            parts.append(f"{numbers[k]}*{same - k + 1}")
        else:
            parts.append(f"{numbers[k]}-{numbers[rise]}" if rise > k else f"{numbers[k]}")
        k = max(rise, same) + 1
    return " ".join(parts)


def _size(part: str) -> int:
    """How many numbers a part stands for."""
    if "*" in part:
        return int(part.partition("*")[2])
    low, dash, high = part.partition("-")
    return int(high) - int(low) + 1 if dash else 1


def unpacked(text: str) -> list[int]:
    """What :func:`packed` made of a list.

    Raises ValueError if the text is not of that form, or stands for more than :data:`MOST` numbers.
    """
    numbers: list[int] = []
    for part in text.split():
        size = _size(part)
        if not 0 <= size <= MOST - len(numbers):
            raise ValueError(f"{part!r} is too long a list; expected at most {MOST} numbers in all")
        first, star, count = part.partition("*")
        low, dash, high = part.partition("-")
        if star:
            numbers += [int(first)] * int(count)
        elif dash:
            numbers += range(int(low), int(high) + 1)
        else:
            numbers.append(int(part))
    return numbers


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
