"""Draws of persons whom nobody counted: the description's where nothing tells, the posterior's where readings do."""

import numpy as np
import pytest

from datagen.driving.occupancy import occupancy_prior
from diagnosis.fitting.linear import Marginal
from diagnosis.fitting.problem import Problem
from diagnosis.forecasting.forecast import corrected, from_the_prior
from tests.diagnosis.fitting.crowd_cases import warm_room

DRAWS = 600


@pytest.fixture(scope="module")
def unread(tmp_path_factory):
    """Four days of the default room, and persons (draws, half hours) from before any reading."""
    simulator, recording = warm_room(tmp_path_factory.mktemp("warm") / "room.nc")
    problem = Problem(simulator, recording, occupancy="unknown", uncertain=False, warm_up=86400.0)
    found = from_the_prior(problem, DRAWS, np.random.default_rng(3))
    nuisance = problem.nuisance
    return problem, found, np.array([nuisance.heights(one) for one in found])[:, nuisance.guessed]


def test_hours_that_no_reading_tells_of_have_the_persons_of_the_description(unread):
    """By the sampler itself, other draws of it: how many, how often none, and the ends of the 90 % interval."""
    problem, _, persons = unread
    nuisance = problem.nuisance
    begin, end = (one[nuisance.guessed] for one in (nuisance.begin, nuisance.end))
    edges = np.unique(np.concatenate([begin, end]))
    expected = occupancy_prior(problem.system.occupancy, edges, 3000, seed=77)
    whole = expected @ np.diff(edges) / (edges[-1] - edges[0])
    expected = (expected / whole[:, None] * whole.mean())[:, np.searchsorted(edges, begin)]
    level = expected.mean() / persons.mean()
    assert level == pytest.approx(1.0, abs=0.06)
    np.testing.assert_allclose((persons < 0.05).mean(axis=0), (expected < 0.05).mean(axis=0), atol=0.08)
    for share in (0.05, 0.5, 0.95):
        ends = (np.quantile(one, share, axis=0) for one in (persons, expected))
        np.testing.assert_allclose(*ends, atol=0.2 * expected.max(axis=0).mean())


def test_draws_given_readings_are_those_of_the_posterior():
    """Where the prior is normal: dense algebra."""
    rng = np.random.default_rng(0)
    by, residual = rng.standard_normal((30, 8)), rng.standard_normal(30)
    marginal = Marginal(by)
    posterior = np.linalg.inv(np.eye(8) + by.T @ by)
    mean = posterior @ by.T @ residual
    draws = np.array(
        [corrected(rng.standard_normal(8), marginal.unknowns(residual), marginal, rng) for _ in range(20_000)]
    )
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.02)
    np.testing.assert_allclose(np.cov(draws, rowvar=False), posterior, atol=0.02)
