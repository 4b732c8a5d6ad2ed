"""A training that was killed goes on to the same weights."""

import json
import signal
import subprocess
import sys
import time

import pytest

from shared.errors import EstimatorError
from trainer.runs.checkpoint import load_run, read_card
from trainer.runs.state import STATE, read_state, write_state
from trainer.training.fitting import fit

from ..conftest import interrupt_after

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
        monkeypatch.setattr("trainer.training.loop.SAVE_SECONDS", -1.0)
        interrupt_after(draws - 1, monkeypatch)

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
    settings = SETTINGS | {"steps": 150}
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
    assert reached < 150
    assert not (tmp_path / "killed" / "curve.csv").exists()
    fit(tanks, tmp_path / "killed", resume=True, **settings)
    assert weights(tmp_path / "killed") == weights(tmp_path / "whole")
    assert not state.exists()
    whole, killed = (read_card(tmp_path / name) for name in ("whole", "killed"))
    assert killed.training.model_copy(update={"seconds": 0}) == whole.training.model_copy(update={"seconds": 0})
    assert killed.validation_rmse == whole.validation_rmse


@pytest.mark.parametrize(
    ("model", "options"),
    [
        ("patch-transformer", SMALL),  # Adamax
        ("multiscale-transformer", SMALL | {"patch": 12}),  # Muon, and AdamW beside it
        ("summary-mlp", {"width": 16}),
    ],
)
def test_an_interrupted_training_goes_on(tanks, tmp_path, stopping, monkeypatch, caplog, model, options):
    settings = SETTINGS | {"model": model, "options": options, "steps": 16, "batch_size": 8, "keep": "last"}
    fit(tanks, tmp_path / "whole", **settings)
    stopping(12)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, tmp_path / "cut", **settings)
    monkeypatch.undo()
    step = read_state(tmp_path / "cut" / STATE)[1]["step"]
    assert 6 < step < 12
    cut = weights(tmp_path / "cut")
    fit(tanks, tmp_path / "cut", resume=True, **settings)
    assert cut != weights(tmp_path / "whole")
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
