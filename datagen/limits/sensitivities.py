"""How the outputs of a random window of a random system move with all that is unknown about it.

All derivatives are differences of whole simulations, so saturation and events are in them: central ones, but for
persons, of whom one more is simulated (:mod:`datagen.limits.pulses`).
:mod:`datagen.limits.ceilings` makes limits of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from datagen.driving.inputs import build_inputs
from datagen.driving.occupancy import occupancy_prior
from datagen.driving.sampling import record_start, sample_parameters, stream
from datagen.driving.tables import InputTable
from datagen.limits.pulses import responses
from datagen.simulating.drawn import drawn_values
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.simulator import Simulator
from shared.store import sha256_of
from shared.system import System
from shared.variables import Parameter

HOUR = 3600.0
PULSE = 600.0
"""Length of an occupancy pulse at most [s]: people come and go within the hour, and nobody knows when. Half-hours
would pass for known within: with 1800 here a day of clean readings has a mean R2 of 0.80, with 600 of 0.75, with 300 of
0.74 (the default system, two sensors, three rooms, seed 1)."""
SPIN_UP_HOURS = 240.0
"""Of a window's past, what is simulated before it at least, where its record goes back so far."""
PARAMETER_STEP = 0.02
"""Half-width of the difference for a parameter or a constant, in prior standard deviations of its own scale."""
STATE_STEP = 0.02
PRIOR_DRAWS, DRAWS_EACH = 4000, 5
"""Of the occupancy: at least, and for each pulse, lest its covariance lack directions that nobody happened to take."""
TOLERANCE = 1e-8
"""Tighter than the farm's: differences of simulations are small."""

_SIMULATORS: dict[str, Simulator] = {}


@dataclass(frozen=True)
class Window:
    """Sensitivities of one random window.

    ``parameters`` (outputs, steps, parameters) per prior standard deviation; ``states`` (outputs, steps, states)
    [unit of output per unit of state]; ``constants`` (outputs, steps, constants) per prior standard deviation of the
    logarithm, without any constants where all are known; ``occupancy`` (outputs, steps, pulses) per person;
    ``occupancy_covariance`` (pulses, pulses) [persons^2]; ``occupancy_steps`` (pulses,), the step that each pulse lies
    in; ``visited`` (steps, states), states met on the way, for the prior of the start.
    """

    parameters: np.ndarray
    states: np.ndarray
    constants: np.ndarray
    occupancy: np.ndarray
    occupancy_covariance: np.ndarray
    occupancy_steps: np.ndarray
    visited: np.ndarray


def crowd_inputs(system: System) -> list[str]:
    """Names of the inputs that are the number of persons: one crowd, however many read it."""
    return [one.name for one in system.inputs if one.source == "occupancy"]


def around(parameter: Parameter, value: float) -> tuple[float, float]:
    """Two values [unit of the parameter] about ``value``, of which the difference is taken; within its range.

    They are equally far in the parameter's own scale: on the linear one a parameter that is drawn over decades would
    be moved by more than its value where that is small. Where the range ends, the difference is one-sided.
    """
    draws = parameter.from_unit(np.linspace(0, 1, 2001))
    if parameter.scale == "log":
        ratio = float(np.exp(PARAMETER_STEP * np.std(np.log(draws))))
        low, high = value / ratio, value * ratio
    else:
        move = PARAMETER_STEP * float(np.std(draws))
        low, high = value - move, value + move
    return max(low, parameter.min), min(high, parameter.max)


def random_window(system: System, context: float, seed: int, index: int, uncertain: bool = False) -> Window:
    """Sensitivities of a random window of ``context`` [h] of a random system, from its record as the farm makes it.

    Where ``uncertain`` is set its uncertain constants are drawn, too, and the window has their sensitivities. Like the
    parameters they are moved from the window's start on alone: the state there is an unknown of its own. It is what the
    record's past leads to, so that a window on a record's first hours, where the record is not warmed up, begins with
    the state of the FMU itself, which is known, and shows how it settles.
    """
    key = f"{system.canonical()} {system.fmu_path} {sha256_of(system.fmu_path)}"
    if key not in _SIMULATORS:
        _SIMULATORS[key] = Simulator(system)
    simulator = _SIMULATORS[key]
    step = system.experiment.step
    span = context * HOUR
    latest = max(int((system.experiment.hours * HOUR - span) // step), 0)
    since = step * int(stream(seed, index, "window").integers(latest + 1))
    begin = record_start(system, seed, index) + since
    theta = sample_parameters(system, seed, index)
    scale = np.array([float(np.std(p.from_unit(np.linspace(0, 1, 2001)))) for p in system.parameters])
    known = constants(system, simulator.fmu) if uncertain else ()
    drawn = sample_factors(system, seed, index) if uncertain else np.empty(0)
    warm_up = system.experiment.warm_up_hours * HOUR
    spin_up = min(step * np.ceil(max(SPIN_UP_HOURS * HOUR, warm_up) / step - 1e-9), since + warm_up)
    table = build_inputs(system, root_seed=seed, index=index, start=begin - spin_up, stop=begin + span)

    base = drawn_values(simulator, seed, index)

    def setting(values: np.ndarray, factors: np.ndarray) -> dict[str, float]:
        return base | dict(zip(system.parameter_names, values.tolist(), strict=True)) | values_of(known, factors)

    visited = np.empty((0, simulator.fmu.n_states))
    if spin_up > 0:
        spacing = min(step, spin_up)
        recorded = begin - spacing * np.floor(
            spin_up / spacing + 1e-9
        )  # whole steps, lest there be no value at their end
        visited = simulator.run(
            setting(theta, drawn),
            table,
            start=begin - spin_up,
            stop=begin,
            step=spacing,
            record_from=recorded,
            record_states=True,
        ).states
    start_states = visited[-1] if len(visited) else None
    each = int(np.ceil(step / PULSE - 1e-9))
    edges = begin + step / each * np.arange(round(span / step) * each + 1)
    fine = table.restricted(begin, begin + span).refined(edges)

    def outputs(
        values: np.ndarray = theta,
        factors: np.ndarray = drawn,
        states: np.ndarray | None = start_states,
        inputs: InputTable = fine,
    ) -> np.ndarray:
        return simulator.run(
            setting(values, factors),
            inputs,
            start=begin,
            stop=begin + span,
            tolerance=TOLERANCE,
            initial_states=states,
        ).outputs

    by_parameter, by_constant, by_state = [], [], []
    for k, parameter in enumerate(system.parameters):
        ends = np.tile(theta, (2, 1))
        ends[:, k] = around(parameter, float(theta[k]))
        low, high = ends
        by_parameter.append((outputs(high) - outputs(low)) / ((high[k] - low[k]) / scale[k]))
    for k, constant in enumerate(known):
        ratio = np.ones_like(drawn)
        ratio[k] = np.exp(PARAMETER_STEP * constant.relative)
        up, down = (outputs(factors=factors) for factors in (drawn * ratio, drawn / ratio))
        by_constant.append((up - down) / (2 * PARAMETER_STEP))
    shape = (len(system.outputs), round(span / step), 0)
    if start_states is None:  # known: it moves nothing
        by_state = [np.zeros(shape[:2])] * simulator.fmu.n_states
    else:
        spread = visited.std(axis=0)
        for k in range(len(start_states)):
            move = np.zeros_like(start_states)
            move[k] = max(STATE_STEP * spread[k], 1e-9 * abs(start_states[k]), 1e-12)
            up, down = (outputs(states=states) for states in (start_states + move, start_states - move))
            by_state.append((up - down) / (2 * move[k]))
    by_pulse, covariance, within = np.empty(shape), np.empty((0, 0)), np.empty(0, dtype=int)
    crowd = [system.input_names.index(name) for name in crowd_inputs(system)]
    if crowd and system.occupancy is not None:
        base = outputs()

        def response(pulses: Sequence[tuple[float, float]]) -> np.ndarray:
            more = fine
            for column in crowd:
                for a, b in pulses:
                    more = more.with_pulse(column, a, b, 1.0)
            return outputs(inputs=more) - base

        draws = occupancy_prior(system.occupancy, edges, max(PRIOR_DRAWS, DRAWS_EACH * (len(edges) - 1)), seed)
        some = np.flatnonzero(np.ptp(draws, axis=0) > 0)  # nobody comes at night
        if some.size:  # nor at weekends, say
            covariance, within = np.atleast_2d(np.cov(draws[:, some], rowvar=False)), some // each
            pulses = list(pairwise(edges))
            by_pulse = responses(response, [pulses[k] for k in some], begin + step * np.arange(1, shape[1] + 1))

    def stacked(columns: list[np.ndarray]) -> np.ndarray:
        return np.stack(columns, axis=-1) if columns else np.empty(shape)

    return Window(
        parameters=stacked(by_parameter),
        states=stacked(by_state),
        constants=stacked(by_constant),
        occupancy=by_pulse,
        occupancy_covariance=covariance,
        occupancy_steps=within,
        visited=visited,
    )
