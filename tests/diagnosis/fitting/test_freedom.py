"""The slope of the determinant against determinants that are computed anew, and what a slope does to the evidence."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.freedom import corrected, half_logdet, slope_of
from diagnosis.fitting.grams import AMPLITUDE, Grams
from diagnosis.fitting.lines import linearised
from diagnosis.fitting.problem import Problem
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.fitting.test_lines import dense, noisy_problem

WHITE = {0: (0.3, 0.0, HOUR)}


@pytest.fixture
def uncounted(house, house_recording):
    """A house whose persons nobody counted, about the truth, and all that else is known of it."""
    record = read_recording(house_recording(hours=72, count=False), house("me"))
    problem = Problem(Simulator(house("me")), record, occupancy="unknown", known=["history"])
    return problem.with_nuisance(problem.nuisance.only(problem.nuisance.guessed))


def drawn(problem, z):
    return Grams(linearised(problem, z, problem.linearise(z)), problem.observed)


def test_the_slope_is_the_derivative_of_the_determinant(uncounted):
    z = np.full(uncounted.size, 0.2)
    slopes = slope_of(drawn(uncounted, z), WHITE)
    assert list(slopes) == uncounted.names
    steps = 0.1 * np.eye(uncounted.size)
    wanted = [
        (half_logdet(drawn(uncounted, z + one), WHITE) - half_logdet(drawn(uncounted, z - one), WHITE)) / 0.2
        for one in steps
    ]
    # by random signs of some pulses at a time, which is not exact
    assert max(np.abs(wanted)) > 5
    np.testing.assert_allclose([one for one, _ in slopes.values()], wanted, atol=0.2 * max(np.abs(wanted)))
    assert [where for _, where in slopes.values()] == z.tolist()


def test_a_slope_is_corrected_along_the_way_of_a_line(uncounted):
    """After the correction the slope says how much the determinant has changed, wherever it began."""
    z = np.zeros(uncounted.size)
    first, way = drawn(uncounted, z), np.array([0.1, -0.2, 0.3, 0.1, 0.2])
    wrong = Grams(replace(first.lin, slope=dict.fromkeys(uncounted.names, (7.0, 0.0))), first.observed)
    then = corrected(wrong, drawn(uncounted, z + way), WHITE)
    slopes, where = then.lin.slopes
    assert slopes @ way == pytest.approx(half_logdet(then, WHITE) - half_logdet(first, WHITE), abs=1e-6)
    np.testing.assert_array_equal(where, z + way)


def test_nothing_has_a_slope_where_occupants_were_counted(house, house_recording):
    record = read_recording(house_recording(hours=72), house("me"))
    problem = Problem(Simulator(house("me")), record)
    assert slope_of(drawn(problem, np.zeros(problem.size)), WHITE) == {}


def test_a_slope_acts_as_a_prior_with_another_mean():
    """exp(-g (z - w)) N(z; 0, s^2) is N(z; -g s^2, s^2) times a constant."""
    lin, observed = noisy_problem(1, chosen=1)
    colours = {0: (1.0, 0.5, 5 * HOUR), 1: (0.7, 0.0, HOUR)}
    slopes, where, spread = np.array([2.0, -1.0, 0.5]), np.array([0.1, 0.2, 0.3]), np.array([1.0, 1.0, AMPLITUDE])
    lin.slope, lin.slopes = {"one": (2.0, 0.1)}, (slopes, where)
    r, covariance = dense(lin, observed, colours, lin.by_nuisance, lin.by_unknown * spread)
    columns = np.concatenate([lin.by_unknown[k, observed[k]] for k in range(2)])
    expected = multivariate_normal.logpdf(r, columns @ (-slopes * spread**2), covariance)
    expected += 0.5 * np.sum((slopes * spread) ** 2) + slopes @ where
    assert Grams(lin, observed).evidence(colours) == pytest.approx(expected, abs=1e-6)
