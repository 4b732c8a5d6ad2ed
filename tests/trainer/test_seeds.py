"""Seeds that numpy does not take."""

import pytest
import torch

import trainer
from shared.errors import EstimatorError
from trainer.posterior import fit_posterior
from trainer.posterior.inference import Posterior
from trainer.reading.noise import Sensors
from trainer.seeds import torch_state
from trainer.training.tuning import tune

from .test_cli import run

SENTENCE = "seed: is -1; expected a whole number of at least 0"


@pytest.mark.parametrize("command", ["fit", "evaluate", "calibration", "predict", "posterior", "tune"])
def test_a_negative_seed_is_a_sentence_and_exit_code_1(own_ridge, tanks, tmp_path, capsys, command):
    words = {
        "fit": (tanks, "--out", tmp_path / "new", "--model", "mean"),
        "tune": (tanks, "--out", tmp_path / "new", "--model", "lstm"),
        "predict": (own_ridge, tanks / "shards" / "000.nc"),
    }
    code, out, err = run(capsys, command, *words.get(command, (own_ridge, tanks)), "--seed", "-1")
    assert (code, out, err) == (1, "", f"error: {SENTENCE}\n")
    assert not (tmp_path / "new").exists()


def test_it_is_told_to_those_who_call_functions(own_ridge, tanks, tmp_path):
    for call in (
        lambda: fit_posterior(own_ridge, tanks, seed=-1),
        lambda: tune(tanks, tmp_path, model="lstm", seed=-1),
        lambda: Posterior.sample_encoded(None, torch.zeros(1, 1, 1), torch.zeros(1), 5, seed=-1),
    ):
        with pytest.raises(EstimatorError, match=SENTENCE):
            call()


def test_a_fit_and_an_evaluation_with_one_seed_have_noise_of_their_own(tanks, tmp_path, monkeypatch):
    seeds = set()
    call = Sensors.__call__

    def spy(self, values, generator):
        seeds.add(generator.initial_seed())
        return call(self, values, generator)

    monkeypatch.setattr(Sensors, "__call__", spy)
    trainer.fit(tanks, tmp_path / "run", model="mean", noise="gauge", seed=0)
    fitted = set(seeds)
    seeds.clear()
    trainer.evaluate(tmp_path / "run", tanks, windows=20, seed=0)
    assert len(fitted) == 3 and len(seeds) == 1  # of windows, of what is familiar, of validation errors
    assert not fitted & seeds


def test_torchs_state_is_put_back():
    torch.manual_seed(3)
    expected = torch.rand(2)
    torch.manual_seed(3)
    with torch_state(7, 1):
        torch.rand(5)
    assert torch.equal(torch.rand(2), expected)
