"""What a worker does: simulate the systems of one shard and write it.

A system's data depend on the root seed and its index alone, so it does not matter which worker does it, or when.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from datagen.inputs import build_inputs
from datagen.sampling import sample_parameters
from datagen.simulator import Simulator, Trajectory
from shared.errors import SimulationError
from shared.schema import build_shard
from shared.store import ShardEntry, write_shard
from shared.system import System, system_from_canonical

HOUR = 3600.0
RETRY_TOLERANCES = (1.0, 0.1, 0.01)
"""A system that fails is tried again with the tolerance times these, in this order, then given up."""


@dataclass(frozen=True)
class Job:
    """Everything that decides a dataset's content; the same for all its shards."""

    system: str
    system_path: str
    fmu_sha256: str
    root_seed: int
    excitation: bool
    folder: str


@dataclass(frozen=True)
class ShardResult:
    """What came of one shard: its entry (None if every system failed), and the systems that failed."""

    entry: ShardEntry | None
    failures: list[dict[str, Any]]
    statistics: dict[str, int]


@lru_cache(maxsize=4)
def simulator_for(system: str, system_path: str) -> Simulator:
    """The simulator of a system, loaded once per worker process."""
    return Simulator(system_from_canonical(system, Path(system_path)))


def simulate_system(
    simulator: Simulator,
    *,
    root_seed: int,
    index: int,
    parameters: dict[str, float] | None = None,
    excitation: bool = True,
    replay: bool = False,
    tolerance: float | None = None,
) -> Trajectory:
    """Simulate one system over the description's experiment, warm-up first.

    Parameters
    ----------
    parameters
        By name, in place of the sampled ones.

    Raises
    ------
    SimulationError
        If the end was not reached.
    """
    system = simulator.system
    experiment = system.experiment
    sampled = dict(zip(system.parameter_names, sample_parameters(system, root_seed, index).tolist(), strict=True))
    start, stop = -experiment.warm_up_hours * HOUR, experiment.hours * HOUR
    inputs = build_inputs(system, root_seed=root_seed, index=index, start=start, stop=stop, excitation=excitation)
    return simulator.run(
        {**sampled, **(parameters or {})},
        inputs,
        start=start,
        stop=stop,
        record_from=0.0,
        replay=replay,
        tolerance=tolerance,
    )


def shard_name(number: int) -> str:
    """File name of a shard."""
    return f"shard-{number:06d}.nc"


def simulate_shard(job: Job, number: int, indices: list[int]) -> ShardResult:
    """Simulate the systems of a shard and write it whole."""
    simulator = simulator_for(job.system, job.system_path)
    system: System = simulator.system
    done: list[int] = []
    trajectories: list[Trajectory] = []
    failures: list[dict[str, Any]] = []
    statistics: dict[str, int] = {}
    for index in indices:
        cause = ""
        for factor in RETRY_TOLERANCES:
            try:
                trajectory = simulate_system(
                    simulator,
                    root_seed=job.root_seed,
                    index=index,
                    excitation=job.excitation,
                    tolerance=system.experiment.tolerance * factor,
                )
            except SimulationError as error:
                cause = str(error)
                continue
            trajectories.append(trajectory)
            done.append(index)
            for name, count in trajectory.statistics.items():
                statistics[name] = statistics.get(name, 0) + count
            break
        else:
            values = sample_parameters(system, job.root_seed, index).tolist()
            failures.append(
                {
                    "system": index,
                    "root_seed": job.root_seed,
                    "parameters": dict(zip(system.parameter_names, values, strict=True)),
                    "cause": cause,
                }
            )
    if not done:
        return ShardResult(None, failures, statistics)
    shard = build_shard(
        system,
        indices=np.array(done),
        root_seed=job.root_seed,
        parameters=np.stack([sample_parameters(system, job.root_seed, i) for i in done]),
        outputs=np.stack([t.outputs for t in trajectories]),
        inputs=np.stack([t.inputs for t in trajectories]),
        attributes={"fmu_sha256": job.fmu_sha256, "root_seed": str(job.root_seed)},
    )
    entry = write_shard(Path(job.folder) / "shards" / shard_name(number), shard, done)
    return ShardResult(entry, failures, statistics)
