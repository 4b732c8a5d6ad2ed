"""Intervals of the share that is gone, over days that can be drawn alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.fitting.grams import Grams
from diagnosis.fitting.lines import linearised
from diagnosis.fitting.refit import refit, settled
from diagnosis.gap import shrinkage
from diagnosis.gap.evidence import Made
from diagnosis.gap.page import render
from diagnosis.gap.sentences import summary
from diagnosis.gap.shrinkage import _bootstrap, fitted_apart, shrinkages
from diagnosis.recording import HOUR

pytestmark = pytest.mark.slow


def both(done, apart):
    """Lines of the fits to a part, with the stage that each is of and standard deviations of its unknowns."""
    search = done.search
    sds = search.base.sd, search.settled[-1].sd
    return tuple(zip(apart.lines, (search.stages[0], search.last), sds, strict=True))


def test_fits_to_a_part_are_where_that_part_has_its_optimum(drifted):
    """Not where all readings together have theirs, which for these is some standard deviations away."""
    drifted = drifted.done
    for one, stage, sd in both(drifted, drifted.apart):
        assert np.abs((one.z - stage.lin.z) / sd).max() > 1.0
        assert any(np.array_equal(one.z, used.z) for used in (drifted.apart.before, drifted.apart.after))
        away = linearised(one.problem, one.z + 0.7 * sd, one.around)
        again = settled(away, drifted.apart.fitted, stage.colours.best)
        np.testing.assert_allclose((again.lin.z - one.z) / sd, 0.0, atol=0.2)


def test_the_other_part_has_no_say_in_the_fit(drifted, monkeypatch):
    """Readings that are kept are spoilt altogether; the fits to the others do not change, but the share does."""
    drifted = drifted.done
    search, every = drifted.search, drifted.whole.observed
    fitted = every & ~drifted.scored
    assert not np.array_equal(fitted, every)

    def share(one):
        return shrinkages(one, search.stages[0], search.last.colours, drifted.scored, every)[0].share

    before = fitted_apart(search, fitted)
    assert share(before) == drifted.report.shrinkage[0].share > 0.8
    after = fitted_apart(spoilt(drifted, 50.0, monkeypatch), fitted)
    np.testing.assert_allclose(after.before.z, before.before.z, atol=1e-6)
    np.testing.assert_allclose(after.after.z, before.after.z, atol=1e-6)
    assert abs(share(after)) < 0.1


def spoilt(done, by, monkeypatch):
    """The search with other readings [K] on the part that is kept, at the unknowns where it was."""
    change, stages = np.where(done.scored, by, 0.0), []
    for stage in (done.search.stages[0], done.search.last):
        monkeypatch.setattr(stage.lin.problem, "measured", done.whole.measured + change)
        stages.append(replace(stage, lin=replace(stage.lin, residual=stage.lin.residual + change)))
    return replace(done.search, stages=stages, made=Made())


def test_the_other_part_has_no_say_by_where_the_fit_begins(drifted, monkeypatch):
    """The fit to all readings, from which it begins, is made with the other readings too, and goes elsewhere."""
    drifted = drifted.done
    fitted = drifted.whole.observed & ~drifted.scored
    other, stages = spoilt(drifted, 1.0, monkeypatch), []
    for stage, (_, was, sd) in zip(other.stages, both(drifted, drifted.apart), strict=True):
        lin = refit(Grams(stage.lin, drifted.whole.observed), stage.colours.best, stage.lin.z, ()).lin
        assert np.abs((lin.z - was.lin.z) / sd).max() > 2.0
        stages.append(replace(stage, lin=lin))
    after = fitted_apart(replace(other, stages=stages), fitted)
    for one, (now, _, sd) in zip(after.lines, both(drifted, drifted.apart), strict=True):
        np.testing.assert_allclose((one.z - now.z) / sd, 0.0, atol=0.5)


def test_few_scored_readings_are_told_and_give_no_share(drifted):
    drifted = drifted.done
    made, observed = (drifted.apart, drifted.search.stages[0], drifted.search.last.colours), drifted.whole.observed
    scored = drifted.scored & (np.cumsum(drifted.scored) <= 6)
    (room,) = shrinkages(*made, scored, observed)
    assert room.readings == np.sum(observed[0] & scored) <= 6
    assert room.share is None and room.placebo is None
    report = drifted.report.model_copy(update={"shrinkage": [room]})
    page = render(replace(drifted, report=report.model_copy(update={"summary": summary(report)})))
    assert "too few readings" in page and "fewer than 12 readings of any channel" in page
    page = render(replace(drifted, report=report.model_copy(update={"shrinkage": []})))
    assert "Nothing was added" not in page and "it is unknown how far" in page


def test_whether_the_fitted_readings_alone_make_the_same_choice_is_told(drifted):
    drifted = drifted.done
    fitted = drifted.whole.observed & ~drifted.scored
    assert drifted.report.chosen_apart
    (refits,) = drifted.search.refits
    ((_, rivals),) = drifted.search.made.rivals.values()
    other = replace(drifted.search, refits=[[rivals.refits[-1], refits[0]]])  # as if the worst had been the best
    assert rivals.refits[-1].names != refits[0].names
    assert not fitted_apart(other, fitted).agreed


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
    scored = np.arange(96) >= 48
    observed = np.array([np.ones(96), ~scored, np.zeros(96)], dtype=bool)  # the second missing there, the third always
    monkeypatch.setattr(shrinkage, "left_by", lambda one, *_: np.full((3, 96), one.size))
    monkeypatch.setattr(shrinkage, "_floor", lambda *_: (np.full(3, 0.01), np.full(3, 0.001)))
    monkeypatch.setattr(shrinkage, "_placebos", lambda *_: [])
    outputs = [SimpleNamespace(name=name, unit="K", long_name="") for name in ("room", "air", "slab")]
    problem = SimpleNamespace(system=SimpleNamespace(outputs=outputs), recording=SimpleNamespace(step=HOUR))
    before, after = SimpleNamespace(size=np.sqrt(2.0), problem=problem), SimpleNamespace(size=1.0)
    made = (SimpleNamespace(before=before, after=after), None, None)
    room, air = shrinkages(*made, scored, observed)
    assert (room.channel, room.readings) == ("room", 48) and room.share == pytest.approx(1.0 / 1.99)
    assert (air.channel, air.readings) == ("air", 0)
    assert {air.before, air.after, air.floor, air.share, air.low, air.high} == {None}
    assert shrinkages(*made, ~observed.any(axis=0), observed) == []
