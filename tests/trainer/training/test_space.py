"""Where a search looks for options."""

import pytest

from shared.errors import EstimatorError
from trainer.models import ESTIMATORS, estimator_class
from trainer.training.space import space_of


@pytest.mark.parametrize("model", [name for name in ESTIMATORS if name not in ("mean", "ridge")])
def test_every_trained_estimator_has_a_space(model):
    space = space_of(model)
    assert {"lr", "batch_size", "width", "dropout"} < set(space)
    assert space["lr"][1] == estimator_class(model).recipe.lr


def test_what_is_solved_is_not_searched():
    with pytest.raises(EstimatorError, match="ridge is solved, not trained"):
        space_of("ridge")
