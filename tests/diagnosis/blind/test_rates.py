"""How often what was said with a probability was so, and how sure that is."""

import numpy as np
import pytest

from diagnosis.blind.rates import _reliability, share


@pytest.mark.parametrize("times", [1, 10])
def test_statements_about_one_recording_count_as_one_when_it_is_said_how_sure_a_frequency_is(times):
    """Twenty recordings, of which each says the same thing once or ten times: nothing more is known."""
    said = [[(0.3, k % 2 == 0)] * times for k in range(20)]
    (found,) = (one.happened for one in _reliability(said, 0).bins if one.happened.n)
    once = share([k % 2 == 0 for k in range(20)])
    assert (found.n, found.value) == (20 * times, 0.5)
    assert found.low == pytest.approx(once.low, abs=0.06)
    assert found.high == pytest.approx(once.high, abs=0.06)


def test_intervals_of_a_frequency_hold_it_where_few_recordings_all_say_alike():
    """Four statements of each recording, all of them true or none: the interval of 95 % holds the true frequency."""
    recordings = 5
    rng, held = np.random.default_rng(0), 0
    for seed in range(60):
        said = [[(0.1, bool(so))] * 4 for so in rng.random(recordings) < 0.1]
        (found,) = (one.happened for one in _reliability(said, seed).bins if one.happened.n)
        held += found.low <= 0.1 <= found.high
    assert held >= 54  # of 57 expected
