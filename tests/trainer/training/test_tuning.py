"""The search for an estimator's options."""

import json
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import optuna
import pytest

from shared.errors import DatasetError, EstimatorError, OptionsError
from shared.store import DatasetFolder
from trainer.models import estimator_class
from trainer.reading.windows import WindowSource
from trainer.runs.checkpoint import load_run, read_card
from trainer.training.tuning import BEST, read_options, tune

from ..conftest import make_dataset
from ..test_cli import run as command

SETTINGS = {"model": "lstm", "steps": 3, "seed": 1, "context_hours": 6.0}


@pytest.fixture
def small(monkeypatch):
    """An LSTM that trains in no time."""
    kind = estimator_class("lstm")
    monkeypatch.setattr(kind.__init__, "__defaults__", (8, 1, 0.0))


@pytest.mark.slow
def test_a_search_keeps_its_best_and_goes_on(tanks, tmp_path, small, capsys, monkeypatch):
    looked = set()
    gather = WindowSource.gather

    def spy(self, rows, *arguments):
        looked.update(self.targets[rows].flatten().tolist())
        return gather(self, rows, *arguments)

    monkeypatch.setattr(WindowSource, "gather", spy)
    first = tune(tanks, tmp_path, trials=2, **SETTINGS)
    assert first.trials == 2
    cards = {folder.name: read_card(folder) for folder in sorted((tmp_path / "trials").iterdir())}
    assert list(cards) == ["0000", "0001"]
    assert cards["0000"].options == {"width": 8, "layers": 1, "dropout": 0.0}
    assert (cards["0000"].training.lr, cards["0000"].training.batch_size) == (1e-3, 16)
    assert first.default_loss == cards["0000"].training.validation_loss
    assert first.validation_loss == min(card.training.validation_loss for card in cards.values())

    again = tune(tanks, tmp_path, trials=4, **SETTINGS)
    assert again.trials == 4
    assert len(list((tmp_path / "trials").iterdir())) == 4
    assert again.validation_loss <= first.validation_loss
    assert read_options(tmp_path / BEST) == again
    before = (tmp_path / "study.db").read_bytes()
    assert tune(tanks, tmp_path, trials=4, **SETTINGS) == again
    assert (tmp_path / "study.db").read_bytes() == before

    monkeypatch.undo()
    records = load_run(tmp_path / "trials" / "0000").card.encoding
    index = DatasetFolder(tanks).load([])
    targets = records.targets(index.parameters)
    assert not looked & set(targets[index.of_split("test")].flatten().tolist())
    assert looked & set(targets[index.of_split("validation")].flatten().tolist())

    with pytest.raises(EstimatorError, match=r"study\.db: noise was 'none' and is 'gauge' now"):
        tune(tanks, tmp_path, trials=5, **SETTINGS | {"noise": "gauge"})

    out = tmp_path / "fitted"
    code, _, _ = command(
        capsys, "fit", tanks, "--options", tmp_path / BEST, "--steps", "2", "--out", out, "--option.layers", "2"
    )
    assert code == 0
    card = json.loads((out / "estimator.json").read_text())
    assert card["model"] == "lstm"
    assert card["options"] == again.options | {"layers": 2}
    assert (card["training"]["batch_size"], card["training"]["lr"]) == (again.batch_size, again.lr)
    code, _, err = command(
        capsys, "fit", tanks, "--options", tmp_path / BEST, "--model", "tcn", "--out", tmp_path / "x"
    )
    assert code == 1
    assert "is of the model lstm; expected tcn" in err


KILLED = """
import json, os, signal, sys
from trainer.models import estimator_class
from trainer.training import tuning
estimator_class("lstm").__init__.__defaults__ = (8, 1, 0.0)
fit = tuning.fit
def killed(*arguments, **settings):
    if arguments[1].name == "0001":
        os.kill(os.getpid(), signal.SIGKILL)
    return fit(*arguments, **settings)
tuning.fit = killed
tuning.tune(sys.argv[1], sys.argv[2], trials=3, **json.loads(sys.argv[3]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_search_that_was_killed_tries_the_cut_trial_again(tanks, tmp_path, small):
    """By a signal that no program can note, in the middle of its second trial."""
    words = [sys.executable, "-c", KILLED, str(tanks), str(tmp_path / "search"), json.dumps(SETTINGS)]
    assert subprocess.run(words, capture_output=True).returncode == -signal.SIGKILL
    storage = f"sqlite:///{tmp_path / 'search' / 'study.db'}"
    cut = optuna.load_study(study_name="tune", storage=storage).trials[1]
    assert cut.state is optuna.trial.TrialState.RUNNING
    best = tune(tanks, tmp_path / "search", trials=3, **SETTINGS)
    assert best.trials == 3
    assert sorted(folder.name for folder in (tmp_path / "search" / "trials").iterdir()) == ["0000", "0002", "0003"]
    study = optuna.load_study(study_name="tune", storage=storage)
    assert [one.params == cut.params for one in study.trials] == [False, True, True, False]


@pytest.fixture
def no_training(monkeypatch):
    """Trials take no time: the loss is the learning rate."""
    from trainer.training import tuning

    def fit(*_, lr, **__):
        return SimpleNamespace(card=SimpleNamespace(training=SimpleNamespace(validation_loss=lr, mean_loss=1.0)))

    monkeypatch.setattr(tuning, "fit", fit)


def failing(monkeypatch, error, *names):
    """Trials with these numbers fail, and all if none is named."""
    from trainer.training import tuning

    fit = tuning.fit

    def fails(*arguments, **settings):
        if not names or arguments[1].name in names:
            raise error
        return fit(*arguments, **settings)

    monkeypatch.setattr(tuning, "fit", fails)
    return lambda: monkeypatch.setattr(tuning, "fit", fit)


def test_an_error_that_is_not_of_the_options_ends_the_search(tanks, tmp_path, no_training, monkeypatch):
    mend = failing(monkeypatch, DatasetError("001.nc: damaged"), "0001")
    with pytest.raises(DatasetError, match=r"001\.nc: damaged"):
        tune(tanks, tmp_path, trials=3, **SETTINGS)
    assert not (tmp_path / BEST).exists()
    mend()
    assert tune(tanks, tmp_path, trials=3, **SETTINGS).trials == 3
    study = optuna.load_study(study_name="tune", storage=f"sqlite:///{tmp_path / 'study.db'}")
    assert [trial.state.name for trial in study.trials] == ["COMPLETE", "FAIL", "COMPLETE", "COMPLETE"]


def test_options_without_a_result_end_their_trial_only(tanks, tmp_path, no_training, monkeypatch):
    failing(monkeypatch, OptionsError("patch is 24 samples"), "0000", "0002")
    best = tune(tanks, tmp_path, trials=4, **SETTINGS)
    assert (best.trials, best.default_loss) == (4, None)
    failing(monkeypatch, OptionsError("the loss is not a finite number"))
    with pytest.raises(
        EstimatorError, match=r"no trial came to an end.* The last one: the loss is not a finite number"
    ):
        tune(tanks, tmp_path / "none", trials=2, **SETTINGS)


def test_a_search_that_goes_on_tries_something_new(tanks, tmp_path, no_training):
    for trials in (4, 7, 8):
        assert tune(tanks, tmp_path, trials=trials, **SETTINGS).trials == trials
    study = optuna.load_study(study_name="tune", storage=f"sqlite:///{tmp_path / 'study.db'}")
    tried = [tuple(trial.params.values()) for trial in study.get_trials()]
    assert len(set(tried)) == len(tried) == 8


def test_a_search_is_the_same_again(tanks, tmp_path, no_training):
    first, again = (tune(tanks, tmp_path / name, trials=3, **SETTINGS) for name in ("a", "b"))
    assert first == again
    assert first.options != tune(tanks, tmp_path / "c", trials=3, **SETTINGS | {"seed": 2}).options


def test_a_search_does_not_go_on_with_other_data(tmp_path, no_training):
    tune(make_dataset(tmp_path / "ds", systems=20), tmp_path / "out", trials=1, **SETTINGS)
    other = make_dataset(tmp_path / "other", systems=20, fmu_sha256="f" * 64)
    with pytest.raises(
        EstimatorError, match=r"study\.db: fmu_sha256 was '0{64}' and is 'f{64}' now; .*choose another folder"
    ):
        tune(other, tmp_path / "out", trials=2, **SETTINGS)


def test_a_search_lies_in_its_folder_whatever_its_name(tanks, tmp_path, no_training):
    tune(tanks, tmp_path / "a#b %41", trials=1, **SETTINGS)
    assert (tmp_path / "a#b %41" / "study.db").exists()
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == []


def test_what_cannot_be_searched_is_told(tanks, tmp_path):
    with pytest.raises(EstimatorError, match="ridge is solved, not trained"):
        tune(tanks, tmp_path, model="ridge")
    with pytest.raises(EstimatorError, match="trials: is 0"):
        tune(tanks, tmp_path, trials=0)
    with pytest.raises(EstimatorError, match="no such file; expected a file of `trainer tune`"):
        read_options(tmp_path / "none.json")
    (tmp_path / "bad.json").write_text('{"options": {}}')
    with pytest.raises(EstimatorError, match=r"bad\.json: model: Field required; expected a file of `trainer tune`"):
        read_options(tmp_path / "bad.json")


def test_a_second_search_in_a_folder_is_refused_and_does_not_fail_the_trial_under_way(
    tanks, tmp_path, no_training, monkeypatch
):
    from trainer.training import tuning

    fit = tuning.fit

    def meanwhile(*arguments, **settings):
        with pytest.raises(EstimatorError, match=rf"another run is at it \(process {os.getpid()} on"):
            tune(tanks, tmp_path, trials=3, **SETTINGS)
        return fit(*arguments, **settings)

    monkeypatch.setattr(tuning, "fit", meanwhile)
    assert tune(tanks, tmp_path, trials=2, **SETTINGS).trials == 2
    study = optuna.load_study(study_name="tune", storage=f"sqlite:///{tmp_path / 'study.db'}")
    assert [trial.state.name for trial in study.trials] == ["COMPLETE", "COMPLETE"]
