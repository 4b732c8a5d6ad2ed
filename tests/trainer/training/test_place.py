"""One training at a time in a run folder, and no estimator lost for one that has not come about."""

import os

import pytest

from shared.errors import EstimatorError
from shared.lock import FolderLock
from trainer.evaluating.evaluation import evaluate
from trainer.runs.state import STATE, read_state
from trainer.training.fitting import fit

from ..conftest import interrupt_after

SMALL = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}
SETTINGS = {"options": SMALL, "context_hours": 12.0}


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".lock"}


def test_no_run_is_written_into_a_dataset(tanks):
    with pytest.raises(EstimatorError, match=r"is a dataset \(it has a manifest.json\); expected a folder for the run"):
        fit(tanks, tanks, model="mean", overwrite=True)


def test_where_nothing_can_be_written_is_said_before_the_work(old_file, tanks):
    with pytest.raises(EstimatorError, match="nothing can be written there"):
        fit(tanks, old_file / "run", model="mean")
    fit(tanks, old_file.parent / "run", model="mean")
    with pytest.raises(EstimatorError, match="nothing can be written there"):
        evaluate(old_file.parent / "run", tanks, out=old_file / "results", windows=0)


@pytest.fixture
def old_file(tmp_path):
    """Where a folder would be expected."""
    (tmp_path / "file").write_text("")
    return tmp_path / "file"


@pytest.fixture
def old(tanks, tmp_path):
    """A finished and evaluated estimator in ``run``."""
    fit(tanks, tmp_path / "run", model="mean")
    evaluate(tmp_path / "run", tanks, windows=20)
    return tmp_path / "run"


def test_a_second_training_in_a_folder_is_refused(tanks, tmp_path):
    """That the lock of a killed one is free again: tests/shared/test_lock.py."""
    (tmp_path / "run").mkdir()
    for more in ({}, {"overwrite": True}, {"resume": True}):
        with (
            FolderLock(tmp_path / "run"),
            pytest.raises(EstimatorError, match=rf"run: another run is at it \(process {os.getpid()} on"),
        ):
            fit(tanks, tmp_path / "run", **SETTINGS, **more, steps=2)


def test_an_estimator_outlives_a_training_that_is_stopped_early_and_can_be_gone_on_with(tanks, old, monkeypatch):
    before = contents(old)
    interrupt_after(0, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, old, overwrite=True, steps=4, **SETTINGS)
    monkeypatch.undo()
    found = contents(old)
    assert read_state(old / STATE)[1]["step"] == 0
    del found[STATE]
    assert found == before
    run = fit(tanks, old, resume=True, steps=4, **SETTINGS)
    assert (run.card.model, run.card.training.steps) == ("patch-transformer", 4)
    assert set(contents(old)) == {"estimator.json", "weights.safetensors", "curve.csv", "curve.png"}
    whole = fit(tanks, old.parent / "whole", steps=4, **SETTINGS)
    assert run.card.weights_sha256 == whole.card.weights_sha256


def test_a_resumption_that_is_refused_takes_nothing_away(tanks, old, monkeypatch):
    interrupt_after(0, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, old, overwrite=True, steps=4, **SETTINGS)
    monkeypatch.undo()
    before = contents(old)
    assert "evaluation.json" in before
    with pytest.raises(EstimatorError, match="seed was 0 and is 1 now"):
        fit(tanks, old, resume=True, steps=4, seed=1, **SETTINGS)
    assert contents(old) == before
