"""The log determinant's parabola against determinants of lines that are drawn at other unknowns."""

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.determinant import determinant
from diagnosis.fitting.grams import Grams
from diagnosis.fitting.lines import linearised
from diagnosis.fitting.problem import Problem
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.conftest import TRUTH, WARM_UP


@pytest.fixture
def problem(house, house_recording):
    """A house whose persons nobody counted; only persons and history are unknown, not when within a step they came."""
    record = read_recording(house_recording(hours=48, count=False), house("me"))
    made = Problem(
        Simulator(house("me")), record, known=["history"], warm_up=WARM_UP * HOUR, occupancy="unknown", noise="sensor"
    )
    return made.with_nuisance(made.nuisance.only(~made.nuisance.turns))


def white(problem):
    return {k: (float(sd), 0.0, HOUR) for k, sd in enumerate(problem.floor)}


def drawn(problem, z):
    return Grams(linearised(problem, z, problem.linearise(z)), problem.observed)


def half_logdet(problem, z):
    """Of the covariance of all readings at some unknowns, written out."""
    lin = drawn(problem, z).lin
    rows = problem.standardised(problem.nuisance.by_unknown(lin.around.response))
    return 0.5 * np.linalg.slogdet(np.eye(len(rows)) + rows @ rows.T)[1]


def test_the_slope_is_the_difference_of_determinants(problem):
    z = problem.unknowns(TRUTH)
    found = determinant(drawn(problem, z), white(problem))
    assert np.abs(found.slope).max() > 5
    for k, name in enumerate(problem.names):
        width = 0.1 * np.eye(problem.size)[k]
        expected = (half_logdet(problem, z + width) - half_logdet(problem, z - width)) / 0.2
        assert found.slope[k] == pytest.approx(expected, rel=0.15, abs=0.3), name


def test_the_level_of_the_persons_multiplies_every_answer(problem):
    """Its derivative is known: dB/dz = sd B, and so are all products."""
    z = problem.unknowns(TRUTH)
    grams = drawn(problem, z)
    found = determinant(grams, white(problem))
    by = problem.standardised(problem.nuisance.by_unknown(grams.lin.around.response))
    product = problem.nuisance.levels[0].sd * by.T @ np.linalg.solve(np.eye(len(by)) + by @ by.T, by)
    assert found.slope[-1] == pytest.approx(np.trace(product), rel=0.15)
    assert found.curvature[-1, -1] == pytest.approx(np.sum(product**2), rel=0.3)


def test_products_hold_the_parabola_beside_the_rows(problem):
    """What a step promises and what the misfit makes smallest are of one function."""
    z = problem.unknowns(TRUTH)
    grams = drawn(problem, z)
    bent = determinant(grams, white(problem))
    plain, with_it = (one.total(white(problem)) for one in (grams, Grams(grams.lin, problem.observed, grams, bent)))
    way = 0.3 * np.random.default_rng(1).standard_normal(problem.size)
    for there in (z, z + way):
        x = np.concatenate([np.zeros(grams.n_nuisance), there])
        gained = [0.5 * (one.square + x @ one.gram @ x) - one.score @ x for one in (plain, with_it)]
        assert gained[1] - gained[0] == pytest.approx(bent.value(there), abs=1e-6)
