"""What lies at the end of a range is told in the scale of the prior, as diagnosis does."""

import numpy as np
import pytest

from shared.store import DatasetFolder
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import Run

# [h] from 2 to 20, linear; [m] from 1 to 4, in the logarithm: a thousandth of it ends at 1.00139, and begins at 3.99446
PLACES = [
    ([2.017, 1.0013], [True, True]),
    ([19.981, 3.9940], [False, False]),
]


def answering(estimate, monkeypatch):
    """Let runs answer parameters to whatever they read."""
    monkeypatch.setattr(
        Run, "read", lambda run, values, *_: run.card.encoding.targets(np.tile(estimate, (len(values), 1)))
    )


@pytest.mark.parametrize(("estimate", "at_bound"), PLACES)
def test_a_bound_is_near_in_the_scale_of_the_prior(ridge_run, tanks, monkeypatch, estimate, at_bound):
    assert ridge_run.card.encoding.logarithmic == [p.scale == "log" for p in DatasetFolder(tanks).system.parameters]
    answering(estimate, monkeypatch)
    found = predict(ridge_run, tanks / "shards" / "000.nc").predictions[0].parameters
    assert [one.at_bound for one in found.values()] == at_bound
