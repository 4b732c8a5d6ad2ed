"""One system as it is drawn: its parameters, inputs and beginning from the root seed and its index."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from datagen.driving.disturbances import sample_disturbances
from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import fmu_values, record_start, sample_given, sample_parameters
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.simulator import Simulator, Trajectory

HOUR = 3600.0


def simulate_system(
    simulator: Simulator,
    *,
    root_seed: int,
    index: int,
    parameters: dict[str, float] | None = None,
    excitation: bool = True,
    uncertain: bool = False,
    replay: bool = False,
    tolerance: float | None = None,
    disturbed: float = 0.0,
) -> Trajectory:
    """Simulate one system over the description's experiment, warm-up first.

    ``parameters``, by name, take the place of sampled ones. ``uncertain`` draws the description's uncertain constants,
    too, in place of their values; ``disturbed`` is the share of the systems on which one or two of its effects act.
    Raises SimulationError if the end was not reached.
    """
    system = simulator.system
    experiment = system.experiment
    begin = record_start(system, root_seed, index)
    start, stop = begin - experiment.warm_up_hours * HOUR, begin + experiment.hours * HOUR
    effects = sample_disturbances(system, root_seed, index, disturbed, start, stop)
    values = drawn_values(simulator, root_seed, index, uncertain=uncertain)
    span: dict[str, Any] = {
        "root_seed": root_seed,
        "index": index,
        "start": start,
        "stop": stop,
        "excitation": excitation,
    }
    inputs = build_inputs(system, **span, changes=effects.changes)
    found = simulator.run(
        {**values, **effects.parameters, **(parameters or {})},
        inputs,
        start=start,
        stop=stop,
        record_from=begin,
        replay=replay,
        tolerance=tolerance,
    )
    if not effects.names:
        return found
    # what is recorded of inputs is what an engineer has, not what acts
    grid = np.append(begin, found.time)
    known = simulator.driven(build_inputs(system, **span), grid) if effects.changes else found.inputs
    return replace(found, inputs=known, outputs=effects.applied(system, found.time, found.outputs))


def drawn_values(simulator: Simulator, root_seed: int, index: int, *, uncertain: bool = False) -> dict[str, float]:
    """Parameters and the FMU's settings of one system as the farm draws them, by name [unit of each].

    ``uncertain`` draws the description's uncertain constants, too.
    """
    system = simulator.system
    values = dict(zip(system.parameter_names, sample_parameters(system, root_seed, index).tolist(), strict=True))
    given = sample_given(system, root_seed, index)
    if given:
        starts = {name: float(simulator.fmu.variables[name].start) for one in system.given for name in one.parameters}
        values |= fmu_values(system, given, starts)
    if uncertain:
        values |= values_of(constants(system, simulator.fmu), sample_factors(system, root_seed, index))
    return values
