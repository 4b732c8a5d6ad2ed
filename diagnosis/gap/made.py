"""What a search has made, by what led to it: nothing is made twice, and a search among fewer candidates shares it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

from diagnosis.gap.abroad import Abroad
from diagnosis.gap.linear import Linearised
from diagnosis.gap.refit import Refit

Names = tuple[str, ...]


@dataclass
class Made:
    """One dictionary for each kind; the first part of every key is the path of stages (``Search.path``) that led there.

    ``refits``: of a candidate, by its name. ``abroad``: names of candidates, and all of them where the base model's
    fit began; ``from_there`` one of them fitted from where it came to, by its name. ``afresh``: effects fitted from
    where the base model's fit began, by their names. ``settled``: a refit simulated anew where it came to, by its
    effects' names.
    ``bare``: the base model where a refit lies, by the refit's effects' names and its unknowns' bytes.
    ``renewed``: a refit linearised by the candidates that remain, by its effects' names and its unknowns' bytes.
    ``apart``: both lines of a fit to a part, by the bytes of what was fitted and of the unknowns where it was begun as
    well; its path is that of these stages alone. None is what cannot be simulated. ``base``: the base model's fit,
    and linearised by all candidates; ``further``: the same after going on with it, without the second part where that
    led to nothing better.
    """

    base: tuple[Refit, Linearised] | None = None
    further: tuple[Refit, Linearised | None] | None = None
    refits: dict[tuple[Hashable, str], Refit] = field(default_factory=dict)
    abroad: dict[Hashable, tuple[set[str], Abroad]] = field(default_factory=dict)
    from_there: dict[tuple[Hashable, str], Refit | None] = field(default_factory=dict)
    afresh: dict[tuple[Hashable, Names], Refit | None] = field(default_factory=dict)
    settled: dict[tuple[Hashable, Names], Refit] = field(default_factory=dict)
    bare: dict[tuple[Hashable, Names, bytes], list[Refit]] = field(default_factory=dict)
    renewed: dict[tuple[Hashable, Names, bytes], Linearised] = field(default_factory=dict)
    apart: dict[tuple[Hashable, bytes, bytes], tuple[Linearised, Linearised]] = field(default_factory=dict)
