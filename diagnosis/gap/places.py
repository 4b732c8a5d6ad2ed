"""Where the gap lies: residual and twins handed to :mod:`diagnosis.where`, with operators for missing sources."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.effects import Effect, Nothing
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.gap.nuisances import felt
from diagnosis.gap.stages import Stage
from diagnosis.recording import DAY, HOUR
from diagnosis.where import Operator, Residuals, Where, find_regimes, locate
from shared.effects import ShapedEffect

PULSE = 3 * HOUR
"""Length of the pulses of a missing source [s]."""
FOLLOWED = 3 * DAY
"""How long a pulse is followed [s]."""
_POWER = ("W", "kW", "kg/s")


def place(stage: Stage, observed: np.ndarray, operators: list[Operator]) -> Where:
    """Test where a stage's residual lies.

    Parameters
    ----------
    observed
        All readings that count, fitted or not, shape (outputs, steps).
    """
    problem = stage.lin.problem
    residuals = Residuals(
        time=problem.time,
        observed=np.where(observed, stage.twins.residual, np.nan),
        replicates=stage.twins.residuals,
        names=problem.system.output_names,
        units=[one.unit for one in problem.system.outputs],
        labels=[one.long_name or one.name for one in problem.system.outputs],
    )
    inputs = {k: v for k, v in problem.recording.inputs.items() if float(np.ptp(v)) > 0}
    return locate(
        residuals,
        inputs=inputs,
        measured=problem.measured,
        regimes=find_regimes(problem.system, inputs, stage.lin.outputs),
        operators=operators,
        nuisance=stage.lin.by_unknown if operators else None,
    )


def operators(problem: Problem, z: np.ndarray, heights: np.ndarray, effects: list[Effect]) -> list[Operator]:
    """Responses to pulses of what feeds a balance: persons, and effects that are a source of their own.

    A source is an effect with a shape, one parameter of the FMU and the unit of a flow (:data:`_POWER`); its shape's
    input then carries pulses in place of the shape.
    """
    found = []
    names = problem.system.input_names
    for one in problem.system.inputs:
        if one.source == "occupancy" and problem.occupancy == "measured":
            label = "missing persons"
            found.append(_operator(problem, z, heights, names.index(one.name), one.name, label, one.unit))
            break
    for effect in effects:
        spec = getattr(effect, "spec", None)
        if isinstance(spec, ShapedEffect) and len(spec.parameters) == 1 and not spec.constants and spec.unit in _POWER:
            held = problem.with_effects([*problem.effects, _Source(f"source of {effect.name}", effect=effect)])
            first = len(problem.system.parameters) + len(problem.effects)
            there = np.concatenate([z[:first], [1.0], z[first:]])
            label = f"missing source [{spec.unit}]"
            made = _operator(held, there, heights, names.index(spec.input), spec.input, label, spec.unit)
            found.append(Operator(made.name, made.label, made.unit, made.response / spec.scale, made.edges))
            break
    return found


@dataclass(frozen=True)
class _Source(Nothing):
    """An effect whose shape is zero: pulses on its input make the source."""

    effect: Effect | None = None

    def parameters(self, amplitude: float) -> dict[str, float]:
        """Those of the effect at its scale."""
        assert self.effect is not None
        return self.effect.parameters(amplitude * self.effect.scale)


def _operator(
    problem: Problem, z: np.ndarray, heights: np.ndarray, column: int, name: str, label: str, unit: str
) -> Operator:
    drive = problem.drive
    edges = np.append(np.arange(drive.start, drive.stop - 1.0, PULSE), drive.stop)
    count = len(edges) - 1
    pulses = Nuisance(
        column=np.full(count, column),
        begin=edges[:-1],
        end=edges[1:],
        turns=np.zeros(count, dtype=bool),
        recorded=np.ones(count, dtype=bool),
        mean=np.zeros(count),
        factor=np.eye(count),
    )
    return Operator(name, label, unit, felt(problem, z, heights, pulses, FOLLOWED), edges)
