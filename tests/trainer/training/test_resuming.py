"""A training that was killed goes on to the same weights."""

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
import torch

from shared.errors import EstimatorError
from trainer.models.base import Recipe, Shape
from trainer.models.patch_transformer import PatchTransformer
from trainer.reading.windows import Sampler
from trainer.runs.checkpoint import load_run, read_card
from trainer.runs.state import STATE, optimiser_tensors, read_state, restore_optimiser, write_state
from trainer.training.fitting import fit
from trainer.training.loop import Loop
from trainer.training.optimisers import make_optimisers

SMALL = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32, "dropout": 0.2}
SETTINGS = {"options": SMALL, "noise": "gauge", "context_hours": 12.0, "seed": 3}

CHILD = """
import json, sys
import trainer.training.loop
from trainer.training.fitting import fit
trainer.training.loop.SAVE_SECONDS = 0.2
arguments = json.loads(sys.argv[3])
fit(sys.argv[1], sys.argv[2], resume=True, **arguments)
"""


def weights(folder):
    return (folder / "weights.safetensors").read_bytes()


@pytest.fixture
def stopping(monkeypatch):
    """Makes a training stop with Ctrl-C at a draw of the sampler, having kept its state after every step."""

    def at(draws):
        draw, seen = Sampler.draw, []

        def interrupted(self, count):
            seen.append(1)
            if len(seen) == draws:
                raise KeyboardInterrupt
            return draw(self, count)

        monkeypatch.setattr("trainer.training.loop.SAVE_SECONDS", -1.0)
        monkeypatch.setattr(Sampler, "draw", interrupted)

    return at


@pytest.fixture
def cut_short(tanks, tmp_path, stopping, monkeypatch):
    """Settings of a training in ``run`` that was stopped half way."""
    settings = SETTINGS | {"steps": 40}
    stopping(20)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, tmp_path / "run", **settings)
    monkeypatch.undo()
    return settings


@pytest.mark.slow
def test_a_training_that_was_killed_ends_with_the_weights_of_one_that_was_not(tanks, tmp_path):
    settings = SETTINGS | {"steps": 250}
    fit(tanks, tmp_path / "whole", **settings)
    command = [sys.executable, "-c", CHILD, str(tanks), str(tmp_path / "killed"), json.dumps(settings)]
    state, reached = tmp_path / "killed" / STATE, 0
    child = subprocess.Popen(command)
    try:
        while reached < 20:
            assert child.poll() is None, "it ended before it could be killed"
            time.sleep(0.02)
            reached = read_state(state)[1]["step"] if state.exists() else 0
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
    assert reached < 250
    assert not (tmp_path / "killed" / "curve.csv").exists()
    fit(tanks, tmp_path / "killed", resume=True, **settings)
    assert weights(tmp_path / "killed") == weights(tmp_path / "whole")
    assert not state.exists()
    whole, killed = (read_card(tmp_path / name) for name in ("whole", "killed"))
    assert killed.training.model_copy(update={"seconds": 0}) == whole.training.model_copy(update={"seconds": 0})
    assert killed.validation_rmse == whole.validation_rmse


@pytest.mark.parametrize(("model", "options"), [("patch-transformer", SMALL), ("summary-mlp", {"width": 16})])
def test_an_interrupted_training_goes_on(tanks, tmp_path, stopping, monkeypatch, caplog, model, options):
    settings = SETTINGS | {"model": model, "options": options, "steps": 40, "batch_size": 8}
    ends, finish = [], Loop._finish

    def spy(self, stopped):
        ends.append({name: weight.clone() for name, weight in self.network.state_dict().items()})
        finish(self, stopped)

    monkeypatch.setattr(Loop, "_finish", spy)
    fit(tanks, tmp_path / "whole", **settings)
    stopping(30)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, tmp_path / "cut", **settings)
    monkeypatch.undo()
    step = read_state(tmp_path / "cut" / STATE)[1]["step"]
    assert 20 < step < 30
    monkeypatch.setattr(Loop, "_finish", spy)
    restore, begun = Loop._restore, []
    monkeypatch.setattr(Loop, "_restore", lambda self: begun.append(restore(self)) or begun[-1])
    fit(tanks, tmp_path / "cut", resume=True, **settings)
    assert begun == [True]
    whole, cut, resumed = ends
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    assert not all(torch.equal(whole[name], cut[name]) for name in whole)
    assert "written with" not in caplog.text  # by these very versions
    assert weights(tmp_path / "cut") == weights(tmp_path / "whole")
    curves = [(tmp_path / name / "curve.csv").read_text().splitlines() for name in ("whole", "cut")]
    assert [line.split(",")[::2] for line in curves[0]] == [line.split(",")[::2] for line in curves[1]]


def test_a_finished_training_is_left_as_it_is(tanks, tmp_path):
    settings = SETTINGS | {"steps": 4}
    fit(tanks, tmp_path / "run", resume=True, **settings)

    def times():
        return {path.name: path.stat().st_mtime_ns for path in (tmp_path / "run").iterdir() if path.name != ".lock"}

    before = times()
    fit(tanks, tmp_path / "run", resume=True, **settings)
    assert times() == before
    with pytest.raises(EstimatorError, match=r"seed was 3 and is 4 now; resume with the same"):
        fit(tanks, tmp_path / "run", resume=True, **settings | {"seed": 4})
    with pytest.raises(EstimatorError, match="steps was 4 and is 5 now"):
        fit(tanks, tmp_path / "run", resume=True, **settings | {"steps": 5})
    with pytest.raises(EstimatorError, match="both are given"):
        fit(tanks, tmp_path / "run", resume=True, overwrite=True, **settings)


def test_another_training_is_not_resumed_and_can_be_overwritten(tanks, tmp_path, cut_short):
    settings = cut_short
    for name, other, words in (
        ("noise", "none", "noise was 'gauge' and is 'none' now"),
        ("systems", 40, "training systems was 80 and is 40 now"),
        ("options", SMALL | {"layers": 2}, "options was"),
    ):
        with pytest.raises(EstimatorError, match=words):
            fit(tanks, tmp_path / "run", resume=True, **settings | {name: other})
    fit(tanks, tmp_path / "run", overwrite=True, **settings)
    fit(tanks, tmp_path / "fresh", **settings)
    assert weights(tmp_path / "run") == weights(tmp_path / "fresh")
    assert not (tmp_path / "run" / STATE).exists()


def test_a_state_of_another_version_is_told_and_gone_on_with(tanks, tmp_path, cut_short, caplog):
    settings = cut_short
    state = tmp_path / "run" / STATE
    parts, facts = read_state(state)
    ours = facts["versions"]
    assert set(ours) == {"zeroshot-fmu", "python", "torch", "numpy"}
    write_state(state, parts, facts | {"versions": ours | {"torch": "1.0"}})
    with caplog.at_level("WARNING"):
        assert fit(tanks, tmp_path / "run", resume=True, **settings).card.training.steps == 40
    assert f"written with torch 1.0, and this is {ours['torch']}" in caplog.text


def test_a_damaged_state_is_named(tanks, tmp_path, cut_short):
    settings = cut_short
    state = tmp_path / "run" / STATE
    state.write_bytes(state.read_bytes()[:-100])
    with pytest.raises(EstimatorError, match=r"state\.safetensors: damaged .*remove it to train from the beginning"):
        fit(tanks, tmp_path / "run", resume=True, **settings)
    state.unlink()
    assert fit(tanks, tmp_path / "run", resume=True, **settings).card.training.steps == 40


def test_fewer_training_systems_are_the_first_ones(tanks, tmp_path):
    run = fit(tanks, tmp_path / "few", model="mean", systems=7)
    whole = fit(tanks, tmp_path / "all", model="mean")
    assert run.card.training_systems.indices == whole.card.training_systems.indices[:7]
    assert run.card.validation_systems == whole.card.validation_systems
    assert load_run(tmp_path / "few").card.encoding.target_mean != whole.card.encoding.target_mean
    for wrong in (0, 1, 81):  # one alone had losses in log10, told as shares of the spread
        with pytest.raises(EstimatorError, match=f"systems: is {wrong}; expected 2 to the 80 training systems"):
            fit(tanks, tmp_path / "none", model="mean", systems=wrong)


@pytest.mark.parametrize("optimiser", ["adamax", "adamw", "muon"])
def test_every_optimiser_goes_on_as_if_nothing_had_happened(tmp_path, optimiser):
    shape = Shape(length=24, outputs=1, recorded=1, columns=1, parameters=2, step=3600.0)
    recipe = replace(Recipe(), optimiser=optimiser)
    torch.manual_seed(0)
    batches = [torch.randn(4, 24, 1) for _ in range(6)]

    def made():
        torch.manual_seed(1)
        network = PatchTransformer(shape, patch=6, width=8, layers=1, heads=2, feedforward=8, dropout=0.0)
        return network, make_optimisers(network, recipe)

    def train(network, optimisers, some):
        for batch in some:
            network.zero_grad()
            network(batch, torch.zeros(4)).square().mean().backward()
            for one in optimisers:
                one.step()

    network, optimisers = made()
    train(network, optimisers, batches[:3])
    parts = {"network": network.state_dict()} | {str(k): optimiser_tensors(o) for k, o in enumerate(optimisers)}
    write_state(tmp_path / STATE, parts, {})
    train(network, optimisers, batches[3:])
    other, others = made()
    parts, _ = read_state(tmp_path / STATE)
    other.load_state_dict(parts["network"])
    for k, one in enumerate(others):
        restore_optimiser(one, parts[str(k)])
    train(other, others, batches[3:])
    for name, weight in network.state_dict().items():
        assert torch.equal(weight, other.state_dict()[name]), name
