"""The stretch that reads off the most, against dense algebra and against its own null."""

import numpy as np
import pytest

from diagnosis.gap.colours import Colours
from diagnosis.gap.episode import largest_episode
from diagnosis.gap.grams import Grams
from diagnosis.gap.twins import draw_twins
from tests.diagnosis.gap.test_linear import HOUR, STEPS, covariance_of, drawn, problem_of, seen

COLOURS = {0: (1.0, 0.5, 5 * HOUR), 1: (2.0, 0.0, HOUR)}
SURE = Colours(COLOURS, {k: [(one, 1.0)] for k, one in COLOURS.items()}, 0.0)


def found_in(lin, observed, twins=199, seed=0):
    grams = Grams(lin, observed)
    return largest_episode(grams, SURE, draw_twins(grams, SURE, twins, seed))


def test_an_offset_is_found_where_it_is_and_its_ratio_is_that_of_generalised_least_squares():
    rng = np.random.default_rng(11)
    lin = problem_of(rng)
    observed = seen(lin)
    lin.residual = drawn(rng, lin, COLOURS)
    lin.residual[1, 16:24] -= 9.0
    one = found_in(lin, observed)
    assert (one.channel, one.first, one.last) == (1, 16, 23)
    assert one.p_value <= 0.01
    assert one.gain > 10
    inner = np.concatenate([lin.by_nuisance, lin.by_unknown], axis=2)
    a = np.concatenate([inner[k, observed[k]] for k in range(2)])
    block = np.zeros(lin.residual.shape)
    block[1, 16:24] = 1.0
    e = np.concatenate([block[k, observed[k]] for k in range(2)])
    r = np.concatenate([(lin.residual + lin.by_unknown @ lin.z)[k, observed[k]] for k in range(2)])
    covariance = a @ a.T
    begin = 0
    for k in range(2):
        count = int(observed[k].sum())
        part = slice(begin, begin + count)
        covariance[part, part] += covariance_of(COLOURS[k], lin.problem.time[observed[k]])
        begin += count
    weight = np.linalg.inv(covariance)
    assert one.offset == pytest.approx(e @ weight @ r / (e @ weight @ e), rel=1e-6)
    assert one.ratio == pytest.approx(0.5 * (e @ weight @ r) ** 2 / (e @ weight @ e), rel=1e-6)


def test_without_an_episode_its_p_is_small_no_oftener_than_it_says_and_nothing_is_gained():
    rng = np.random.default_rng(12)
    p, gain = [], []
    for k in range(60):
        lin = problem_of(rng)
        lin.residual = drawn(rng, lin, COLOURS)
        one = found_in(lin, seen(lin), 99, k)
        p.append(one.p_value)
        gain.append(one.gain)
    assert np.mean(np.array(p) <= 0.1) < 0.25
    assert np.mean(p) == pytest.approx(0.5, abs=0.15)  # a uniform mean has a standard error of 0.037 here
    # a Bayes factor has a mean of 1 without an effect: over 5 in log evidence once in 148 at most (Markov)
    assert max(gain) < 5


def test_what_the_parameters_imitate_is_no_episode():
    rng = np.random.default_rng(13)
    lin = problem_of(rng)
    lin.by_unknown[..., 0] = 0.0
    lin.by_unknown[1, 16:24, 0] = 100.0
    lin.z[:] = 0.0
    lin.residual = drawn(rng, lin, COLOURS)
    lin.residual[1, 16:24] -= 9.0
    assert found_in(lin, seen(lin)).gain < 3


def test_readings_by_the_minute_and_by_the_day_have_stretches_too():
    for step, expected in ((60.0, 60), (24 * HOUR, 1)):
        rng = np.random.default_rng(14)
        lin = problem_of(rng)
        lin.problem.time = step * np.arange(1, STEPS + 1)
        lin.residual = 0.1 * rng.standard_normal(lin.residual.shape)
        lin.residual[0, 20 : 20 + min(expected, 30)] += 20.0
        one = found_in(lin, np.ones(lin.residual.shape, dtype=bool))
        assert one.channel == 0
        assert one.last - one.first + 1 <= expected


def test_nothing_to_see_is_none():
    rng = np.random.default_rng(15)
    lin = problem_of(rng)
    lin.problem.time = np.arange(1.0, STEPS + 1)  # a minute in all: no stretch of an hour
    lin.residual = rng.standard_normal(lin.residual.shape)
    assert found_in(lin, np.ones(lin.residual.shape, dtype=bool)) is None
