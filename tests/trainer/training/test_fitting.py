import csv

import numpy as np
import pytest
import torch

from shared.errors import DatasetError, EstimatorError, OptionsError
from shared.store import DatasetFolder
from trainer.cli import main as command
from trainer.evaluating.evaluation import evaluate
from trainer.models.regressions import Regressions
from trainer.reading.windows import Sampler
from trainer.runs.checkpoint import Training, load_run
from trainer.training.fitting import fit

from ..conftest import TANK, interrupt_after, make_dataset

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

    first = weights(3, "a")
    torch.rand(7)  # the host's random numbers have moved on
    assert weights(3, "b") == first
    assert weights(4, "c") != first


def test_the_hosts_torch_is_left_as_it_was(tanks, tmp_path):
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    fit(tanks, tmp_path / "run", options=SMALL, steps=2)
    assert torch.equal(torch.rand(3), expected)
    assert torch.get_num_threads() == 1


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


def test_the_loss_of_the_mean_is_its_own_where_few_systems_validate(tmp_path, caplog, capsys):
    """Targets are standardised by training systems, so that the loss of the mean on one other system is not 1."""
    dataset = make_dataset(tmp_path / "few", systems=12)
    command(["fit", str(dataset), "--model", "mean", "--out", str(tmp_path / "run")])
    done = load_run(tmp_path / "run").card.training
    assert abs(done.validation_loss - 1) > 0.05
    assert done.mean_loss == pytest.approx(done.validation_loss, rel=1e-5)
    said = f"validation loss {done.validation_loss:.4f} (the mean's: {done.mean_loss:.4f})"
    assert said in capsys.readouterr().err
    command(["info", str(tmp_path / "run")])
    assert said.removeprefix("validation loss ") in capsys.readouterr().out
    ridge = fit(dataset, tmp_path / "ridge", model="ridge").card.training
    assert ridge.mean_loss == pytest.approx(done.mean_loss, rel=1e-5)


def test_a_card_of_an_earlier_version_has_no_loss_of_the_mean(tanks, tmp_path):
    card = fit(tanks, tmp_path / "run", model="mean").card.training.model_dump() | {"validation_loss": 0.5}
    del card["mean_loss"]
    assert Training(**card).loss_text() == "0.5000"


@pytest.mark.parametrize(
    ("model", "given"),
    [
        *(("ridge", one) for one in ({"minutes": 1}, {"lr": 0.1}, {"keep": "last"})),
        *(("mean", one) for one in ({"minutes": 1}, {"lr": 7}, {"steps": 9}, {"batch_size": 3}, {"keep": "last"})),
    ],
)
def test_what_a_solved_estimator_makes_no_use_of_is_refused(tanks, tmp_path, model, given):
    """The card had told a budget of a minute that nothing took."""
    with pytest.raises(EstimatorError, match=rf"{next(iter(given))}: {model} is solved, .*; leave it out"):
        fit(tanks, tmp_path / "run", model=model, **given)
    assert not (tmp_path / "run").exists()


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


def test_a_loss_that_never_was_a_number_leaves_nothing(tanks, tmp_path, monkeypatch):
    poison(monkeypatch, 0)
    with pytest.raises(EstimatorError, match="at step 1; none is kept"):
        fit(tanks, tmp_path / "run", options=SMALL, steps=40)
    assert [path.name for path in (tmp_path / "run").iterdir()] == [".lock"]


def test_a_learning_rate_that_explodes_is_told(tanks, tmp_path):
    with pytest.raises(EstimatorError, match=r"try a learning rate below 1e\+30"):
        fit(tanks, tmp_path / "run", options=SMALL, steps=1000, lr=1e30)


def test_ctrl_c_leaves_the_best_estimator_so_far(tanks, tmp_path, monkeypatch):
    interrupt_after(30, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        fit(tanks, tmp_path / "run", options=SMALL, steps=100)
    card = load_run(tmp_path / "run").card
    assert card.training.stopped == "interrupted"
    assert card.validation_errors == []  # who stops it does not wait for them


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
        ({"threads": 0}, "threads: is 0; expected 1 to 256"),
        ({"threads": 10**9}, "threads: is 1000000000; expected 1 to 256"),
        (
            {"model": "multiscale-transformer", "context_hours": 24, "other_contexts": [12, 3]},
            "other_contexts: the shortest has 6 samples; expected at least a patch's 12",
        ),
        ({"keep": "worst"}, "keep: is 'worst'; expected best or last"),
        ({"lr": float("nan")}, "lr: is nan"),
        ({"context_hours": 1000}, "the dataset's records have 480 samples"),
        ({"context_hours": float("nan")}, "context is nan h; expected a whole number of steps"),
        ({"context_hours": float("inf")}, "context is inf h; expected a whole number of steps"),
        ({"context_hours": 1e306}, r"context is 1e\+306 h; expected a whole number of steps"),
        ({"context_hours": 1e300}, r"context is 1e\+300 h \(2e\+300 samples\); the dataset's records have 480"),
        ({"model": "lstm", "options": {"dropout": 1.5}}, "lstm: dropout "),
        ({"model": "lstm", "options": {"dropout": "x"}}, "lstm: option 'dropout' is 'x'; expected a number"),
        ({"model": "lstm", "options": {"dropout": float("nan")}}, "lstm: option 'dropout' is nan; expected a number"),
        ({"model": "lstm", "options": {"width": float("inf")}}, "'width' is inf; expected a whole number"),
        ({"noise": "loud"}, "not a preset of Tank"),
        ({"channels": ["heat"]}, "'heat' is not a channel of Tank"),
    ],
)
def test_wrong_arguments_are_told(tanks, tmp_path, arguments, sentence):
    with pytest.raises(EstimatorError, match=sentence):
        fit(tanks, tmp_path / "run", **arguments)
    assert not (tmp_path / "run").exists()


def test_batches_that_memory_does_not_hold_are_told(tanks, tmp_path):
    with pytest.raises(
        EstimatorError, match=r"not enough memory for steps of \d+ windows \(batch_size\) .*; expected less"
    ):
        fit(tanks, tmp_path / "run", options=SMALL, steps=1, batch_size=10**14)


def test_a_run_folder_that_cannot_be_made_is_told(tanks, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(EstimatorError, match=r"file/run: nothing can be written there, because .*file is a file"):
        fit(tanks, tmp_path / "file" / "run", model="mean")


def test_channels_can_be_any_output_input_or_clock(tanks, tmp_path):
    run = fit(tanks, tmp_path / "run", channels=["glow", "valve", "time_of_day"], options=SMALL, steps=2)
    assert run.card.encoding.channels == ["glow", "valve", "time_of_day"]
    assert run.card.encoding.units == ["lx", "1"]


def test_another_system_needs_another_description_only(tmp_path):
    text = TANK.replace("tank.", "pot.").replace('"level"', '"depth"').replace('unit = "h"', 'unit = "min"')
    renamed = make_dataset(tmp_path / "ds", systems=30, text=text)
    run = fit(renamed, tmp_path / "run", model="ridge", steps=1)
    assert run.card.encoding.parameters == ["pot.drain", "pot.fill"]
    assert run.card.encoding.channels == ["depth"]


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


@pytest.mark.parametrize("times", [0.6, 3.2])
def test_a_processor_that_computes_bfloat16_in_software_is_told(tanks, tmp_path, monkeypatch, caplog, times):
    monkeypatch.setattr("trainer.training.fitting.slowdown", lambda: times)
    with caplog.at_level("WARNING"):
        fit(tanks, tmp_path / "rough", model="multiscale-transformer", coarse=True, steps=1)
    assert ("take 3.2 times as long" in caplog.text) == (times > 1)


def test_a_coarse_training_is_a_training_of_its_own(tanks, tmp_path):
    settings = {"model": "regression-transformer", "options": SMALL | {"patch": 12, "views": 2}, "steps": 40}
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
    with pytest.raises(EstimatorError, match="coarse was True and is None now"):
        resume_after_a_stop(tanks, tmp_path / "cut", settings, coarse=True)


def resume_after_a_stop(dataset, folder, settings, **first):
    """Begin a training, stop it, and go on without what ``first`` says."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("trainer.training.loop.Loop._validate", stopping)
        fit(dataset, folder, **settings, **first)
    return fit(dataset, folder, resume=True, **settings)


def stopping(loop, *_):
    loop._keep()
    raise KeyboardInterrupt


def test_a_gradient_that_is_no_number_ends_the_training_with_a_sentence(tanks, tmp_path, monkeypatch):
    """The loss was still one; the step would have made all weights none, and the next loss a traceback."""
    taken = []

    def clipped(parameters, largest):
        taken.append(largest)
        return torch.tensor(torch.nan if len(taken) == 30 else 1.0)

    monkeypatch.setattr(torch.nn.utils, "clip_grad_norm_", clipped)
    with pytest.raises(EstimatorError, match=r"not a finite number at step 30; the estimator of step \d+ is kept"):
        fit(tanks, tmp_path / "run", model="multiscale-transformer", options=SMALL | {"patch": 12}, steps=40)
    assert load_run(tmp_path / "run").card.training.stopped == "not a number"


@pytest.mark.parametrize(("training", "at"), [(True, 6), (False, 4)])
def test_equations_that_cannot_be_solved_end_the_training_with_a_sentence(tanks, tmp_path, monkeypatch, training, at):
    """torch says of a matrix that is none that it has no factors, by an error of its own."""
    solve, seen = Regressions._solve, []

    def fails(self, moments):
        seen.append(self.training)
        # the validation after every second step is of a single forward pass
        last = self.training == training and seen.count(training) == (6 if training else 2)
        return solve(self, moments * torch.nan if last else moments)

    monkeypatch.setattr("trainer.training.loop.CHECKS", 20)
    monkeypatch.setattr(Regressions, "_solve", fails)
    with pytest.raises(OptionsError, match=rf"not a finite number at step {at}; the estimator of step \d+ is kept"):
        fit(
            tanks, tmp_path / "run", model="regression-transformer", options=SMALL | {"patch": 12, "views": 1}, steps=40
        )
    run = load_run(tmp_path / "run")
    assert (run.card.training.stopped, run.card.training.best_step) == ("not a number", 4 if training else 2)


def test_a_last_validation_that_is_no_number_is_told_where_none_came_before(tanks, tmp_path, monkeypatch):
    """A budget of minutes that ends before the first validation; no estimator is there to be loaded."""
    monkeypatch.setattr("trainer.training.loop.Loop._validate", lambda *_: False)
    with pytest.raises(OptionsError, match=r"the loss is not a finite number at step [0-9]+; none is kept"):
        fit(tanks, tmp_path / "run", model="lstm", minutes=1e-3)
