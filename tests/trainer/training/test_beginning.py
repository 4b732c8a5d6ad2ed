"""Trainings that begin with the weights of another run."""

import json
import shutil

import numpy as np
import pytest
import torch

from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.reading.familiar import unlike
from trainer.training.fitting import fit

from ..conftest import TANK, make_dataset

SMALL = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32, "dropout": 0.0}


def test_a_training_begins_with_the_weights_of_another(tanks, tmp_path):
    options = SMALL | {"patch": 12}
    first = fit(tanks, tmp_path / "first", model="multiscale-transformer", options=options, steps=3)
    again = fit(
        *(tanks, tmp_path / "again"),
        model="regression-transformer",
        options=options | {"views": 1},
        steps=1,
        lr=1e-12,
        begin_with=tmp_path / "first",
    )
    assert again.card.begun_with == first.card.weights_sha256
    assert first.card.begun_with is None
    given, kept = first.model.state_dict(), again.model.state_dict()
    for name, weight in given.items():
        torch.testing.assert_close(kept[name], weight, atol=1e-6, rtol=1e-5)
    assert again.card.training.validation_loss == pytest.approx(first.card.training.validation_loss, rel=1e-4)


def test_weights_of_another_kind_are_not_taken_over(tanks, tmp_path):
    options = SMALL | {"patch": 12}
    first = fit(tanks, tmp_path / "first", model="multiscale-transformer", options=options, steps=1)
    with pytest.raises(EstimatorError, match="first: length is 48; expected 24, as in this training"):
        fit(tanks, tmp_path / "a", model=first.card.model, options=options, context_hours=12, begin_with=first.folder)
    with pytest.raises(EstimatorError, match="first: patch is 12; expected 6, as in this training"):
        fit(tanks, tmp_path / "b", model=first.card.model, options=options | {"patch": 6}, begin_with=first.folder)
    more = fit(tanks, tmp_path / "more", model="regression-transformer", options=options, steps=1)
    with pytest.raises(EstimatorError, match="expected no such weights"):
        fit(tanks, tmp_path / "c", model=first.card.model, options=options, begin_with=more.folder)
    with pytest.raises(EstimatorError, match="begin_with: ridge is not trained step by step; leave it out"):
        fit(tanks, tmp_path / "d", model="ridge", begin_with=fit(tanks, tmp_path / "ridge", model="ridge").folder)
    other = make_dataset(tmp_path / "other", systems=30, root_seed=5, text=TANK.replace("sd = 0.02", "sd = 0.03"))
    with pytest.raises(EstimatorError, match="first: is of another system description or FMU"):
        fit(other, tmp_path / "e", model=first.card.model, options=options, begin_with=first.folder)


def test_a_training_that_begins_with_weights_of_another_dataset_reads_windows_as_that_one_did(
    tanks, other_tanks, tmp_path
):
    options = SMALL | {"patch": 12}
    settings = {"model": "multiscale-transformer", "options": options, "steps": 2}
    first = fit(tanks, tmp_path / "first", **settings)
    alone = fit(other_tanks, tmp_path / "alone", **settings)
    again = fit(other_tanks, tmp_path / "again", begin_with=tmp_path / "first", **settings)
    assert again.card.encoding == first.card.encoding != alone.card.encoding
    for dataset in (tanks, other_tanks):  # what either was trained on or chosen by is not unseen
        folder = DatasetFolder(dataset)
        index = folder.load([])
        seen = again.card.seen(folder.manifest.system_hash, index)
        assert np.flatnonzero(~seen).tolist() == index.of_split("test").tolist()
    resumed = fit(other_tanks, tmp_path / "again", begin_with=tmp_path / "first", resume=True, **settings)
    assert resumed.card.weights_sha256 == again.card.weights_sha256
    # the same systems, differently simulated: encoding and systems seen are the same, the data are not
    manifest = json.loads((other_tanks / "manifest.json").read_text())
    elsewhere = shutil.copytree(other_tanks, tmp_path / "elsewhere")
    (elsewhere / "manifest.json").write_text(json.dumps(manifest | {"settings": manifest["settings"] | {"calm": 0.5}}))
    with pytest.raises(EstimatorError, match=r"dataset was '.*' and is '.*' now; resume with the same, or overwrite"):
        fit(elsewhere, tmp_path / "again", begin_with=tmp_path / "first", resume=True, **settings)


PIPE = '[[uncertain]]\nname = "pipe"\nparameters = ["tank.pipe"]\nrelative = 0.3\n'


@pytest.mark.parametrize("drawn", ["first", "last", "neither", "not known"])
def test_a_run_remembers_the_constants_that_either_training_has_seen_drawn(tmp_path, drawn):
    text, settings = (
        f"{TANK}\n{PIPE}",
        {"model": "multiscale-transformer", "options": SMALL | {"patch": 12}, "steps": 1},
    )
    datasets = [
        make_dataset(tmp_path / name, systems=20, root_seed=k, text=text, settings={"uncertain": []} if one else None)
        for k, (name, one) in enumerate([("a", drawn == "first"), ("b", drawn == "last")])
    ]
    first = fit(datasets[0], tmp_path / "first", **settings)
    assert first.card.held == ([] if drawn == "first" else ["pipe"])
    if drawn == "not known":  # as in cards of earlier versions
        path = tmp_path / "first" / "estimator.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"held": None, "familiar": []}))
    again = fit(datasets[1], tmp_path / "again", begin_with=tmp_path / "first", **settings).card
    assert again.held == {"neither": ["pipe"], "not known": None}.get(drawn, [])
    assert [one.length for one in again.familiar] == ([] if drawn == "not known" else [48])


def test_what_either_training_has_seen_is_familiar(tanks, tmp_path):
    settings = {"model": "multiscale-transformer", "options": SMALL | {"patch": 12}, "steps": 1}
    fit(tanks, tmp_path / "first", **settings)
    # two tanks are far from what eighty are
    few = make_dataset(tmp_path / "few", systems=10, root_seed=2)
    alone = fit(few, tmp_path / "alone", **settings, systems=2).card
    again = fit(few, tmp_path / "again", begin_with=tmp_path / "first", **settings, systems=2).card
    records = DatasetFolder(tanks).load(["level"])
    windows = [records.values[row, :, :48].T for row in records.of_split("train")]

    def odd(card):
        return sum(bool(unlike(window, card.familiar[0], card.encoding)) for window in windows)

    assert odd(alone) > 20
    assert odd(again) == 0


def test_a_training_does_not_begin_with_what_it_writes_over(tanks, tmp_path):
    settings = {"options": {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}, "context_hours": 12.0}
    fit(tanks, tmp_path / "run", steps=2, **settings)
    before = {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    with pytest.raises(EstimatorError, match=r"begin_with: is .*run, the folder to write to; expected another"):
        fit(tanks, tmp_path / "run", steps=2, begin_with=tmp_path / "run", overwrite=True, **settings)
    assert {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before
