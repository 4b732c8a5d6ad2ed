"""Readers of ``trainer``: run folders, states, posteriors, benchmarks, recordings to estimate from."""

import json
import shutil
from pathlib import Path

import numpy as np
import torch
import xarray as xr

from shared.shipped import resolved_estimator
from shared.store import sha256_of
from tests.hostile.damage import damage_bytes, damage_json, damage_text
from tests.hostile.trial import Reader
from tests.trainer.conftest import make_dataset
from trainer.benchmarking.conditions import Budget, Condition, Fit
from trainer.benchmarking.job import Done, read_done
from trainer.benchmarking.published import read_published
from trainer.evaluating.evaluation import evaluate
from trainer.evaluating.report import read_answers
from trainer.posterior.checkpoint import load_posterior
from trainer.predicting.recorded import read_window
from trainer.runs.checkpoint import load_run
from trainer.runs.state import read_state, write_state
from trainer.training.fitting import fit
from trainer.training.tuning import Best, read_options

SMALL = {"width": 8, "layers": 1, "heads": 2, "feedforward": 8}


def make_run(folder: Path) -> Path:
    """A small run, evaluated."""
    data = make_dataset(folder / "data", systems=10)
    run = fit(data, folder / "run", model="patch-transformer", steps=1, patch=12, options=SMALL)
    evaluate(run, data, windows=4)
    for path in [*(folder / "run").glob("*.png"), *(folder / "run").glob("curve*")]:
        path.unlink()
    return folder / "run"


def _seal(card: str, weights: str):
    def seal(folder: Path) -> None:
        raw = json.loads((folder / card).read_text())
        raw["weights_sha256"] = sha256_of(folder / weights)
        (folder / card).write_text(json.dumps(raw))

    return seal


def estimate(folder: Path) -> None:
    """Load a run and let it estimate."""
    run = load_run(folder)
    encoding = run.card.encoding
    run.estimate(np.ones((1, encoding.length, len(encoding.recorded))), np.zeros(1))


def posterior(folder: Path) -> None:
    """Load a run's posterior."""
    load_posterior(load_run(folder))


def readers(folder: Path) -> list[Reader]:
    """All of them, each on files of its own below ``folder``."""
    torch.set_num_threads(1)
    folder.mkdir(parents=True)
    run = make_run(folder / "made")

    def copy(name: str, origin: Path = run) -> Path:
        return Path(shutil.copytree(origin, folder / name))

    shipped = resolved_estimator("MixedAirCO2")
    encoding = load_run(run).card.encoding
    for name in ("state", "best", "published", "done", "window"):
        (folder / name).mkdir()
    write_state(folder / "state" / "s.safetensors", {"network": {"a": torch.ones(3, 4)}}, {"step": 3, "curve": [[1]]})
    (folder / "best" / "best.json").write_text(Best(model="lstm", options={"width": 8}, lr=0.1).model_dump_json())
    figures = {"source": "s", "figures": [{"part": "p", "labels": ["a"], "r2": {"x": 0.5}, "mean": 0.5}]}
    (folder / "published" / "p.json").write_text(json.dumps(figures))
    one = Fit(
        condition=Condition(model="lstm", context_hours=24.0, channels=("level",), noise="none"),
        **{"seed": 0, "budget": Budget(steps=5), "windows": 10},
    )
    (folder / "done" / "done.json").write_text(Done(fit=one, seconds=1.0).model_dump_json())
    time = np.arange(1, 97) * encoding.step
    series = {
        name: ("time", np.ones(96), {"units": unit})
        for name, unit in zip(encoding.recorded, encoding.units, strict=True)
    }
    stamps = ("time", time, {"units": "seconds since 2001-01-01 00:00:00"})
    xr.Dataset(series, {"time": stamps}).to_netcdf(folder / "window" / "r.nc", format="NETCDF4")
    card, weights = "estimator.json", "weights.safetensors"
    return [
        Reader("estimator.json", copy("r1"), card, estimate, damage_json, named=False),
        Reader("weights", copy("r2"), weights, estimate, damage_bytes),
        Reader("weights, hash made anew", copy("r3"), weights, estimate, damage_bytes, seal=_seal(card, weights)),
        Reader(
            "posterior.json", copy("r4", shipped), "posterior.json", posterior, damage_json, examples=3, named=False
        ),
        Reader(
            *("posterior weights, hash made anew", copy("r5", shipped), "posterior.safetensors", posterior),
            *(damage_bytes, _seal("posterior.json", "posterior.safetensors")),
            examples=3,
        ),
        Reader(
            "training state",
            folder / "state",
            "s.safetensors",
            lambda at: read_state(at / "s.safetensors"),
            damage_bytes,
        ),
        Reader("best.json", folder / "best", "best.json", lambda at: read_options(at / "best.json"), damage_json),
        Reader(
            "published figures", folder / "published", "p.json", lambda at: read_published(at / "p.json"), damage_json
        ),
        Reader("benchmark's done.json", folder / "done", "done.json", read_done, damage_json),
        Reader("answers.csv", copy("r6"), "answers.csv", read_answers, damage_text),
        Reader(
            *("recording, trainer predict", folder / "window", "r.nc"),
            *(lambda at: read_window(at / "r.nc", encoding), damage_bytes),
            examples=3,
        ),
    ]
