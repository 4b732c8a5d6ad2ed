"""What would close a balance: responses of the outputs to pulses of the sources that the system description declares.

A source of heat is one input of the FMU; a trace gas that only persons bring is persons less their heat. Both are
responses at the fitted model, linear in the source; see :class:`shared.sources.Source`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from diagnosis.effects import Nothing
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.gap.nuisances import felt
from diagnosis.recording import DAY, HOUR
from diagnosis.where import Operator
from shared.sources import Source

PULSE = 3 * HOUR
"""Length of the pulses of a missing source [s]."""
FOLLOWED = 3 * DAY
"""How long a pulse is followed [s]."""


def operators(problem: Problem, z: np.ndarray, heights: np.ndarray) -> tuple[list[Operator], dict[str, str]]:
    """Operators of all declared sources, and why there is none of the others, by name.

    Where none is declared, persons are one, as far as the system has any.

    Parameters
    ----------
    z, heights
        Unknowns (unknowns,) and heights of the nuisance (pulses,) of the fitted model.
    """
    system = problem.system
    declared = system.sources or [
        Source(name=one.name, description="missing persons", unit=one.unit, input=one.name)
        for one in system.inputs
        if one.source == "occupancy"
    ]
    fitted = dict(zip(problem.names, problem.values(z).tolist(), strict=True))
    found: dict[str, Operator] = {}
    failed: dict[str, str] = {}
    for source in declared:
        if lacking := [name for name in source.less if name not in found]:
            failed[source.name] = f"that of {lacking[0]!r} is not known"
            continue
        try:
            edges, response = _pulses(problem, z, heights, source)
        except FAILURES:
            failed[source.name] = "its simulation fails"
            continue
        for name, amount in source.less.items():
            response = response - amount * found[name].response
        per = fitted[source.per] if isinstance(source.per, str) else source.per
        label = source.description or f"missing {source.name}"
        found[source.name] = Operator(source.name, label, source.unit, response / per, edges)
    return list(found.values()), failed


@dataclass(frozen=True)
class _Held(Nothing):
    """An effect that sets parameters of the FMU, so that the pulses on an input act."""

    held: dict[str, float] = field(default_factory=dict)

    def parameters(self, amplitude: float) -> dict[str, float]:
        """Those of the source [unit of each]."""
        return self.held if amplitude else {}


def _pulses(problem: Problem, z: np.ndarray, heights: np.ndarray, source: Source) -> tuple[np.ndarray, np.ndarray]:
    """Edges of pulses (pulses + 1,) [s] and the response to one unit of the source's input (outputs, steps, pulses)."""
    column = problem.system.input_names.index(source.input)
    edges = np.append(np.arange(problem.drive.start, problem.drive.stop - 1.0, PULSE), problem.drive.stop)
    count = len(edges) - 1
    pulses = Nuisance(
        column=np.full(count, column),
        begin=edges[:-1],
        end=edges[1:],
        turns=np.zeros(count, dtype=bool),
        recorded=np.ones(count, dtype=bool),
        mean=np.zeros(count),
        factor=np.eye(count),
        followed=np.full(count, FOLLOWED),
    )
    where, there = problem, z
    if source.parameters:
        where = problem.with_effects([*problem.effects, _Held(f"source {source.name}", held=source.parameters)])
        first = len(problem.system.parameters) + len(problem.effects)
        there = np.concatenate([z[:first], [1.0], z[first:]])
    response = felt(where, there, heights, pulses)
    # a level multiplies all persons, those of the pulses too
    levels = problem.unknown.level_values(z)
    for level, factor in zip(problem.nuisance.levels, levels, strict=True):
        if level.column == column:
            response = response / factor
    return edges, response
