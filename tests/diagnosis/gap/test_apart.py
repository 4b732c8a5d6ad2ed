"""Effects fitted to a part: the other part is not in the fit, and whether it made the choice is told."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.gap.evidence import Made
from diagnosis.gap.grams import Grams
from diagnosis.gap.page import render
from diagnosis.gap.refit import at_rest, refit
from diagnosis.gap.schema import ShrinkageOf
from diagnosis.gap.sentences import summary
from diagnosis.gap.shrinkage import fitted_apart, shrinkages

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
    ((_, rivals),) = drifted.search.made.rivals.values()
    other = replace(drifted.search, refits=[[rivals.refits[-1], refits[0]]])  # as if the worst had been the best
    assert rivals.refits[-1].names != refits[0].names
    assert not fitted_apart(other, fitted).agreed
