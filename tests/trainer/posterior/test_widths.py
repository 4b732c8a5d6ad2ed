"""The width of intervals, as a share of the prior's range in its own scale."""

from types import SimpleNamespace

import numpy as np
import pytest

from trainer.posterior.assessment import _figures_of_merit
from trainer.posterior.prior import Prior
from trainer.runs.validation import Typical


def test_samples_of_the_prior_are_as_wide_as_it_is():
    """Nine tenths of the range; along a logarithmic one of three decades it had been 0.71 of a linear range."""
    prior = Prior(np.array([2.0, 1.0]), np.array([20.0, 1000.0]), np.array([False, True]))
    rng = np.random.default_rng(0)
    truth, drawn = prior.from_unit(rng.random((40, 2))), prior.from_unit(rng.random((40, 2000, 2)))
    posterior = SimpleNamespace(
        prior=prior, run=SimpleNamespace(card=SimpleNamespace(encoding=SimpleNamespace(parameters=["a", "b"])))
    )
    rows = np.arange(40)
    found = _figures_of_merit(
        *(posterior, truth, drawn, truth, Typical(None, "none"), rng.random((40, 2)), np.zeros(40), rows, rows)
    )
    assert [one.width for one in found["parameters"].values()] == pytest.approx([0.9, 0.9], abs=0.01)
