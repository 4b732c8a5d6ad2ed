"""The stretch that reads off the most, against dense algebra and against its own null."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.fitting.grams import Colours, Grams
from diagnosis.gap import stages
from diagnosis.gap.places import stretch
from diagnosis.gap.scan import Episode, largest_episode
from diagnosis.gap.twins import draw_twins
from tests.diagnosis.fitting.test_lines import HOUR, STEPS, dense, drawn, problem_of, seen, stacked

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
    block = np.zeros(lin.residual.shape)
    block[1, 16:24] = 1.0
    r, covariance = dense(lin, observed, COLOURS, lin.by_nuisance, lin.by_unknown)
    e, weight = stacked(observed, block), np.linalg.inv(covariance)
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


def test_one_reading_beside_lost_ones_is_no_episode_either():
    rng = np.random.default_rng(18)
    lin = problem_of(rng)
    lin.residual = drawn(rng, lin, COLOURS)
    lin.residual[1, 30] += 40.0
    every = np.ones(lin.residual.shape, dtype=bool)
    for lost in ([], [31], [29], [31, 32], [28, 29, 31, 32, 33]):
        seen = every.copy()
        seen[1, lost] = False
        assert found_in(lin, seen).gain < 5, lost
    lin.residual[1, 31:36] += 40.0
    assert found_in(lin, every).gain > 20


def test_how_a_recording_begins_is_no_episode():
    rng = np.random.default_rng(17)
    lin = problem_of(rng)
    every = np.ones(lin.residual.shape, dtype=bool)
    noise = drawn(rng, lin, COLOURS)
    gains = []
    for first in (0, 2, 8):
        lin.residual = noise.copy()
        lin.residual[1, first : first + 3] += 20.0
        one = found_in(lin, every)
        assert one.first >= 6
        gains.append(one.gain)
    assert gains[0] < 5 and gains[1] < 5 < 20 < gains[2]


@pytest.mark.parametrize("why", ["no stretch is as short", "parameters imitate all of them"])
def test_nothing_to_see_is_none(why):
    rng = np.random.default_rng(15)
    lin = problem_of(rng)
    lin.residual = rng.standard_normal(lin.residual.shape)
    if why == "no stretch is as short":
        lin.problem.time = np.arange(1.0, STEPS + 1)  # a minute in all
    else:
        lin.by_nuisance = np.zeros((2, STEPS, 2 * STEPS))
        lin.by_nuisance[0, :, :STEPS] = lin.by_nuisance[1, :, STEPS:] = 1000.0 * np.eye(STEPS)
    assert found_in(lin, np.ones(lin.residual.shape, dtype=bool)) is None


def stage_of(episode, replay=False, slow=0.0):
    output = SimpleNamespace(name="TRoo", long_name="room temperature", unit="K")
    problem = SimpleNamespace(
        replay=replay,
        system=SimpleNamespace(outputs=[output]),
        time=HOUR * np.arange(1, 49),
        recording=SimpleNamespace(step=HOUR),
    )
    return stages.Stage(SimpleNamespace(problem=problem), None, None, None, None, slow, {}, episode)


def test_an_episode_is_a_finding_from_its_begin_to_its_end():
    (one,) = stretch(stage_of(Episode(0, 0, 5, -0.7, 20.0, 0.0025, 9.0)))
    assert one.text == "room temperature: measured lower by 0.7 K, from day 0.00 to day 0.25 (p = 0.005)"
    assert (one.cell["first_s"], one.cell["last_s"]) == ("0", f"{6 * HOUR:.0f}")
    assert stretch(stage_of(Episode(0, 0, 5, -0.7, 20.0, 0.0025, 4.0))) == stretch(stage_of(None)) == []
    (last,) = stretch(stage_of(Episode(0, 40, 47, 0.7, 20.0, 0.0025, 9.0)))
    assert "measured higher by 0.7 K, from day 1.67 on" in last.text
