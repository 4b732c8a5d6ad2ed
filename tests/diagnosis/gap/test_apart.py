"""Effects fitted to a part: the other part is not in the fit, and whether it made the choice is told."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.gap.apart import fitted_apart
from diagnosis.gap.shrinkage import shrinkages

pytestmark = pytest.mark.slow


def test_fits_to_all_readings_are_those_of_the_search(drifted, monkeypatch):
    drifted = drifted.done
    monkeypatch.setattr(drifted.search, "made", {})  # there are the fits to a part, which the diagnosis made
    found = fitted_apart(drifted.search, drifted.whole.observed)
    assert found.agreed
    for one, stage in ((found.before, drifted.search.stages[0]), (found.after, drifted.search.last)):
        np.testing.assert_allclose(one.z, stage.lin.z, atol=0.02)


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
    monkeypatch.setattr(search, "made", {})
    spoilt = np.where(drifted.scored, drifted.whole.measured + 50.0, drifted.whole.measured)
    for stage in (search.stages[0], search.last):
        monkeypatch.setattr(stage.lin.problem, "measured", spoilt)
    after = fitted_apart(search, fitted)
    np.testing.assert_allclose(after.before.z, before.before.z, atol=1e-6)
    np.testing.assert_allclose(after.after.z, before.after.z, atol=1e-6)
    assert abs(share(after)) < 0.1


def test_whether_the_fitted_readings_alone_make_the_same_choice_is_told(drifted):
    drifted = drifted.done
    fitted = drifted.whole.observed & ~drifted.scored
    assert drifted.report.chosen_apart
    (refits,) = drifted.search.refits
    assert len(refits) > 1
    other = replace(drifted.search, refits=[refits[::-1]])
    assert not fitted_apart(other, fitted).agreed
