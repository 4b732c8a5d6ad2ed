"""Readers of ``trainer`` on damaged files, and on run folders made to do harm."""

import json

import numpy as np
import pytest
import torch
import xarray as xr
from safetensors.torch import load_file, save_file

from shared.errors import EstimatorError, RecordingError
from shared.store import sha256_of
from tests.hostile import cases_trainer
from tests.hostile.properties import property_of
from trainer.predicting.recorded import read_window
from trainer.runs.checkpoint import load_run
from trainer.runs.spans import MOST, unpacked
from trainer.runs.state import read_state
from trainer.runs.weights import _Budget

test_damaged = property_of(cases_trainer)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return cases_trainer.make_run(tmp_path_factory.mktemp("hostile-run"))


@pytest.fixture
def run(made, tmp_path):
    import shutil

    return shutil.copytree(made, tmp_path / "run")


def spoil(run, *path, value):
    raw = json.loads((run / "estimator.json").read_text())
    at = raw
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    (run / "estimator.json").write_text(json.dumps(raw))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("options", "width"), 1 << 40),
        (("options", "width"), 1 << 17),
        (("options", "layers"), 10**9),
        (("options", "feedforward"), 10**12),
        (("encoding", "length"), 10**7),
        (("encoding", "length"), 10**15),
        (("encoding", "step"), float("nan")),
        (("encoding", "sd"), [0.0, 0.0]),
        (("encoding", "mean"), [float("nan"), 1.0]),
        (("encoding", "mean"), [1.0] * 50),
        (("encoding", "outputs"), -1),
        (("encoding", "derived"), ["no clock"]),
        (("encoding", "target_sd"), []),
        (("training_systems", "indices"), "0-99999999999"),
        (("training_systems", "root_seeds"), "7*99999999999"),
    ],
)
def test_a_card_that_asks_for_too_much_or_makes_no_sense_is_refused(run, path, value):
    spoil(run, *path, value=value)
    with pytest.raises(EstimatorError, match=r"estimator\.json"):
        load_run(run)


def test_a_network_is_built_within_its_budget_only():
    with pytest.raises(ValueError, match="too large a network for its weights"), _Budget(10_000):
        torch.nn.Linear(1 << 16, 1 << 16)  # 16 GiB that are never touched
    with pytest.raises(ValueError, match="too large a network"), _Budget(1 << 30, 50):
        for _ in range(100):
            torch.zeros(1)
    with _Budget(10_000):
        torch.nn.Linear(4, 4)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused(run, value):
    weights = run / "weights.safetensors"
    tensors = load_file(weights)
    tensors["head.1.weight"][0, 0] = value
    save_file(tensors, weights)
    spoil(run, "weights_sha256", value=sha256_of(weights))
    with pytest.raises(EstimatorError, match=r"weights\.safetensors: head\.1\.weight has values that are not finite"):
        load_run(run)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff" * 8,
        (1 << 60).to_bytes(8, "little") + b"{}",
        (2).to_bytes(8, "little") + b"{}",
        (60).to_bytes(8, "little") + b'{"a":{"dtype":"F32","shape":[99999999999],"data_offsets":[0,4]}}',
        b"\x80\x04cos\nsystem\n(S'touch taken'\ntR.",
    ],
)
def test_weights_that_are_none_are_refused(run, content):
    weights = run / "weights.safetensors"
    weights.write_bytes(content)
    spoil(run, "weights_sha256", value=sha256_of(weights))
    with pytest.raises(EstimatorError, match=r"weights\.safetensors: does not fit estimator\.json"):
        load_run(run)
    with pytest.raises(EstimatorError, match=r"weights\.safetensors: damaged"):
        read_state(weights)


def test_short_texts_stand_for_no_endless_lists():
    assert len(unpacked("0-99 7*5")) == 105
    for text in (f"0-{MOST}", f"7*{MOST + 1}", f"0-{MOST - 1} 5", "7*-1", "9-1"):
        with pytest.raises(ValueError, match="too long a list"):
            unpacked(text)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.assign_coords(time=("time", data["time"].values, {"units": "seconds since never"})),
        lambda data: data.assign_coords(time=("time", np.full(96, np.nan), dict(data["time"].attrs))),
        lambda data: data.rename({"time": "hours"}),
        lambda data: data.isel(time=slice(0, 1)),
        lambda data: data.assign(level=data["level"].assign_attrs(units=np.array([1.0, 2.0]))),
        lambda data: data.assign(level=("time", np.full(96, 1e300), {"units": "m"})),
        lambda data: data.assign(level=("time", np.full(96, np.inf), {"units": "m"})),
        lambda data: data.assign(level=("time", np.array(["a"] * 96, dtype=object), {"units": "m"})),
        lambda data: data.assign(level=(("other", "time"), np.ones((2, 96)), {"units": "m"})),
        lambda data: data.assign(start=("time", np.zeros(96))),
        lambda data: data.assign(start=((), np.nan)),
    ],
)
def test_recordings_that_make_no_sense_are_refused(run, tmp_path, change):
    encoding = load_run(run).card.encoding
    time = ("time", np.arange(1, 97) * encoding.step, {"units": "seconds since 2001-01-01 00:00:00"})
    series = {
        name: ("time", np.ones(96), {"units": u}) for name, u in zip(encoding.recorded, encoding.units, strict=True)
    }
    whole = xr.Dataset(series, {"time": time})
    whole.to_netcdf(tmp_path / "whole.nc")
    assert read_window(tmp_path / "whole.nc", encoding).values.shape == (1, encoding.length, len(encoding.recorded))
    change(whole).to_netcdf(tmp_path / "r.nc")
    with pytest.raises(RecordingError, match=r"r\.nc"):
        read_window(tmp_path / "r.nc", encoding)
