"""One system as it is drawn: its parameters, inputs and beginning from the root seed and its index."""

from __future__ import annotations

from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import record_start, sample_parameters
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
) -> Trajectory:
    """Simulate one system over the description's experiment, warm-up first.

    Parameters
    ----------
    parameters
        By name, in place of the sampled ones.
    uncertain
        Draw the description's uncertain constants, too, in place of their values.

    Raises
    ------
    SimulationError
        If the end was not reached.
    """
    system = simulator.system
    experiment = system.experiment
    begin = record_start(system, root_seed, index)
    sampled = dict(zip(system.parameter_names, sample_parameters(system, root_seed, index).tolist(), strict=True))
    if uncertain:
        sampled |= values_of(constants(system, simulator.fmu), sample_factors(system, root_seed, index))
    start, stop = begin - experiment.warm_up_hours * HOUR, begin + experiment.hours * HOUR
    inputs = build_inputs(system, root_seed=root_seed, index=index, start=start, stop=stop, excitation=excitation)
    return simulator.run(
        {**sampled, **(parameters or {})},
        inputs,
        start=start,
        stop=stop,
        record_from=begin,
        replay=replay,
        tolerance=tolerance,
    )
