"""Facts as static inputs: what is revealed in training, and what an estimate makes of a known parameter."""

import numpy as np
import pytest
import torch
import xarray as xr

from shared.errors import EstimatorError
from tests.trainer.conftest import make_dataset
from trainer.posterior.fitting import fit_posterior
from trainer.predicting.prediction import predict
from trainer.reading.facts import Reveal
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit


def test_a_random_part_is_revealed_in_training_and_none_by_default():
    facts = torch.randn(4000, 5)
    columns = Reveal(3, 2)(facts, torch.Generator().manual_seed(1))
    values, known = columns[:, :5], columns[:, 5:] > 0
    assert torch.equal(values[known], facts[known])
    assert not values[~known].any()
    none = (~known[:, :3]).all(dim=1).float().mean().item()
    # 0.4 of the windows, and those of the others in which chance reveals none: the mean of (1 - 0.8 u)^3
    assert none == pytest.approx(0.4 + 0.6 * (1 - 0.2**4) / (4 * 0.8), abs=0.03)
    assert not Reveal(3, 2, "nothing")(facts, torch.Generator())[:, 5:].any()
    given = Reveal(3, 2, "given")(facts, torch.Generator())[:, 5:]
    assert not given[:, :3].any() and given[:, 3:].all()


@pytest.fixture(scope="module")
def knowing(tmp_path_factory):
    """An estimator of tanks that reads known parameters, with next to no training."""
    data = make_dataset(tmp_path_factory.mktemp("facts") / "ds", systems=60)
    options = {"width": 16, "layers": 1, "feedforward": 16}
    folder = tmp_path_factory.mktemp("facts") / "run"
    run = fit(data, folder, model="multiscale-transformer", facts=True, steps=2, options=options)
    fit_posterior(run, data, epochs=1)
    return load_run(run.folder), data


def test_a_known_parameter_is_the_answer_and_its_samples(knowing, tmp_path):
    run, data = knowing
    with xr.open_dataset(data / "shards" / "000.nc") as opened:
        record = opened.load().isel(system=4, drop=True)[["level"]].isel(time=slice(0, 100))
    record.to_netcdf(tmp_path / "tank.nc")
    plain = predict(run, tmp_path / "tank.nc").predictions[0].parameters
    told = predict(run, tmp_path / "tank.nc", known={"tank.fill": 2.5})
    fill = told.predictions[0].parameters["tank.fill"]
    assert told.facts == {"tank.fill": 2.5}
    assert fill.value == 2.5
    assert fill.low == pytest.approx(2.5) and fill.high == pytest.approx(2.5)
    assert told.predictions[0].parameters["tank.drain"].low < told.predictions[0].parameters["tank.drain"].high
    assert plain["tank.fill"].low < plain["tank.fill"].high
    values, stamp = record["level"].values[None, -48:, None], np.array([0.0])
    answers = run.read(values, stamp, np.array([[np.nan, 2.5]]))
    assert 10 ** (answers[0, 1].item() * run.card.encoding.target_sd[1] + run.card.encoding.target_mean[1]) == (
        pytest.approx(2.5, rel=1e-5)
    )


def test_what_an_estimator_does_not_read_is_refused(knowing, ridge_run, tmp_path):
    run, data = knowing
    file = data / "shards" / "000.nc"
    with pytest.raises(EstimatorError, match="the run reads no facts"):
        predict(ridge_run, file, known={"tank.fill": 2.0})
    with pytest.raises(EstimatorError, match=r"'tank\.fil' is not a fact"):
        predict(run, file, known={"tank.fil": 2.0})
    with pytest.raises(EstimatorError, match="expected 1 to 4"):
        predict(run, file, known={"tank.fill": 9.0})
