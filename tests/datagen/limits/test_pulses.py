import numpy as np

from datagen.limits.pulses import responses

HOUR = 3600.0


def test_pulses_that_share_a_simulation_are_told_apart():
    """A tank that forgets with a time constant of a day: the response to each pulse is known."""
    time = HOUR * np.arange(1, 721)
    pulses = [(HOUR * k, HOUR * k + 1800.0) for k in range(720)]
    asked = []

    def one(begin):
        return np.where(time > begin, np.exp(-(time - begin) / (24 * HOUR)), 0.0)

    def response(some):
        asked.append(len(some))
        return np.stack([sum(one(begin) for begin, _ in some)] * 2)

    found = responses(response, pulses, time)
    assert asked == [3] * 240  # thirty days, ten between two
    exact = np.stack([one(begin) for begin, _ in pulses], axis=-1)
    np.testing.assert_allclose(found, np.stack([exact, exact]), atol=2 * np.exp(-10))
