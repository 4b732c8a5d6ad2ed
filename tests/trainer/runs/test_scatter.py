"""Answers made means: factors against draws of the lognormal distribution, and against the truth of a training."""

import json
import shutil

import numpy as np
import pytest

from shared.store import DatasetFolder
from trainer.evaluating.evaluation import evaluate
from trainer.models.mean import Mean
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import load_run
from trainer.runs.scatter import means_from
from trainer.training.fitting import fit


def test_the_mean_of_lognormal_draws():
    sd = 0.8
    drawn = np.exp(sd * np.random.default_rng(0).standard_normal(400_000))
    assert means_from(np.array([[sd]]))[0] == pytest.approx(drawn.mean(), rel=0.005)


@pytest.fixture(scope="module")
def poor(tanks, tmp_path_factory):
    """A run that answers the mean of the logarithm, whatever it reads."""
    folder = tmp_path_factory.mktemp("scatter") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Mean, "means", True)
        return fit(tanks, folder, model="mean", noise="none gauge")


def test_estimates_are_right_on_average_where_answers_are_too_low(poor, tanks):
    records = DatasetFolder(tanks).load(["level"])
    values = records.values[:, :, :48].transpose(0, 2, 1)
    begins = np.zeros(len(values))
    means, answers = poor.estimate(values, begins), poor.card.encoding.estimates(poor.read(values, begins))
    drain = records.parameters[:, 0]  # uniform from 2 to 20 h: mean 11 h, geometric mean 9.5 h
    spread = drain.std() / np.sqrt(len(drain))
    assert answers[:, 0].mean() < drain.mean() - 2 * spread
    assert abs(means[:, 0].mean() - drain.mean()) < 2 * spread
    assert np.mean((means[:, 0] - drain) ** 2) < np.mean((answers[:, 0] - drain) ** 2)


def test_all_that_estimates_says_the_same(poor, tanks, tmp_path):
    dataset = DatasetFolder(tanks)
    path = tanks / "shards" / "000.nc"
    found = predict(poor, path).predictions[3].parameters
    values = dataset.load(["level"]).values[3:4, :, -48:].transpose(0, 2, 1)
    scatter = [one.scatter for one in poor.card.validation_errors if one.length == 48]
    assert len(scatter) == 2  # of both presets
    factors = np.exp(0.5 * np.mean([np.square(list(one.values())) for one in scatter], axis=0))
    answer = poor.card.encoding.estimates(poor.read(values, np.array([dataset.load(["level"]).time[-48]])))[0]
    for k, one in enumerate(found.values()):
        assert one.value == pytest.approx(answer[k] * factors[k], rel=1e-5)
    whole = evaluate(poor, tanks, noise="none", out=tmp_path / "with").protocols["unseen"].r2["tank.drain"]
    plain = shutil.copytree(poor.folder, tmp_path / "plain")
    card = json.loads((plain / "estimator.json").read_text())
    for one in card["validation_errors"]:
        one["scatter"] = None
    (plain / "estimator.json").write_text(json.dumps(card))
    assert evaluate(plain, tanks, noise="none").protocols["unseen"].r2["tank.drain"] < whole
    assert load_run(plain).estimate(values, np.zeros(1)) == pytest.approx(
        poor.card.encoding.estimates(poor.read(values, np.zeros(1)))
    )


def test_the_paper_s_network_answers_as_the_paper_says(tanks, tmp_path):
    run = fit(tanks, tmp_path / "run", steps=2)
    assert run.card.model == "patch-transformer"
    assert all(one.scatter is None for one in run.card.validation_errors)
    values = DatasetFolder(tanks).load(["level"]).values[:2, :, :48].transpose(0, 2, 1)
    scaled = run.read(values, np.zeros(2)).double().numpy()
    encoding = run.card.encoding
    np.testing.assert_allclose(
        run.estimate(values, np.zeros(2)), 10 ** (scaled * encoding.target_sd + encoding.target_mean), rtol=1e-6
    )
