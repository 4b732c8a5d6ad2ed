"""Trainings that begin with the weights of another run."""

import json
import shutil

import numpy as np
import pytest
import torch

from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.training.fitting import fit

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


def test_a_training_does_not_begin_with_what_it_writes_over(tanks, tmp_path):
    settings = {"options": {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}, "context_hours": 12.0}
    fit(tanks, tmp_path / "run", steps=2, **settings)

    def files():
        return {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir() if path.name != ".lock"}

    before = files()
    with pytest.raises(EstimatorError, match=r"begin_with: is .*run, the folder to write to; expected another"):
        fit(tanks, tmp_path / "run", steps=2, begin_with=tmp_path / "run", overwrite=True, **settings)
    assert files() == before
