"""The nuisance: integrated out as dense algebra would, added where it belongs, as likely as the sampler says."""

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from diagnosis.fitting.linear import Marginal
from diagnosis.fitting.nuisance import Level, Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.recording import read_recording

HOUR = 3600.0


def test_marginal_is_dense_algebra():
    rng = np.random.default_rng(0)
    by, residual = rng.standard_normal((30, 8)), rng.standard_normal(30)
    by[:, 7] = by[:, 6]  # what cannot be told apart
    covariance = np.eye(30) + by @ by.T
    marginal = Marginal(by)
    root = marginal.root(np.eye(30))
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(covariance), atol=1e-10)
    np.testing.assert_allclose(marginal.root(residual), root @ residual, atol=1e-10)
    assert marginal.logdet == pytest.approx(np.linalg.slogdet(covariance)[1])
    posterior = np.linalg.inv(np.eye(8) + by.T @ by)
    np.testing.assert_allclose(marginal.unknowns(residual), posterior @ by.T @ residual, atol=1e-9)


def test_pulses_are_added_where_they_belong():
    table = merge({"u": Piecewise(np.array([0.0, 10.0]), np.array([0.0, 10.0])), "n": Piecewise.constant(1.0)}, 0, 10)
    nuisance = Nuisance(
        column=np.array([1, 1]),
        begin=np.array([2.0, 6.0]),
        end=np.array([4.0, 8.0]),
        turns=np.array([False, True]),
        recorded=np.array([True, True]),
        mean=np.zeros(2),
        factor=np.eye(2),
    )
    made = nuisance.added(table.refined(nuisance.edges), np.array([3.0, 0.5]))
    at = np.array([1.0, 3.0, 5.0, 6.5, 7.5, 9.0])
    np.testing.assert_allclose(made.at(at), np.column_stack([at, [1.0, 4.0, 1.0, 1.5, 0.5, 1.0]]))
    np.testing.assert_array_equal(made.time[made.jump], [2.0, 4.0, 6.0, 7.0, 8.0])


def test_nobody_is_fewer_than_none_but_a_meter_errs_either_way():
    """Persons on input 0, a meter's error on input 1; and what turns within a step, or was before, is no count."""
    pulses = Nuisance(
        column=np.array([0, 1, 0, 0]),
        begin=np.array([0.0, 0.0, 0.0, -5.0]),
        end=np.array([4.0, 4.0, 4.0, 0.0]),
        turns=np.array([False, False, True, False]),
        recorded=np.array([True, True, True, False]),
        mean=np.array([1.0, 0.0, 0.0, 0.0]),
        factor=np.eye(4),
        levels=(Level(0, 5.0, 25.0),),
    )
    np.testing.assert_array_equal(pulses.guessed, [True, False, False, False])
    np.testing.assert_array_equal(pulses.heights(np.full(4, -3.0)), [0.0, -3.0, -3.0, -3.0])


@pytest.mark.parametrize("hours", [48, 168])
def test_shares_times_headcounts_are_the_persons_of_the_sampler(house, house_recording, hours):
    """Mean and spread of each half hour, and spread of the recording's mean, whatever the recording's length."""
    from datagen.driving.occupancy import occupancy_prior

    system = house("me")
    record = read_recording(house_recording(hours=hours, count=False), system)
    nuisance = Problem(Simulator(system), record, occupancy="unknown", known=["history"]).nuisance
    nuisance = nuisance.only(~nuisance.turns)  # persons, not when the heater was on within its hours
    rng, level = np.random.default_rng(0), nuisance.levels[0]
    heights = nuisance.mean + rng.standard_normal((4000, nuisance.factor.shape[1])) @ nuisance.factor.T
    persons = heights * rng.uniform(level.low, level.high, 4000)[:, None]
    draws = occupancy_prior(system.occupancy, np.arange(0, hours * HOUR + 1, 1800), 4000, 5)
    wanted = draws[:, np.round(nuisance.begin / 1800).astype(int)]
    np.testing.assert_allclose(persons.mean(axis=0), wanted.mean(axis=0), atol=0.3)
    busy = wanted.std(axis=0) > 1.0
    ratio = persons.std(axis=0)[busy] / wanted.std(axis=0)[busy]
    assert busy.sum() > 20
    assert 0.88 < ratio.min() <= ratio.max() < 1.12
    assert persons.mean(axis=1).std() == pytest.approx(wanted.mean(axis=1).std(), rel=0.06)
