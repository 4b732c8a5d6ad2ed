import csv

import numpy as np
import pytest
import torch

from shared.errors import DatasetError, EstimatorError, OptionsError
from shared.store import DatasetFolder
from trainer.evaluating.evaluation import evaluate
from trainer.reading.windows import Sampler
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit

from ..conftest import make_dataset

SMALL = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32, "dropout": 0.0}


@pytest.mark.parametrize(("model", "steps"), [("ridge", 2), ("summary-mlp", 150)])
def test_an_estimator_recovers_what_can_be_recovered_from_unseen_tanks(tanks, tmp_path, model, steps):
    run = fit(tanks, tmp_path / "run", model=model, steps=steps)
    unseen = evaluate(run, tanks).protocols["unseen"]
    assert min(unseen.r2.values()) > 0.9
    assert unseen.systems == 10


def test_the_patch_transformer_learns(tanks, tmp_path):
    options = SMALL | {"width": 32}
    run = fit(tanks, tmp_path / "run", patch=12, options=options, steps=400, batch_size=32, lr=5e-3)
    assert evaluate(run, tanks).protocols["unseen"].r2["tank.fill"] > 0.9
    assert run.card.options["patch"] == 12


def test_equal_seeds_give_equal_runs_and_others_do_not(tanks, tmp_path):
    def weights(seed, name):
        options = SMALL | {"dropout": 0.2}
        fit(tanks, tmp_path / name, options=options, steps=12, noise="gauge", seed=seed)
        return (tmp_path / name / "weights.safetensors").read_bytes()

    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    first = weights(3, "a")
    assert torch.equal(torch.rand(3), expected)  # the host's random numbers are its own, and have moved on now
    assert torch.get_num_threads() == 1
    assert weights(3, "b") == first
    assert weights(4, "c") != first


def test_the_run_folder_says_how_it_came_about(tanks, tmp_path):
    run = fit(tanks, tmp_path / "run", model="lstm", options={"width": 8}, steps=20, context_hours=12, seed=9)
    assert {p.name for p in run.folder.iterdir()} - {".lock"} == {
        "weights.safetensors",
        "estimator.json",
        "curve.csv",
        "curve.png",
    }
    card, dataset = run.card, DatasetFolder(tanks)
    assert (card.model, card.context_hours, card.encoding.length, card.training.steps) == ("lstm", 12, 24, 20)
    assert (card.training.seed, card.training.batch_size, card.training.lr) == (9, 16, 1e-3)
    assert (card.system_hash, card.fmu_sha256) == (dataset.manifest.system_hash, dataset.manifest.fmu_sha256)
    records = dataset.load()
    assert set(card.training_systems.root_seeds) == {1}
    assert card.training_systems.indices == records.systems[records.of_split("train")].tolist()
    assert card.validation_systems.indices == records.systems[records.of_split("validation")].tolist()
    assert set(card.validation_rmse) == {"tank.drain", "tank.fill"}
    assert 0 < card.validation_rmse["tank.drain"] < 20
    rows = list(csv.DictReader((run.folder / "curve.csv").open()))
    assert int(rows[-1]["step"]) == 20
    losses = [float(row["validation_loss"]) for row in rows]
    assert min(losses) == pytest.approx(card.training.validation_loss, rel=1e-4)
    assert int(rows[int(np.argmin(losses))]["step"]) == card.training.best_step


def test_the_last_weights_are_kept_on_demand(tanks, tmp_path):
    """A learning rate that is far too large makes the validation worse: an early step is the best one."""
    arguments = {"model": "lstm", "options": {"width": 8}, "steps": 60, "context_hours": 12, "lr": 0.3}
    best = fit(tanks, tmp_path / "best", **arguments)
    last = fit(tanks, tmp_path / "last", **arguments, keep="last")
    rows = [list(csv.DictReader((run.folder / "curve.csv").open())) for run in (best, last)]
    losses = [[float(row["validation_loss"]) for row in one] for one in rows]
    assert losses[0] == losses[1]
    assert losses[0][-1] > min(losses[0])
    assert (best.card.training.keep, last.card.training.keep) == ("best", "last")
    assert best.card.training.validation_loss == pytest.approx(min(losses[0]), rel=1e-4)
    assert last.card.training.validation_loss == pytest.approx(losses[0][-1], rel=1e-4)
    assert last.card.training.best_step == 60


def test_mean_answers_with_the_mean_of_the_training_targets(tanks, tmp_path):
    run = fit(tanks, tmp_path / "run", model="mean")
    records = DatasetFolder(tanks).load()
    training = records.parameters[records.of_split("train")]
    answer = run.estimate(records.values[:2, :, :48].transpose(0, 2, 1), np.zeros(2))
    np.testing.assert_allclose(answer, [10 ** np.log10(training).mean(axis=0)] * 2, rtol=1e-5)
    scores = evaluate(run, tanks).protocols["unseen"].r2
    assert max(scores.values()) <= 0


def poison(monkeypatch, after):
    """Windows become NaN after so many training batches."""
    draw, seen = Sampler.draw, []

    def bad(self, count):
        batch = draw(self, count)
        seen.append(1)
        return batch._replace(windows=batch.windows * np.nan) if len(seen) > after else batch

    monkeypatch.setattr(Sampler, "draw", bad)


def test_a_loss_that_is_not_a_number_stops_and_keeps_the_last_good_estimator(tanks, tmp_path, monkeypatch):
    poison(monkeypatch, 25)
    with pytest.raises(OptionsError, match=r"not a finite number at step 26; the estimator of step \d+ is kept"):
        fit(tanks, tmp_path / "run", options=SMALL, steps=40)
    run = load_run(tmp_path / "run")
    assert run.card.training.stopped == "not a number"
    assert 0 < run.card.training.best_step <= 25
    assert np.isfinite(run.estimate(np.ones((1, 48, 1)), np.zeros(1))).all()


def test_a_budget_in_minutes_is_kept(tanks, tmp_path):
    run = fit(tanks, tmp_path / "run", options=SMALL, minutes=0.02)
    assert run.card.training.stopped == "minutes"
    assert 1.2 <= run.card.training.seconds < 8


def test_an_estimator_is_replaced_only_on_demand(tanks, tmp_path):
    fit(tanks, tmp_path / "run", model="mean")
    evaluate(tmp_path / "run", tanks, windows=20)
    with pytest.raises(EstimatorError, match="already holds an estimator"):
        fit(tanks, tmp_path / "run", model="mean")
    fit(tanks, tmp_path / "run", model="mean", overwrite=True)
    assert not (tmp_path / "run" / "evaluation.json").exists()


def test_a_dataset_without_validation_systems_is_refused(tmp_path):
    few = make_dataset(tmp_path / "ds", systems=2)
    with pytest.raises(DatasetError, match="none of its 2 systems is in the split 'validation'"):
        fit(few, tmp_path / "run")


def test_a_dataset_with_missing_values_is_refused(tmp_path, monkeypatch):
    from .. import conftest

    simulate = conftest.simulate_tanks

    def with_a_hole(*arguments):
        outputs = simulate(*arguments)
        outputs[1, 0, 5] = np.nan
        return outputs

    monkeypatch.setattr(conftest, "simulate_tanks", with_a_hole)
    damaged = make_dataset(tmp_path / "ds", systems=20)
    with pytest.raises(DatasetError, match="level of system 1 is not finite throughout"):
        fit(damaged, tmp_path / "run")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"model": "forest"}, "'forest' is not an estimator"),
        ({"model": "ridge", "patch": 12}, "ridge has no patches"),
        ({"steps": 10, "minutes": 1}, "both are given"),
        ({"steps": 0}, "steps: is 0; expected a positive number"),
        ({"threads": 10**9}, "threads: is 1000000000; expected 1 to 256"),
        (
            {"model": "multiscale-transformer", "context_hours": 24, "other_contexts": [12, 3]},
            "other_contexts: the shortest has 6 samples; expected at least a patch's 12",
        ),
        ({"keep": "worst"}, "keep: is 'worst'; expected best or last"),
        ({"lr": float("nan")}, "lr: is nan"),
        ({"context_hours": 1000}, "the dataset's records have 480 samples"),
        ({"context_hours": float("nan")}, "context is nan h; expected a whole number of steps"),
        ({"context_hours": 1e300}, r"context is 1e\+300 h \(2e\+300 samples\); the dataset's records have 480"),
        ({"model": "lstm", "options": {"dropout": 1.5}}, "lstm: dropout "),
        ({"model": "lstm", "options": {"dropout": "x"}}, "lstm: option 'dropout' is 'x'; expected a number"),
        ({"model": "lstm", "options": {"width": float("inf")}}, "'width' is inf; expected a whole number"),
        ({"noise": "loud"}, "not a preset of Tank"),
        ({"channels": ["heat"]}, "'heat' is not a channel of Tank"),
    ],
)
def test_wrong_arguments_are_told(tanks, tmp_path, arguments, sentence):
    with pytest.raises(EstimatorError, match=sentence):
        fit(tanks, tmp_path / "run", **arguments)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("damage", "words"), [(None, "it is missing"), (b"CDF no more", "damaged or changed")])
def test_a_missing_or_damaged_shard_is_named(tmp_path, damage, words):
    dataset = make_dataset(tmp_path / "ds", systems=30)
    shard = dataset / "shards" / "001.nc"
    shard.unlink()
    if damage:
        shard.write_bytes(damage)
    with pytest.raises(DatasetError, match=rf"001\.nc: .*{words}"):
        fit(dataset, tmp_path / "run", model="mean")
    assert not (tmp_path / "run").exists()


def test_a_coarse_training_is_a_training_of_its_own(tanks, tmp_path):
    settings = {"model": "regression-transformer", "options": SMALL | {"patch": 12, "views": 2}, "steps": 8}
    exact = fit(tanks, tmp_path / "exact", **settings)
    rough = fit(tanks, tmp_path / "rough", coarse=True, **settings)
    assert (exact.card.training.coarse, rough.card.training.coarse) == (False, True)
    assert rough.card.weights_sha256 != exact.card.weights_sha256
    assert rough.card.training.validation_loss == pytest.approx(exact.card.training.validation_loss, rel=0.05)
    values = DatasetFolder(tanks).load().values[:5, :, :48].transpose(0, 2, 1)[..., :1]
    first = rough.estimate(values, np.zeros(5))
    rough.model.coarse = False  # estimates have all digits either way
    assert np.array_equal(rough.estimate(values, np.zeros(5)), first)
    with pytest.raises(EstimatorError, match="coarse: lstm is trained with all digits only"):
        fit(tanks, tmp_path / "lstm", model="lstm", coarse=True, steps=1)
