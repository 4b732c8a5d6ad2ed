"""The true room: a system, what is true of it, and its simulation on fine steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.simulating.simulator import Simulator
from diagnosis.blind.processes import Window
from diagnosis.recording import HOUR


@dataclass(frozen=True)
class Lived:
    """What happened in the room.

    ``time`` (steps,) ends of fine steps [s], ``outputs`` (outputs, steps) [unit of each], ``states`` by name, each
    (steps,).
    """

    time: np.ndarray
    outputs: np.ndarray
    states: dict[str, np.ndarray]


def live(
    simulator: Simulator,
    parameters: Mapping[str, float],
    signals: Mapping[str, Piecewise],
    *,
    begin: float,
    start: float,
    stop: float,
    step: float,
    tolerance: float,
    window: tuple[str, str, Window] | None = None,
) -> Lived:
    """Simulate from ``begin`` and record every ``step`` between ``start`` and ``stop`` (all [s]).

    ``window``: the input that an occupant sets every full hour, the output that tells the occupant how warm it is, and
    the occupant. The simulation then goes hour by hour, each from the states that the last one left.

    Raises
    ------
    SimulationError
        If the end was not reached.
    """
    system = simulator.system
    names = [derivative.variable.derivative.name for derivative in simulator.fmu.description.derivatives]
    table = merge({name: signals[name] for name in system.input_names}, begin, stop)
    if window is None:
        made = simulator.run(
            parameters,
            table,
            start=begin,
            stop=stop,
            record_from=start,
            step=step,
            tolerance=tolerance,
            record_states=True,
        )
        return Lived(made.time, made.outputs, dict(zip(names, made.states[1:].T, strict=True)))
    target, room, occupant = window
    column, row = table.names.index(target), system.output_names.index(room)
    times, outputs, states = [], [], []
    last: np.ndarray | None = None
    feels = 294.15  # before the first hour nobody has felt anything yet: an ordinary room
    for hour in np.arange(begin, stop - 1.0, HOUR):
        part = _held(table.restricted(hour, hour + HOUR), column, occupant(float(hour), feels))
        made = simulator.run(
            parameters,
            part,
            start=float(hour),
            stop=float(hour + HOUR),
            step=step,
            tolerance=tolerance,
            initial_states=last,
            record_states=True,
        )
        last, feels = made.states[-1], float(made.outputs[row, -1])
        if hour >= start - 1.0:
            times.append(made.time)
            outputs.append(made.outputs)
            states.append(made.states[1:])
    return Lived(
        np.concatenate(times),
        np.concatenate(outputs, axis=1),
        dict(zip(names, np.concatenate(states).T, strict=True)),
    )


def _held(table: InputTable, column: int, value: float) -> InputTable:
    """The table with one input held at a value."""
    left, right = table.left.copy(), table.right.copy()
    left[:, column] = right[:, column] = value
    return replace(table, left=left, right=right)


def coarse(outputs: np.ndarray, methods: list[str], ratio: int) -> np.ndarray:
    """Outputs (outputs, fine steps) on steps that are ``ratio`` times longer: the last instant, or the mean."""
    blocks = outputs.reshape(len(outputs), -1, ratio)
    points = np.array([method == "point" for method in methods])
    return np.where(points[:, None], blocks[:, :, -1], blocks.mean(axis=2))
