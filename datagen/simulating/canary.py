"""Whether an FMU resets cleanly.

Many do not: something of the last simulation stays, and the next one differs. So an instance is used again only after
a canary has come to no harm: a probe on a fresh instance, another simulation, a reset, and the probe again must give
the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from datagen.driving.tables import InputTable
from datagen.fmi.fmu import Fmu
from shared.errors import SimulationError
from shared.system import System

PROBE_STEPS = 168


class Subject(Protocol):
    """What the canary asks of a simulator."""

    system: System
    fmu: Fmu
    reuse: bool | None

    def run(
        self,
        parameters: Mapping[str, float],
        inputs: InputTable,
        *,
        start: float,
        stop: float,
        step: float | None = None,
        timeout: float | None = None,
    ) -> Any:
        """Simulate; the result has ``outputs``."""


def resets_cleanly(
    simulator: Subject,
    parameters: Mapping[str, float],
    inputs: InputTable,
    *,
    start: float,
    stop: float,
    step: float,
    timeout: float | None = None,
) -> bool:
    """Send the canary in: short simulations with these parameters and inputs, and with others.

    Afterwards the simulator's instance is a fresh one again.
    """
    system, fmu = simulator.system, simulator.fmu
    stop = min(stop, start + PROBE_STEPS * step)
    stop = start + max(1, int((stop - start) / step + 1e-6)) * step
    others = {
        p.name: p.max if parameters.get(p.name, p.min) < float(p.from_unit(0.5)) else p.min for p in system.parameters
    }
    decided = simulator.reuse

    def bits(values: Mapping[str, float], *, reuse: bool) -> bytes:
        simulator.reuse = reuse
        outputs = simulator.run(values, inputs, start=start, stop=stop, step=step, timeout=timeout).outputs
        return bytes(outputs.tobytes())

    try:
        first = bits(parameters, reuse=False)
        bits({**parameters, **others}, reuse=True)
        return first == bits(parameters, reuse=True)
    except SimulationError:  # what fails now would blame the canary later
        return False
    finally:
        simulator.reuse = decided
        fmu.release()
