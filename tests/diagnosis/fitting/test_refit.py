"""Derivatives that go along with the steps of a refit; its spread and its misfit, written out densely."""

from types import SimpleNamespace

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.grams import AMPLITUDE, Grams, estimated_colours
from diagnosis.fitting.lines import Linearised, linearised
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import misfit, refit, relinearised
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.fitting.test_lines import covariance_of, problem_of
from tests.diagnosis.gap.room_cases import in_the_middle

pytestmark = pytest.mark.slow


def test_persons_of_the_days_kept_from_a_fit_are_told_by_those_days(default_system, tmp_path):
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=120.0)
    record = read_recording(tmp_path / "room.nc", system)
    whole = Problem(Simulator(system), record, occupancy="unknown", known=["constants"])
    scored = kept_for_scoring(record)
    fitted = whole.observed & ~scored
    base = fit(whole.with_observed(fitted))  # from the truth, the middle of the prior
    carbon = system.output_names.index("CO2")
    rows = scored & whole.observed[carbon]
    grams = Grams(linearised(base.problem, base.z, base.around), fitted)

    def left(every):
        there = relinearised(grams, estimated_colours(grams, whole.floor).best, base.z, every)
        return np.sqrt(np.mean((whole.measured - there.outputs)[carbon][rows] ** 2))

    # the usual persons of such a day miss the day that was; told by it, little but the sensor's own error is left
    assert left(whole.observed) < 0.4 * left(fitted)


MIXED = {0: (1.0, 0.5, 5 * HOUR), 1: (0.7, 0.0, HOUR)}


def straight(seed=4):
    """A problem that is linear throughout, with one chosen effect, and its products; all readings observed."""
    toy = problem_of(np.random.default_rng(seed), chosen=1)
    bounds = (np.full(len(toy.z), -9.0), np.full(len(toy.z), 9.0))
    problem = SimpleNamespace(**vars(toy.problem), effects=toy.chosen, bounds=bounds)
    problem.with_effects = lambda effects: problem
    lin = Linearised(
        problem=problem,
        around=None,
        z=toy.z,
        residual=np.random.default_rng(seed + 1).standard_normal(toy.residual.shape),
        outputs=toy.residual,
        by_nuisance=toy.by_nuisance,
        turn=np.eye(toy.by_nuisance.shape[2]),
        by_unknown=toy.by_unknown,
        by_effect=toy.by_effect,
        effects=toy.effects,
        failed={},
    )
    return lin, Grams(lin, np.ones(lin.residual.shape, dtype=bool))


def weight_of(lin):
    """Inverse covariance of all readings, channel after channel, with the nuisance in it."""
    n = len(lin.problem.time)
    noise = np.zeros((2 * n, 2 * n))
    for k, colour in MIXED.items():
        noise[k * n : (k + 1) * n, k * n : (k + 1) * n] = covariance_of(colour, lin.problem.time)
    nuisance = np.concatenate(lin.by_nuisance)
    return np.linalg.inv(noise + nuisance @ nuisance.T)


def test_the_spread_of_the_unknowns_is_that_of_the_dense_posterior():
    """Two parameters with a prior of one, and an amplitude with one of AMPLITUDE [scales]."""
    lin, grams = straight()
    columns = np.concatenate(lin.by_unknown)
    prior = np.diag(1 / np.array([1.0, 1.0, AMPLITUDE]) ** 2)
    expected = np.sqrt(np.diag(np.linalg.inv(prior + columns.T @ weight_of(lin) @ columns)))
    np.testing.assert_allclose(refit(grams, MIXED, lin.z, (), steps=0).sd, expected, rtol=1e-8)


def test_the_misfit_is_half_the_squares_of_residual_and_of_unknowns_in_their_spreads():
    lin, grams = straight()
    left = np.concatenate(lin.residual)
    expected = left @ weight_of(lin) @ left + lin.z[0] ** 2 + lin.z[1] ** 2 + (lin.z[2] / AMPLITUDE) ** 2
    assert abs(lin.z[2]) > 0.1
    assert misfit(grams, MIXED) == pytest.approx(0.5 * expected, rel=1e-9)
