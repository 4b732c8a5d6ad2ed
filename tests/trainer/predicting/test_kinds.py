"""Of what systems errors and intervals are said to be, where these are not those of the training."""

import json
import logging

import pytest
import xarray as xr

from trainer.cli import app
from trainer.posterior import fit_posterior
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit

from ..conftest import TANK, make_dataset

PIPE = '[[uncertain]]\nname = "pipe"\nparameters = ["tank.pipe"]\nrelative = 0.3\n'
DRAWN = {"uncertain": [{"name": "pipe"}]}


def tanks_of(folder, root_seed, **settings):
    return make_dataset(folder, systems=60, root_seed=root_seed, text=f"{TANK}\n{PIPE}", settings=settings)


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kinds")
    return {
        "drawn": tanks_of(folder / "drawn", 1, **DRAWN),
        "declared": tanks_of(folder / "declared", 2),
        "calm": tanks_of(folder / "calm", 3, **DRAWN, calm=0.5),
    }


@pytest.fixture
def recording(datasets, tmp_path):
    with xr.open_dataset(datasets["drawn"] / "shards" / "000.nc") as opened:
        opened.load().isel(system=4, drop=True)[["level"]].to_netcdf(tmp_path / "r.nc")
    return tmp_path / "r.nc"


def told(run, path, capsys):
    capsys.readouterr()
    assert app(["predict", str(run), str(path)], result_action="return_value") in (None, 0)
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("fitted_to", ["drawn", "declared"])
def test_a_posterior_of_constants_as_declared_is_told(datasets, recording, tmp_path, capsys, caplog, fitted_to):
    """The estimator had them drawn: that its intervals are too narrow for others was told by nothing."""
    run = fit(datasets["drawn"], tmp_path / "run", model="ridge", steps=2)
    with caplog.at_level(logging.WARNING):
        posterior = fit_posterior(run, datasets[fitted_to], windows_per_system=2, epochs=1)
    held = [] if fitted_to == "drawn" else ["pipe"]
    assert posterior.card.dataset.held == held
    warned = "has as declared what the estimator has seen drawn, pipe: " in caplog.text
    assert warned == bool(held)
    found = predict(run, recording)
    assert (found.held, found.rmse_held, found.interval_held, found.interval_note) == ([], [], held, None)
    said = "The systems of the intervals have pipe as declared."
    assert (said in told(run.folder, recording, capsys)) == bool(held)


def test_errors_are_of_the_constants_of_the_last_training(datasets, recording, tmp_path, capsys):
    """The first training had them drawn, and the errors are of systems that have them as declared all the same."""
    options = {"width": 16, "layers": 1, "heads": 2, "feedforward": 16, "patch": 12}
    settings = {"model": "multiscale-transformer", "options": options, "steps": 1}
    fit(datasets["drawn"], tmp_path / "first", **settings)
    run = fit(datasets["declared"], tmp_path / "again", begin_with=tmp_path / "first", **settings)
    found = predict(run, recording)
    assert (found.held, found.rmse_held, found.interval_held) == ([], ["pipe"], None)
    assert "The systems of the rmse have pipe as declared." in told(run.folder, recording, capsys)
    path = run.folder / "estimator.json"  # as in cards of before, which know what both trainings had
    card = json.loads(path.read_text()) | {"schema_version": 4}
    del card["dataset"]
    path.write_text(json.dumps(card))
    assert load_run(run.folder).card.errors_held is None
    path.write_text(json.dumps(card | {"begun_with": None}))
    assert load_run(run.folder).card.errors_held == []
