"""Where a search looks for options."""

import pytest

from trainer.models import ESTIMATORS, build
from trainer.models.base import Shape
from trainer.training.space import space_of


class Choices:
    """A trial that takes the default, and remembers between what it could have chosen."""

    def __init__(self):
        self.found = []

    def suggest_categorical(self, name, values):
        self.found = values

    def suggest_int(self, name, low, high):
        self.found = [low, high]

    def suggest_float(self, name, low, high, log=False):
        self.found = [low, high]


@pytest.mark.parametrize("model", [name for name in ESTIMATORS if name not in ("mean", "ridge")])
def test_an_estimator_can_be_built_with_whatever_is_suggested(model):
    """A patch of four samples has no six alignments, which ``regression-transformer`` has."""
    shape = Shape(length=168, columns=6, recorded=4, outputs=2, parameters=3, step=3600.0)
    for name, (suggest, default) in space_of(model).items():
        trial = Choices()
        suggest(trial, name, default)
        assert trial.found
        if name not in ("lr", "batch_size"):
            for value in trial.found:
                build(model, shape, {name: value})
