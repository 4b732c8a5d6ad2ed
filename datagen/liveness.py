"""Whether the parameters are alive.

Some tools evaluate a parameter when they compile the FMU, accept new values for it without a word, and ignore them.
Such a parameter would be "estimated" from nothing, so it is refused.
"""

from __future__ import annotations

import numpy as np

from datagen.inputs import build_inputs
from datagen.simulator import Simulator
from shared.errors import SystemDescriptionError

PROBE_HOURS = 96.0
PROBE_SEED = 0


def responses(simulator: Simulator) -> dict[str, float]:
    """Largest change of any output between a parameter's low and high end, in units of the output's accuracy.

    Simulates a few days from the middle of the ranges, once at each end of each parameter.
    """
    system = simulator.system
    stop = min(PROBE_HOURS, system.experiment.hours) * 3600.0
    stop = max(system.experiment.step, stop - stop % system.experiment.step)
    inputs = build_inputs(system, root_seed=PROBE_SEED, index=0, start=0.0, stop=stop)
    middle = {p.name: float(p.from_unit(0.5)) for p in system.parameters}
    accuracy = np.array([[o.accuracy] for o in system.outputs])

    def outputs(name: str, value: float) -> np.ndarray:
        return simulator.run({**middle, name: value}, inputs, start=0.0, stop=stop).outputs

    return {
        p.name: float(np.max(np.abs(outputs(p.name, p.max) - outputs(p.name, p.min)) / accuracy))
        for p in system.parameters
    }


def check_live(simulator: Simulator) -> dict[str, float]:
    """Refuse parameters that do not move any output by more than its accuracy; returns :func:`responses`.

    Raises
    ------
    SystemDescriptionError
        Naming the dead parameters.
    """
    found = responses(simulator)
    dead = [name for name, change in found.items() if change < 1.0]
    if dead:
        raise SystemDescriptionError(
            f"{simulator.system.path}: {simulator.fmu.path.name} accepts {', '.join(map(repr, dead))} and ignores it: "
            "no output moves between the ends of its range; expected parameters that are tunable at run time"
        )
    return found
