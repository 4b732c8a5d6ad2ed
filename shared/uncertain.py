"""Constants that are not estimated, but not exactly known either, as the system description declares them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

from pydantic import Field

from shared.signals import Table


class Uncertain(Table):
    """FMU parameters that nobody wants to know and nobody knows exactly: the layers of a floor, say.

    All of them are multiplied by exp(``relative`` * N(0, 1)); their values are those of ``fixed``, or the FMU's own.
    Fits to measurements let them vary, and so do datasets that are to be like buildings (``datagen run --uncertain``).
    What ``fixed`` sets to 0 stays 0.
    """

    name: str = Field(description="in reports")
    description: str = Field("", description="what it is, for reports")
    parameters: list[str] = Field(min_length=1, description="names of FMU parameters, each positive")
    relative: float = Field(gt=0, le=1, description="standard deviation of the logarithm of their common factor")


def fault(
    table: str, declared: Iterable[Any], names: Collection[str], estimated: Collection[str], taken: Collection[str]
) -> str:
    """What is wrong with what a ``table`` sets in a system, as a sentence; empty if nothing is.

    Its entries, ``declared``, have a ``name`` and ``parameters`` each. ``names`` are of everything that has one of its
    own already, ``estimated`` those of the estimated parameters, and ``taken`` the FMU parameters that other tables
    set.
    """
    names, taken = {*names}, {*taken}
    for entry in declared:
        if entry.name in names:
            return f"{table}: {entry.name!r} is the name of two things; expected one"
        names.add(entry.name)
        for one in entry.parameters:
            if one in estimated:
                return f"{table}: {entry.name!r} holds {one!r}, which is an estimated parameter"
            if one in taken:
                return f"{table}: {entry.name!r} holds {one!r}, which is set elsewhere as well"
            taken.add(one)
    return ""
