"""Long lists of whole numbers in little room: ``0-3 5`` for 0, 1, 2, 3, 5 and ``7*4`` for 7, 7, 7, 7."""

from __future__ import annotations

from collections.abc import Sequence

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
