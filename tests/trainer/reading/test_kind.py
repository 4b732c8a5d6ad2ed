"""What is noted of a dataset beside a fit or a figure."""

import pytest

from shared.store import DatasetFolder
from trainer.reading.data import fingerprint
from trainer.reading.kind import Kind

from ..conftest import TANK, make_dataset

PIPE = '[[uncertain]]\nname = "pipe"\nparameters = ["tank.pipe"]\nrelative = 0.3\n'


def kind_of(folder, **settings):
    dataset = DatasetFolder(make_dataset(folder, systems=20, root_seed=7, text=f"{TANK}\n{PIPE}", settings=settings))
    found = Kind.of(dataset, dataset.load([]))
    assert found.fingerprint == fingerprint(dataset)
    return found


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"systems": 3, "root_seeds": [1], "fingerprint": None, "held": []}, []),  # that makes no other kind
        ({"start": (0.0, 8760.0)}, ["240 h from hours 0 to 8760 of the year, not 240 h from hour 0 of the year"]),
        ({"excitation": False}, ["without excitation, not excited where the system can be"]),
    ],
)
def test_other_kinds_are_told_in_words(tmp_path, change, sentence):
    kind = kind_of(tmp_path / "a")
    assert kind.model_copy(update=change).unlike(kind) == sentence
