"""Tables by season and by band, of answers whose errors are known."""

import numpy as np
import pytest

from trainer.evaluating.report import Answers
from trainer.evaluating.strata import by_band, by_season, season_of

DAY = 86400.0


def test_seasons_begin_with_their_months():
    """31 + 28 days to 1 March; 1 December is day 334 of a year of 365."""
    days = np.array([0, 58, 59, 150, 151, 242, 243, 333, 334, 364])
    assert season_of(days * DAY).tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 0, 0]
    assert season_of(np.array([365 * DAY, -DAY])).tolist() == [0, 0]


@pytest.fixture
def answers():
    """Forty systems in January, right but for noise, and forty in July, of which nothing is known but the mean."""
    rng = np.random.default_rng(3)
    truth = rng.uniform(1.0, 4.0, (80, 1))
    estimate = np.where(np.arange(80)[:, None] < 40, truth + 0.1 * rng.standard_normal((80, 1)), 2.5)
    begin = np.where(np.arange(80) < 40, 5 * DAY, 190 * DAY)
    return Answers(np.ones(80, dtype=object), np.arange(80), begin, truth, estimate)


def test_a_season_in_which_nothing_is_known_shows(answers):
    header, rows = by_season(answers, ["R"])
    assert header == ("begin", "windows", "R", "mean")
    assert [row[:2] for row in rows] == [("December to February", "40"), ("June to August", "40")]
    winter, summer = (float(row[2].split()[0]) for row in rows)
    truth = answers.truth[:40, 0]
    assert winter == pytest.approx(1 - 0.01 / truth.var(), abs=0.01)
    assert summer <= 0


def test_shrinking_to_the_mean_is_a_bias_of_both_ends(answers):
    """Estimates of 2.5 everywhere: too high by as much in the lowest third as too low in the highest."""
    shrunk = answers._replace(estimate=np.full_like(answers.truth, 2.5))
    _, rows = by_band(shrunk, ["R"], ["m2.K/W"])
    assert [row[2] for row in rows] == ["27", "27", "26"]
    thirds = np.array_split(np.sort(answers.truth[:, 0]), 3)
    for row, third in zip(rows, thirds, strict=True):
        assert row[1] == f"{third[0]:.3g} to {third[-1]:.3g} m2.K/W"
        assert float(row[3]) == pytest.approx(2.5 - third.mean(), rel=0.06, abs=0.006)
        assert float(row[4]) == pytest.approx(np.sqrt(np.mean((third - 2.5) ** 2)), rel=0.06)
