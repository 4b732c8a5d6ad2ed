"""How persons came and went within an hour, against other draws of the same occupancy and against what must be so."""

import numpy as np
import pytest

from datagen.driving.occupancy import occupancy_prior
from datagen.driving.tables import Piecewise
from diagnosis.fitting.inputs import HAAR, counted, replayed
from diagnosis.recording import DAY, HOUR, Recording

DAYS = 7


def recording(tmp_path, hours: int, step: float = HOUR) -> Recording:
    time = step * np.arange(1, hours + 1)
    return Recording(tmp_path / "one.nc", step, time, np.zeros((1, hours)), {})


def covariances(nuisance, hours: int) -> np.ndarray:
    """Prior covariance of the deviations of quarters, shape (hours, 4, 4), from the pulses' own definition."""
    deviations = np.zeros((4 * hours, nuisance.size))
    middle = HOUR / 4 * (np.arange(4 * hours) + 0.5)
    for k in range(nuisance.size):
        turn = 0.5 * (nuisance.begin[k] + nuisance.end[k])
        deviations[(middle > nuisance.begin[k]) & (middle < turn), k] = 1.0
        deviations[(middle > turn) & (middle < nuisance.end[k]), k] = -1.0
    root = (deviations @ nuisance.factor).reshape(hours, 4, -1)
    return np.einsum("hik,hjk->hij", root, root)


@pytest.fixture(scope="module")
def rooms(default_system, tmp_path_factory):
    """True deviations of quarters, what is expected of them, and its covariance, over rooms of another seed."""
    edges = 3 * DAY + HOUR / 4 * np.arange(4 * 24 * DAYS + 1)
    quarters = occupancy_prior(default_system.occupancy, edges, 60, seed=5).reshape(60, -1, 4)
    record = recording(tmp_path_factory.mktemp("within"), 24 * DAYS)
    true, mean, spread = [], [], []
    for room in quarters:
        hourly = room.mean(axis=1)
        signal = Piecewise(record.time - HOUR, hourly, "previous")
        nuisance, shown = counted(default_system.occupancy, 0, record, signal)
        found = shown.at((HOUR / 4) * (np.arange(4 * 24 * DAYS) + 0.5)).reshape(-1, 4)
        np.testing.assert_allclose(found.mean(axis=1), hourly, atol=1e-9)
        true.append(room - hourly[:, None])
        mean.append(found - hourly[:, None])
        spread.append(covariances(nuisance, 24 * DAYS))
    return np.stack(true), np.stack(mean), np.stack(spread)


def test_what_is_expected_is_nearer_than_the_mean_and_not_biased(rooms):
    true, mean, _ = rooms
    left = np.sum((true - mean) ** 2, axis=-1)
    assert left.mean() < 0.4 * np.sum(true**2, axis=-1).mean()
    # as much of the second half over the first as there is, up or down: no part of the expected rise is left over
    rise, expected = (one[..., 2:].sum(axis=-1) - one[..., :2].sum(axis=-1) for one in (true, mean))
    slope = np.sum((rise - expected) * expected) / np.sum(expected**2)
    assert abs(slope) < 0.05


def test_the_covariance_is_as_large_as_the_errors_are(rooms):
    """And somewhat larger: what happens rarely is given more room than a Gaussian of the usual would have."""
    true, mean, spread = rooms
    errors = np.sum((true - mean) ** 2, axis=-1)
    believed = np.trace(spread, axis1=-2, axis2=-1)
    assert 0.6 < errors.mean() / believed.mean() < 1.0
    # also in the quarter of the steps that is believed to be most uncertain
    most = believed > np.quantile(believed[believed > 0], 0.75)
    assert 0.6 < errors[most].mean() / believed[most].mean() < 1.1
    # and in units of the covariance: three degrees of freedom
    some = believed > 0.05
    left = (true - mean)[some] @ HAAR.T
    covariance = HAAR @ spread[some] @ HAAR.T + 1e-4 * np.eye(3)
    distance = np.einsum("ni,nij,nj->n", left, np.linalg.inv(covariance), left)
    assert distance.mean() < 1.5 * 3
    assert np.mean(distance > 16.3) < 0.03


def test_a_single_change_is_found_where_it_was(default_system, tmp_path):
    """Twelve persons from 8:20 to 16:50 on one of two days: the means over hours tell when they came and went."""
    minutes = np.zeros(48 * 60)
    minutes[8 * 60 + 20 : 16 * 60 + 50] = 12.0
    record = recording(tmp_path, 48)
    means = Piecewise(record.time - HOUR, minutes.reshape(48, 60).mean(axis=1), "previous")
    nuisance, shown = counted(default_system.occupancy, 0, record, means)
    found = shown.at(HOUR / 4 * (np.arange(4 * 48) + 0.5))
    # held at the mean of their hour, quarters would be wrong by up to eight persons
    assert np.abs(found - minutes.reshape(-1, 15).mean(axis=1)).max() < 0.2 * 12.0
    assert (nuisance.begin >= 4 * HOUR).all()
    assert (nuisance.end <= 20 * HOUR).all()


def test_short_steps_and_an_empty_room_have_nothing_within(default_system, tmp_path):
    record = recording(tmp_path, 24, 300.0)
    signal = Piecewise(record.time - 300.0, np.arange(24.0), "previous")
    nuisance, shown = counted(default_system.occupancy, 0, record, signal)
    assert nuisance.size == 0
    assert shown is signal
    record = recording(tmp_path, 24)
    nuisance, shown = counted(default_system.occupancy, 0, record, Piecewise.constant(0.0))
    assert nuisance.size == 0
    assert not shown.at(record.time - 1.0).any()
    assert replayed(0, record, Piecewise.constant(3.0)).size == 0


def test_a_replayed_actuator_that_jumps_once_varies_as_a_uniform_time_says(tmp_path):
    """From 1 to 2 at a uniform time of one step: nobody knows when, and quarters spread by sqrt(1/2) of the halves."""
    record = recording(tmp_path, 6)
    values = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    nuisance = replayed(0, record, Piecewise(record.time - HOUR, values, "previous"))
    spread = covariances(nuisance, 6)
    assert (np.trace(spread, axis1=1, axis2=2) > 0).tolist() == [False, False, True, True, False, False]
    np.testing.assert_allclose(HAAR @ spread[2] @ HAAR.T, 0.25 * np.diag([1.0, 0.5, 0.5]), atol=1e-12)


@pytest.mark.parametrize(("lowest", "last"), [(0.0, 0.2), (-1.0, 0.0)])
def test_an_actuator_that_never_ran_backwards_did_not_within_a_step_either(tmp_path, lowest, last):
    """Beside steps of 5 it gave ``last`` above the least that it ever gives: no half of that step differs by more."""
    record = recording(tmp_path, 6)
    values = np.array([5.0, 5.0, lowest + last, 5.0, 5.0, lowest])
    nuisance = replayed(0, record, Piecewise(record.time - HOUR, values, "previous"))
    halves = np.sqrt((HAAR @ covariances(nuisance, 6) @ HAAR.T)[:, 0, 0])
    assert halves[2] == pytest.approx(last, abs=1e-9)
    assert halves[5] == pytest.approx(0.0, abs=1e-9)
    assert halves[1] == pytest.approx(0.5 * (5.0 - lowest - last))
