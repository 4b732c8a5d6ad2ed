import numpy as np
import pytest

from diagnosis.fitting.fit import LAST, SWINGING, between, swung


def _rounds(optimum, count: int) -> list[np.ndarray]:
    """Optima of rounds, each found with lines drawn where the one before it says."""
    z, path = np.array([1.0, -0.3]), []
    for round_ in range(count):
        z = optimum(between(path, z, round_))
        path.append(z)
    return path


def test_a_swing_is_damped_to_its_fixed_point():
    """Undamped, z -> -0.99 z needs hundreds of rounds."""
    path = _rounds(lambda z: -0.99 * z, 30)
    assert np.abs(path[SWINGING - 1]).max() > 0.9
    assert np.abs(path[-1]).max() < 0.01


def test_what_jumps_for_ever_is_not_known_better_than_the_jump():
    """No fixed point: from either side the optimum lies on the other one."""
    path = _rounds(lambda z: np.array([-1.0 if z[0] > 0 else 1.0, 0.5]), 16)
    assert {one[0] for one in path[-LAST:]} == {-1.0, 1.0}
    z = between(path, path[-1], 16)
    covariance = swung(path, z, 16)
    sd = np.sqrt(covariance[0, 0])
    assert abs(z[0]) + 1.645 * sd > 1.0 and covariance[1, 1] == pytest.approx(0.0)
    np.testing.assert_allclose(covariance, np.cov(np.array(path[-LAST:]).T, bias=True), atol=1e-12)
