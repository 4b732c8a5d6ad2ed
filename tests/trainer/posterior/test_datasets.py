"""Figures of a run and of its posterior say of which dataset they are: those of two datasets had looked alike."""

import json

import pytest

from shared.store import DatasetFolder
from trainer.evaluating.evaluation import evaluate
from trainer.posterior import calibration, fit_posterior
from trainer.reading.data import fingerprint
from trainer.reading.kind import Kind
from trainer.training.fitting import fit

from ..conftest import TANK, make_dataset

PIPE = '[[uncertain]]\nname = "pipe"\nparameters = ["tank.pipe"]\nrelative = 0.3\n'


def test_figures_say_of_which_dataset_they_are(tmp_path):
    text, drawn = f"{TANK}\n{PIPE}", {"uncertain": [{"name": "pipe"}], "calm": 0.5}
    of = make_dataset(tmp_path / "declared", systems=60, root_seed=1, text=text)
    other = make_dataset(tmp_path / "drawn", systems=20, root_seed=2, text=text, settings=drawn)
    run = fit(of, tmp_path / "run", model="ridge", steps=2)
    fit_posterior(run, of, windows_per_system=2, epochs=1)
    for dataset, heading in (
        (of, "root seed 1, constants as declared"),
        (other, "root seed 2, constants drawn, 0.5 without excitation"),
    ):
        evaluate(run, dataset, windows=20)
        calibration(run, dataset, windows=20, samples=20)
        mark = fingerprint(DatasetFolder(dataset))
        for name in ("evaluation", "calibration"):
            facts = json.loads((run.folder / f"{name}.json").read_text())["dataset"]
            assert facts["fingerprint"] == mark
            assert (facts["held"], facts["drawn"]) == ((["pipe"], []) if dataset == of else ([], ["pipe"]))
            lines = (run.folder / f"{name}.md").read_text().splitlines()
            assert lines[0].endswith(heading)
            assert any(line.startswith("- dataset: ") and mark[:12] in line for line in lines)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"systems": 3, "root_seeds": [1], "fingerprint": None, "held": []}, []),  # that makes no other kind
        ({"start": (0.0, 8760.0)}, ["240 h from hours 0 to 8760 of the year, not 240 h from hour 0 of the year"]),
        ({"excitation": False}, ["without excitation, not excited where the system can be"]),
    ],
)
def test_other_kinds_are_told_in_words(tanks, change, sentence):
    dataset = DatasetFolder(tanks)
    kind = Kind.of(dataset, dataset.load([]))
    assert kind.model_copy(update=change).unlike(kind) == sentence
