"""The p-value of a place among all that was looked at."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.where import locate
from diagnosis.where.episodes import scan_episodes
from tests.diagnosis.where.where_cases import twins, wander, with_observed

STEPS = 336


def test_a_strong_gap_makes_nothing_beside_it_surer():
    """What is found among all places is no surer than among those of its own kind, against twins that have no gap."""
    case = twins(1, outputs=2, steps=STEPS, twins=199, phi=0.7)
    wind = wander(np.random.default_rng(1001), (STEPS,), 0.9)
    observed = case.observed.copy()
    observed[0] += 8 * wind
    observed[0, 100:150] += 8
    found = locate(with_observed(case, observed), inputs={"wind": wind})
    own = [*found.cells.findings, *found.episodes.findings, *found.correlations.findings]
    assert len(found.findings) > 3
    for one in found.findings:
        assert one.p_value >= next(same for same in own if replace(same, p_value=one.p_value) == one).p_value
    # the same, worked out from the twins alone
    tests = [found.cells.test, found.correlations.test, found.episodes.test]
    twin = np.stack([one.maxima[1:] for one in tests], axis=1)
    reach = ((twin - twin.mean(axis=0)) / twin.std(axis=0, ddof=1)).max(axis=1)
    level = (1 + 1e-6) * found.correlations.test.level(0.05)  # the level itself is a twin's, equal but for rounding
    size = (level - twin[:, 1].mean()) / twin[:, 1].std(ddof=1)
    expected = (1 + (reach >= size).sum()) / 200
    assert found._p_of_all("correlations", level) == pytest.approx(expected)


@pytest.mark.parametrize(("share", "stands_out"), [(0.5, False), (1.0, False), (1.5, True)])
def test_only_a_recording_noisier_than_its_twins_stands_out_by_noise(share, stands_out):
    rng = np.random.default_rng(3)
    case = twins(1, outputs=1, steps=STEPS, twins=199, phi=0.0)
    observed = share * rng.standard_normal((1, STEPS))
    found = locate(with_observed(case, observed), inputs={})
    assert (found.p_value <= 0.01) is stands_out
    assert any("more scatter" in one.text for one in found.findings) is stands_out


def test_a_stretch_that_is_quieter_than_the_rest_is_no_episode():
    case = twins(2, outputs=1, steps=STEPS, twins=199, phi=0.0)
    observed = case.observed.copy()
    observed[0, 96:192] *= 0.2
    quiet = scan_episodes(with_observed(case, observed))
    assert quiet.test.p_value > 0.05
    observed[0, 96:192] *= 15.0
    found = scan_episodes(with_observed(case, observed)).findings
    (noisy,) = (one for one in found if one.cell["statistic"] == "variance")
    assert noisy.direction == "more scatter than in the rest of the recording"
    assert noisy.size == pytest.approx(2.0, abs=0.5)
