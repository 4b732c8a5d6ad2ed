"""Intervals of the share that is gone, over days that can be drawn alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import shrinkage
from diagnosis.gap.shrinkage import _bootstrap, shrinkages
from diagnosis.recording import HOUR


def test_days_without_a_gap_that_are_drawn_alone_do_not_blow_the_interval_up():
    gap = np.repeat([1.0, 0.0, 0.0, 0.0], 24)  # a fifth of the draws has nothing of the first day
    old, new = 1.2 + 8.0 * gap, 1.3 + 0.7 * gap  # noise alone leaves 1.2
    shares = _bootstrap(old, new, np.ones(96, dtype=bool), (1.2, 0.5), HOUR, np.random.default_rng(4))
    # what the other days lost, 0.1, is held against the least gap, 0.5; of the first day's gap nine tenths are gone
    np.testing.assert_allclose([shares.min(), shares.max()], [-0.2, 0.9], atol=0.05)


@pytest.mark.parametrize("hours", [18, 48])
def test_few_scored_hours_have_an_interval_with_a_width(hours):
    """A block of all there is would be drawn every time."""
    rng = np.random.default_rng(2)
    old, new = 5.0 + rng.random(hours), 1.0 + 2.0 * rng.random(hours)
    shares = _bootstrap(old, new, np.ones(hours, dtype=bool), (1.0, 0.5), HOUR, np.random.default_rng(1))
    low, high = np.quantile(shares, [0.05, 0.95])
    share = (old - new).mean() / (old.mean() - 1.0)
    assert low < share - 0.01 and high > share + 0.01
    # hours that are independent, in as many draws: what the mean of so many is known to
    spread = ((old - new) / (old.mean() - 1.0)).std() / np.sqrt(hours)
    assert 0.4 * spread < shares.std() < 1.6 * spread


def test_a_channel_without_readings_on_the_scored_part_is_told(monkeypatch):
    """It may be the one that carries the gap: what it would show is not known."""
    steps = 96
    scored = np.arange(steps) >= 48
    observed = np.ones((3, steps), dtype=bool)
    observed[1] = ~scored  # missing on the days that are kept
    observed[2] = False  # never measured
    monkeypatch.setattr(shrinkage, "left_by", lambda size, *_: np.full((3, steps), size))
    monkeypatch.setattr(shrinkage, "_floor", lambda *_: (np.full(3, 0.01), np.full(3, 0.001)))
    monkeypatch.setattr(shrinkage, "_placebos", lambda *_: [])
    size = float(np.sqrt(2.0))
    before = FakeFit(size)
    before.problem = SimpleNamespace(
        system=SimpleNamespace(outputs=[SimpleNamespace(name=name, unit="K") for name in ("room", "air", "slab")]),
        recording=SimpleNamespace(step=HOUR),
    )
    apart = SimpleNamespace(before=before, after=FakeFit(1.0))
    room, air = shrinkages(apart, None, None, scored, observed)
    assert (room.channel, room.readings) == ("room", 48) and room.share == pytest.approx(1.0 / 1.99)
    assert (air.channel, air.readings) == ("air", 0)
    assert {air.before, air.after, air.floor, air.share, air.low, air.high} == {None}
    assert shrinkages(apart, None, None, ~observed.any(axis=0), observed) == []


class FakeFit(float):
    """A residual of one size."""
