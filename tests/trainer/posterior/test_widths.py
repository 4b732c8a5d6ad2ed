"""The width of intervals, as a share of the prior's range in its own scale."""

from types import SimpleNamespace

import numpy as np
import pytest

from trainer.posterior.assessment import _figures_of_merit
from trainer.posterior.prior import Prior
from trainer.posterior.report import _share
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


@pytest.mark.parametrize(("systems", "known"), [(1, False), (10, True)])
def test_coverage_of_ten_covered_systems_has_a_width_and_of_one_there_is_no_interval(systems, known):
    prior = Prior(np.array([2.0]), np.array([20.0]), np.array([False]))
    posterior = SimpleNamespace(
        prior=prior, run=SimpleNamespace(card=SimpleNamespace(encoding=SimpleNamespace(parameters=["a"])))
    )
    rng = np.random.default_rng(0)
    truth, drawn = prior.from_unit(rng.random((20, 1))), prior.from_unit(rng.random((20, 50, 1)))
    where, inside = np.arange(20) % systems, np.full((20, 1), 0.5)
    found = _figures_of_merit(
        *(posterior, truth, drawn, truth, Typical(None, "none"), inside, np.zeros(20), where, np.arange(systems))
    )
    for cover in (found["parameters"]["a"].coverage["0.9"], found["coverage_mean"]["0.9"]):
        assert cover.share == 1
        assert (cover.low, cover.high) == (None, None) if not known else 0.7 < cover.low < 0.9 and cover.high == 1
        assert _share(cover).endswith(", 100.0]" if known else "[-]")
