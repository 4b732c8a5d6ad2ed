"""A dataset of tanks that drain: nothing in it shares a name with the project's own system.

The level falls exponentially from a refill to the next, every six hours: level = fill * exp(-age / drain). So both
parameters follow from two samples of a window, and an estimator has no excuse.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shared.schema import build_shard, time_axis
from shared.store import Manifest, write_manifest, write_shard
from shared.system import System, parse_system
from trainer.reading.windows import Sampler
from trainer.runs.checkpoint import Run
from trainer.training.fitting import fit

TANK = """
schema_version = 1
name = "Tank"
fmu = "tank.fmu"

[experiment]
step = 1800.0
hours = 240.0

[estimator]
channels = ["level"]
context_hours = 24.0

[[parameters]]
name = "tank.drain"
description = "time constant"
unit = "h"
min = 2.0
max = 20.0

[[parameters]]
name = "tank.fill"
unit = "m"
min = 1.0
max = 4.0
scale = "log"

[[inputs]]
name = "valve"
unit = "1"
source = "constant"
value = 1.0

[[outputs]]
name = "level"
unit = "m"
accuracy = 0.001
noise.gauge = { sd = 0.02, quantum = 0.01, dropout = 0.05 }

[[outputs]]
name = "glow"
unit = "lx"
accuracy = 1.0
"""
REFILL = 6.0
"""Hours between refills."""


def tank_system(text: str = TANK) -> System:
    """The toy's description."""
    return parse_system(text, Path("tank.toml"))


def simulate_tanks(parameters: np.ndarray, indices: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Outputs (systems, outputs, time) of tanks with parameters (systems, 2) [h, m]; the refill's phase is random."""
    phase = np.array([np.random.default_rng((99, int(i))).uniform(0, REFILL) for i in indices])[:, None]
    age = np.mod(time[None] / 3600 + phase, REFILL)
    level = parameters[:, 1:2] * np.exp(-age / parameters[:, 0:1])
    return np.stack([level, 100 * np.cos(2 * np.pi * time / 86400) + 0 * level], axis=1)


def make_dataset(
    folder: Path,
    *,
    systems: int = 100,
    root_seed: int = 1,
    text: str = TANK,
    fmu_sha256: str = "0" * 64,
    settings: dict[str, Any] | None = None,
) -> Path:
    """Write a dataset of two shards as the farm would."""
    system = tank_system(text)
    (folder / "shards").mkdir(parents=True)
    count = round(system.experiment.hours * 3600 / system.experiment.step)
    time = time_axis(system.experiment.step, count)
    entries = []
    for number, indices in enumerate(np.array_split(np.arange(systems), min(systems, 2))):
        draws = np.stack([np.random.default_rng((root_seed, int(i))).random(len(system.parameters)) for i in indices])
        parameters = np.stack([p.from_unit(draws[:, k]) for k, p in enumerate(system.parameters)], axis=1)
        shard = build_shard(
            system,
            indices=indices,
            root_seed=root_seed,
            parameters=parameters,
            outputs=simulate_tanks(parameters, indices, time),
            inputs=np.ones((len(indices), 1, count)),
            attributes={},
        )
        entries.append(write_shard(folder / "shards" / f"{number:03d}.nc", shard, indices.tolist()))
    write_manifest(
        folder,
        Manifest(
            system_name=system.name,
            system_hash=system.hash(),
            system=system.canonical(),
            fmu_sha256=fmu_sha256,
            root_seed=root_seed,
            systems=systems,
            shard_size=-(-systems // 2),
            settings=settings or {},
            shards=entries,
        ),
    )
    return folder


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    """Two threads on a busy machine are slower than one."""
    torch.set_num_threads(1)


PICTURES = (
    "trainer.training.loop.draw_loss_curve",
    "trainer.evaluating.evaluation.draw_scatter",
    "trainer.posterior.assessment.draw_ranks",
    "trainer.posterior.assessment.draw_coverage",
)


def draw_nothing(*given: Any) -> None:
    """In place of a picture an empty file."""
    next(one for one in given if isinstance(one, Path)).write_bytes(b"")


@pytest.fixture(autouse=True)
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes most of the time of a short training or evaluation: only tests of pictures draw them."""
    if "picture" not in request.node.name:
        for one in PICTURES:
            monkeypatch.setattr(one, draw_nothing)


@pytest.fixture(scope="session")
def tanks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of 100 tanks, root seed 1."""
    return make_dataset(tmp_path_factory.mktemp("tanks") / "ds")


@pytest.fixture(scope="session")
def other_tanks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of 20 tanks, root seed 2."""
    return make_dataset(tmp_path_factory.mktemp("other") / "ds", systems=20, root_seed=2)


@pytest.fixture(scope="session")
def ridge_run(tanks: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Ridge, fitted to the tanks; tests must not change its folder."""
    return fit(tanks, tmp_path_factory.mktemp("runs") / "ridge", model="ridge", steps=2)


@pytest.fixture
def own_ridge(ridge_run: Run, tmp_path: Path) -> Path:
    """A copy of the fitted ridge's folder, to be damaged at will."""
    assert ridge_run.folder is not None
    folder = tmp_path / "run"
    folder.mkdir()
    for path in ridge_run.folder.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


def interrupt_after(count: int, patch: pytest.MonkeyPatch) -> None:
    """Let the next training end as by Ctrl-C once it has drawn so many batches."""
    draw, seen = Sampler.draw, []

    def interrupted(self: Sampler, size: int) -> Any:
        seen.append(1)
        if len(seen) > count:
            raise KeyboardInterrupt
        return draw(self, size)

    patch.setattr(Sampler, "draw", interrupted)
