"""A linearised recording with fewer candidates: a diagnosis that leaves some out need not simulate anew."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from diagnosis.effects import Effect
from diagnosis.gap.linear import Linearised


def fewer(lin: Linearised, effects: Sequence[Effect], excluded: Collection[str] = ()) -> Linearised:
    """A linearisation with some of its candidates, in the order of ``effects``.

    Every candidate's derivative is that of simulations with this candidate alone, so that the result is what
    :func:`diagnosis.gap.linear.linearised` would have made of fewer.

    Parameters
    ----------
    excluded
        Names of candidates that could not be tried, and are not missed.

    Raises
    ------
    ValueError
        If a candidate is neither excluded nor in the linearisation.
    """
    place = {one.name: j for j, one in enumerate(lin.effects)}
    gone = {*excluded, *(one.name for one in lin.chosen)}
    for one in effects:
        if one.name not in place and one.name not in gone:
            raise ValueError(f"effects: {one.name!r} took no part in the linearisation; expected one of {[*place]}")
    kept = [place[one.name] for one in effects if one.name in place]
    return replace(
        lin,
        by_effect=lin.by_effect[..., kept],
        effects=tuple(lin.effects[j] for j in kept),
        failed={name: why for name, why in lin.failed.items() if name in {lin.effects[j].name for j in kept}},
    )
