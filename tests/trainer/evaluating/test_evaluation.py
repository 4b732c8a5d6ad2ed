import json
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from shared.ceiling import Ceiling, Ceilings, Origin, write_ceilings
from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.evaluating.evaluation import evaluate, figures_of_merit
from trainer.reading.windows import WindowSource
from trainer.runs.checkpoint import Run
from trainer.runs.systems import Systems
from trainer.training.fitting import fit

from ..conftest import TANK, make_dataset


def systems_looked_at(monkeypatch, run, dataset, tmp_path):
    """Rows gathered for each protocol, in the order of evaluation."""
    gather, looked = WindowSource.gather, []

    def spy(self, rows, starts, length=None):
        looked.append(set(rows.tolist()))
        return gather(self, rows, starts, length)

    monkeypatch.setattr(WindowSource, "gather", spy)
    result = evaluate(run, dataset, out=tmp_path)
    return result, looked


def test_unseen_windows_come_from_test_systems_alone(ridge_run, tanks, tmp_path, monkeypatch):
    result, looked = systems_looked_at(monkeypatch, ridge_run, tanks, tmp_path)
    records = DatasetFolder(tanks).load()
    assert list(result.protocols) == ["paper", "unseen"]
    assert looked == [set(range(100)), set(records.of_split("test").tolist())]
    assert result.protocols["paper"].systems_trained_on == 90
    assert result.protocols["unseen"].systems_trained_on == 0
    assert (result.protocols["unseen"].systems, result.protocols["unseen"].windows) == (10, 100)


def test_all_systems_of_another_root_seed_are_unseen(ridge_run, other_tanks, tmp_path, monkeypatch):
    result, looked = systems_looked_at(monkeypatch, ridge_run, other_tanks, tmp_path)
    assert looked == [set(range(20))]  # both protocols have the same windows, estimated once
    assert result.protocols["paper"] == result.protocols["unseen"]
    assert (result.protocols["paper"].systems, result.protocols["paper"].systems_trained_on) == (20, 0)


def test_systems_of_a_merged_dataset_are_known_by_seed_and_index(ridge_run, tanks):
    """Index 3 of another root seed is another system; one that was trained on is known wherever it lies."""
    records = DatasetFolder(tanks).load()
    half = np.arange(len(records.systems)) % 2 == 0
    joined = replace(records, seeds=np.where(half, 1, 2).astype(object))
    alone = ridge_run.card.seen(ridge_run.card.system_hash, records)
    assert alone.sum() == 90
    np.testing.assert_array_equal(ridge_run.card.seen(ridge_run.card.system_hash, joined), alone & half)
    kept = Systems.of(joined, np.array([0, 1]))
    assert kept.root_seeds == [1, 2]
    assert not ridge_run.card.seen("another system", records).any()


def test_a_run_that_has_seen_everything_cannot_be_evaluated(ridge_run, tanks, tmp_path):
    card = ridge_run.card.model_copy(deep=True)
    card.training_systems.indices = list(range(100))
    card.training_systems.root_seeds = [1] * 100
    with pytest.raises(EstimatorError, match="expected at least one test system"):
        evaluate(Run(card, ridge_run.model), tanks, out=tmp_path)


def test_figures_of_merit_of_known_estimates():
    rng = np.random.default_rng(0)
    truth = np.repeat(rng.uniform(1, 2, (20, 3)), 5, axis=0)
    estimate = np.stack([truth[:, 0], np.full(100, truth[:, 1].mean()), truth[:, 2] * 1.1], axis=1)
    truth[:, 2] *= 1.0
    found = figures_of_merit(
        ["a", "b", "c"], truth, estimate, np.repeat(np.arange(20), 5), np.isin(np.arange(20), [3, 4])
    )
    assert found.r2["a"] == 1
    assert found.r2_interval["a"] == (1, 1)
    assert found.r2["b"] == pytest.approx(0)
    c = truth[:, 2]
    assert found.r2["c"] == pytest.approx(1 - 0.01 * np.mean(c**2) / np.var(c))
    low, high = found.r2_interval["c"]
    assert low < found.r2["c"] < high
    assert found.r2_mean == pytest.approx(np.mean(list(found.r2.values())))
    assert found.relative_accuracy["c"] == pytest.approx(0.9)
    assert (found.windows, found.systems, found.systems_trained_on) == (100, 20, 2)


def test_a_parameter_whose_range_passes_zero_is_estimated(tmp_path):
    """Its targets are no logarithms; those of the other are, as ever."""
    text = TANK.replace('min = 1.0\nmax = 4.0\nscale = "log"', "min = -2.0\nmax = 4.0")
    dataset = make_dataset(tmp_path / "ds", text=text)
    run = fit(dataset, out=tmp_path / "run", model="ridge", steps=5)
    truth = np.array([[2.0, -2.0], [5.0, 0.0], [20.0, 4.0]])
    encoding = run.card.encoding
    np.testing.assert_allclose(encoding.estimates(encoding.targets(truth)), truth, atol=1e-5)
    assert encoding.target_mean[0] == pytest.approx(np.log10(11), abs=0.2)
    assert encoding.target_mean[1] == pytest.approx(1.0, abs=0.5)
    found = evaluate(run, dataset, out=tmp_path / "out").protocols["unseen"]
    assert found.r2["tank.fill"] > 0.95
    assert found.relative_accuracy["tank.fill"] > 0.8


def test_one_unseen_system_has_no_r2(ridge_run, tmp_path):
    few = make_dataset(tmp_path / "ds", systems=1, root_seed=8)
    found = evaluate(ridge_run, few, out=tmp_path / "out").protocols["unseen"]
    assert found.r2 == {"tank.drain": None, "tank.fill": None}
    assert found.r2_mean is None
    assert found.relative_accuracy["tank.fill"] > 0.8


def test_the_same_seed_gives_the_same_evaluation(ridge_run, tanks, tmp_path):
    first, again, other = (evaluate(ridge_run, tanks, windows=50, seed=s, out=tmp_path) for s in (1, 1, 2))
    assert first == again
    assert first != other


def test_the_files_and_the_picture_say_what_was_found(own_ridge, tanks):
    result = evaluate(own_ridge, tanks)
    written = json.loads((own_ridge / "evaluation.json").read_text())
    assert written == json.loads(result.model_dump_json())
    assert list(written["protocols"]) == ["paper", "unseen"]
    assert written["ceiling"] is None
    value = written["protocols"]["unseen"]["r2"]["tank.drain"]
    assert f"{value:.3f}" in (own_ridge / "evaluation.md").read_text()
    lines = (own_ridge / "evaluation.csv").read_text().splitlines()
    assert lines[0] == "protocol,parameter,r2,r2_low,r2_high,relative_accuracy,ceiling"
    assert len(lines) == 1 + 2 * 3
    assert lines[4].startswith(f"unseen,tank.drain,{value}")
    assert matplotlib.image.imread(own_ridge / "scatter.png").shape[1] > 400


TANKS = Origin(start=(0.0, 0.0), hours=240.0, warm_up_hours=0.0)


def ceilings_for(run, **changes):
    fields = {"context_hours": 24.0, "step": 1800.0, "noise": "none", "channels": ["level"], "origin": TANKS} | changes
    limit = Ceiling(
        **fields,
        r2={"tank.drain": 0.99, "tank.fill": 0.98},
        r2_mean=0.985,
        r2_mean_low=0.98,
        r2_mean_high=0.99,
        systems=10,
        seed=0,
    )
    return Ceilings(
        system_name="Tank",
        system_hash=run.card.system_hash,
        fmu_sha256="0" * 64,
        outputs=["level", "glow"],
        nuisances=["valve"],
        ceilings=[limit],
    )


def test_the_ceiling_of_the_same_condition_is_shown(ridge_run, tanks, tmp_path):
    path = tmp_path / "limits.json"
    write_ceilings(path, ceilings_for(ridge_run))
    found = evaluate(ridge_run, tanks, windows=20, ceiling=path, out=tmp_path)
    assert found.ceiling.r2["tank.fill"] == 0.98
    assert found.ceiling.r2_mean == 0.985
    assert "0.980" in (tmp_path / "evaluation.md").read_text()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"channels": ["level", "glow"]}, "none for 24 h, step 1800 s, noise none, channels level"),
        ({"origin": None}, "it is of the whole year; this dataset is of hours 0 to 240 of the year"),
        ({"origin": TANKS.model_copy(update={"weather": {"a.csv": "1" * 64}})}, "it is of weather a.csv with "),
    ],
)
def test_the_ceiling_of_another_condition_season_or_weather_is_not_shown(ridge_run, tmp_path, changes, said):
    january = make_dataset(tmp_path / "ds", systems=20, root_seed=2, settings={"weather": {"a.csv": "2" * 64}})
    path = tmp_path / "limits.json"
    write_ceilings(path, ceilings_for(ridge_run, **changes))
    found = evaluate(ridge_run, january, windows=20, ceiling=path, out=tmp_path)
    assert found.ceiling is None
    assert said in found.ceiling_note


def test_without_a_ceiling_a_sentence_says_why(ridge_run, tanks, tmp_path):
    found = evaluate(ridge_run, tanks, windows=20, out=tmp_path)
    assert "`datagen identifiability` writes one" in found.ceiling_note
    other = ceilings_for(ridge_run)
    other.system_hash = "f" * 64
    write_ceilings(tmp_path / "other.json", other)
    found = evaluate(ridge_run, tanks, windows=20, ceiling=tmp_path / "other.json", out=tmp_path)
    assert "is of another system" in found.ceiling_note


def test_a_dataset_of_another_system_is_refused(ridge_run, tmp_path):
    other = make_dataset(tmp_path / "ds", systems=10, text=TANK.replace("max = 20.0", "max = 21.0"))
    with pytest.raises(EstimatorError, match=r"its system is Tank .*; the run was trained on Tank"):
        evaluate(ridge_run, other, out=tmp_path)


def test_a_dataset_of_another_step_or_too_short_is_refused(ridge_run, tmp_path):
    fine = make_dataset(tmp_path / "fine", systems=10, text=TANK.replace("step = 1800.0", "step = 900.0"))
    with pytest.raises(EstimatorError, match="its step is 900 s; the run was trained on 1800 s"):
        evaluate(ridge_run, fine, out=tmp_path)
    short = make_dataset(tmp_path / "short", systems=10, text=TANK.replace("hours = 240.0", "hours = 12.0"))
    with pytest.raises(EstimatorError, match="its records have 24 samples; the context is 48"):
        evaluate(ridge_run, short, out=tmp_path)


@pytest.mark.parametrize("hours", [12.0, float("nan")])
def test_a_context_that_was_not_trained_is_refused(ridge_run, tanks, tmp_path, hours):
    with pytest.raises(EstimatorError, match=r"context is \S+ h; the run was trained on 24 h"):
        evaluate(ridge_run, tanks, context_hours=hours, out=tmp_path)


def test_relative_accuracy_is_that_of_the_middle_window():
    """Accuracies 0.9, 0.8, 0.7, 0.6 and, of one that is far off, -9: the one in the middle is 0.7."""
    truth = np.array([[1.0], [2.0], [4.0], [5.0], [8.0]])
    estimate = truth * np.array([[0.9], [1.2], [0.7], [1.4], [11.0]])
    found = figures_of_merit(["a"], truth, estimate, np.arange(5), np.zeros(5, dtype=bool))
    assert found.relative_accuracy["a"] == pytest.approx(0.7)
