"""Effects fitted to a part: the other part is not in the fit, and whether it made the choice is told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import apart
from diagnosis.gap.apart import fitted_apart
from diagnosis.gap.grams import Grams
from diagnosis.gap.page import render
from diagnosis.gap.refit import at_rest, refit
from diagnosis.gap.schema import ShrinkageOf
from diagnosis.gap.searched import Made
from diagnosis.gap.sentences import summary
from diagnosis.gap.shrinkage import _placebos, left_by, shrinkages
from shared.errors import SimulationError

pytestmark = pytest.mark.slow


def both(done, apart):
    """Lines of the fits to a part, with the stage that each is of and standard deviations of its unknowns."""
    search = done.search
    sds = search.base.sd, search.settled[-1].sd
    return tuple(zip(apart.lines, (search.stages[0], search.last), sds, strict=True))


def test_fits_to_all_readings_are_those_of_the_search_brought_to_rest(drifted, monkeypatch):
    drifted = drifted.done
    monkeypatch.setattr(drifted.search, "made", Made())  # there are the fits to a part, which the diagnosis made
    found = fitted_apart(drifted.search, drifted.whole.observed)
    assert found.agreed
    for one, stage, sd in both(drifted, found):
        colours = stage.colours.best
        there = at_rest(refit(stage.grams, colours, stage.lin.z, ()), colours)
        np.testing.assert_allclose((one.z - there.lin.z) / sd, 0.0, atol=0.5)  # on a line that was drawn elsewhere


def test_fits_to_a_part_are_where_that_part_has_its_optimum(drifted):
    """Not where all readings together have theirs, which for these is some standard deviations away."""
    drifted = drifted.done
    for one, stage, sd in both(drifted, drifted.apart):
        colours, grams = stage.colours.best, Grams(one, drifted.apart.fitted)
        assert np.abs((one.z - stage.lin.z) / sd).max() > 1.0
        assert any(np.array_equal(one.z, used.z) for used in (drifted.apart.before, drifted.apart.after))
        np.testing.assert_allclose((refit(grams, colours, one.z, ()).lin.z - one.z) / sd, 0.0, atol=0.05)
        away = at_rest(refit(grams, colours, one.z + 0.7 * sd, ()), colours)
        np.testing.assert_allclose((away.lin.z - one.z) / sd, 0.0, atol=0.1)  # from 0.7 away


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
        np.testing.assert_allclose((one.z - now.z) / sd, 0.0, atol=0.1)


def test_placebos_of_no_size_leave_what_the_base_model_does(drifted):
    """They are fitted as it was: else what the fit alone gains would count as theirs."""
    drifted = drifted.done
    first, colours, every = drifted.search.stages[0], drifted.search.last.colours, drifted.whole.observed
    none = replace(first, lin=replace(first.lin, by_effect=0.0 * first.lin.by_effect))
    made = _placebos(drifted.apart, none, colours, every, np.random.default_rng(1))
    left = left_by(drifted.apart.before, colours, every)
    for one in made:
        np.testing.assert_allclose(one[every], left[every], atol=0.02 * np.std(left[every]))


def test_few_scored_readings_are_told_and_give_no_share(drifted):
    drifted = drifted.done
    scored = drifted.scored & (np.cumsum(drifted.scored) <= 6)
    (room,) = shrinkages(
        drifted.apart, drifted.search.stages[0], drifted.search.last.colours, scored, drifted.whole.observed
    )
    assert room.readings == np.sum(drifted.whole.observed[0] & scored) <= 6
    assert room.share is None and room.placebo is None
    report = drifted.report.model_copy(update={"shrinkage": [ShrinkageOf(**vars(room))]})
    page = render(replace(drifted, report=report.model_copy(update={"summary": summary(report)})))
    assert "too few readings" in page and "fewer than 12 readings of any channel" in page
    page = render(replace(drifted, report=report.model_copy(update={"shrinkage": []})))
    assert "Nothing was added" not in page and "it is unknown how far" in page


def test_whether_the_fitted_readings_alone_make_the_same_choice_is_told(drifted):
    drifted = drifted.done
    fitted = drifted.whole.observed & ~drifted.scored
    assert drifted.report.chosen_apart
    (refits,) = drifted.search.refits
    assert len(refits) > 1
    other = replace(drifted.search, refits=[refits[::-1]])
    assert not fitted_apart(other, fitted).agreed


@pytest.mark.parametrize(
    ("misfits", "used", "made"),
    [
        ([300.0, 299.9], 1, 2),  # where persons were counted the first line is as good as the next
        ([1e5, 2e3, 900.0, 899.9, 1.0], 3, 4),  # the first step overshoots, as of a tank that many persons empty
        ([300.0, 400.0], 0, 2),  # a line that fits worse is not taken
        ([], None, 1),
    ],
)
def test_the_line_of_the_days_kept_is_drawn_until_it_fits_no_better(monkeypatch, misfits, used, made):
    """The gap before an effect had been that of an overshoot, and all of it counted as removed."""
    lines = [SimpleNamespace(misfit=one) for one in misfits]
    left, begun = iter(lines), SimpleNamespace(z=np.zeros(3))
    calls = []

    def draw(grams, *_):
        calls.append(grams)
        if (line := next(left, None)) is None:
            raise SimulationError("cannot be run")
        return line

    monkeypatch.setattr(apart, "Grams", lambda lin, _: lin)
    monkeypatch.setattr(apart, "relinearised", draw)
    monkeypatch.setattr(apart, "misfit", lambda lin, _: lin.misfit)
    lin = apart._lined(SimpleNamespace(lin=begun), {}, np.ones((1, 4), dtype=bool))
    assert lin is (begun if used is None else lines[used])
    assert len(calls) == made
    assert calls[0] is begun and all(calls[k + 1] is lines[k] for k in range(len(calls) - 1))
