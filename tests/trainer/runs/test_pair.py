"""Weights and their card change at one moment, whenever a process is killed."""

import os
from pathlib import Path

import numpy as np
import pytest

from shared.errors import EstimatorError
from trainer.posterior import fit_posterior, load_posterior
from trainer.runs import pair
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit

QUICK = {"systems": 8, "windows_per_system": 2, "epochs": 1}
WINDOWS = np.random.default_rng(0).uniform(0.5, 4, (3, 48, 1))


def killed(monkeypatch, name):
    """The process goes just before a file would get the name, or a name that begins so."""
    replace = os.replace

    def cut(source, target, **more):
        if Path(target).name.startswith(name):
            raise KeyboardInterrupt
        replace(source, target, **more)

    monkeypatch.setattr(os, "replace", cut)


def answers(folder):
    run = load_run(folder)
    return run.card.model, run.estimate(WINDOWS, np.zeros(3)).tolist()


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(("before", "new"), [("estimator.json", False), ("weights.safetensors", True)])
def test_a_killed_training_leaves_an_estimator_whole(own_ridge, tanks, tmp_path, monkeypatch, before, new):
    fit(tanks, tmp_path / "next", model="mean")
    expected = answers(tmp_path / "next" if new else own_ridge)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        killed(patch, before)
        fit(tanks, own_ridge, model="mean", overwrite=True)
    assert answers(own_ridge) == expected
    fit(tanks, own_ridge, model="ridge", steps=2, overwrite=True)
    assert answers(own_ridge)[0] == "ridge"
    assert not any(name.startswith("weights-") for name in names(own_ridge))


@pytest.mark.parametrize(("before", "new"), [("posterior.json", False), ("posterior.safetensors", True)])
def test_a_killed_fit_of_a_posterior_leaves_one_whole(own_ridge, tanks, monkeypatch, before, new):
    fit_posterior(own_ridge, tanks, **QUICK)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        killed(patch, before)
        fit_posterior(own_ridge, tanks, **QUICK, seed=7, overwrite=True)
    assert load_posterior(load_run(own_ridge)).card.seed == (7 if new else 0)
    fit_posterior(own_ridge, tanks, **QUICK, seed=8, overwrite=True)
    assert load_posterior(load_run(own_ridge)).card.seed == 8
    assert not any(name.startswith("posterior-") for name in names(own_ridge))


def test_a_training_that_takes_the_place_removes_a_posterior_that_was_cut_off(own_ridge, tanks, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        killed(patch, "posterior.safetensors")
        fit_posterior(own_ridge, tanks, **QUICK)
    assert load_posterior(load_run(own_ridge)) is not None
    fit(tanks, own_ridge, model="mean", overwrite=True)
    assert {name for name in names(own_ridge) if name.startswith("posterior")} == set()


def test_a_card_cannot_name_weights_elsewhere(own_ridge, tmp_path):
    (tmp_path / "run-.safetensors").write_bytes(b"")
    for name in ("/../../run-", "", "0" * 63, "*"):
        with pytest.raises(EstimatorError, match=r"damaged, or not the weights that estimator\.json describes"):
            pair.read_pair(own_ridge / "weights.safetensors", name, "estimator.json", "fit it again")
