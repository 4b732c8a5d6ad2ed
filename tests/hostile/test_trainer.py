"""Readers of ``trainer`` on damaged files, and on run folders made to do harm."""

import json

import pytest
import torch
from safetensors.torch import load_file, save_file

from shared.errors import EstimatorError
from shared.store import sha256_of
from tests.hostile import cases_trainer
from tests.hostile.properties import property_of
from trainer.runs.checkpoint import load_run
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
        (("options", "layers"), 10**9),
        (("encoding", "length"), 10**7),
        (("encoding", "step"), float("nan")),
        (("encoding", "sd"), [0.0, 0.0]),
        (("encoding", "mean"), [1.0] * 50),
        (("encoding", "outputs"), -1),
        (("encoding", "derived"), ["no clock"]),
        (("training_systems", "indices"), "0-99999999999"),
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
