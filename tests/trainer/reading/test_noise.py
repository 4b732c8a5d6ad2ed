import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from shared.errors import EstimatorError
from trainer.reading.noise import Sensors, hold_last

from ..conftest import tank_system


def draw(values, preset="gauge", recorded=("level", "glow", "valve"), seed=0):
    return Sensors(tank_system(), list(recorded), preset)(values, torch.Generator().manual_seed(seed))


@given(hnp.arrays(bool, st.tuples(st.integers(1, 3), st.integers(1, 12), st.integers(1, 2))))
def test_a_lost_reading_is_the_last_that_arrived(lost):
    values = np.arange(lost.size, dtype=np.float32).reshape(lost.shape)
    expected = values.copy()
    for b, t, c in np.ndindex(*lost.shape):
        if lost[b, t, c]:
            # nothing has arrived yet: the window's first value stands
            expected[b, t, c] = expected[b, t - 1, c] if t else values[b, 0, c]
    assert np.array_equal(hold_last(torch.from_numpy(values), torch.from_numpy(lost)), expected)


def test_no_noise_changes_nothing():
    values = torch.rand(2, 5, 3)
    assert draw(values, "none") is values


def test_noise_has_the_presets_spread_resolution_and_losses():
    noisy = draw(torch.full((200, 100, 3), 2.0))
    level = noisy[:, :, 0].double()
    # gauge: sd 0.02 m, quantum 0.01 m
    assert level.std().item() == pytest.approx(np.hypot(0.02, 0.01 / np.sqrt(12)), rel=0.03)
    assert level.mean().item() == pytest.approx(2.0, abs=1e-3)
    assert torch.allclose(level / 0.01, torch.round(level / 0.01), atol=1e-3)
    # two neighbours are equal when the second was lost, or by chance of the resolution
    ramp = draw(torch.arange(100.0)[None, :, None].expand(200, 100, 3))[:, :, 0]
    assert (ramp.diff(dim=1) == 0).double().mean().item() == pytest.approx(0.05, abs=0.01)


def test_outputs_without_the_preset_and_inputs_have_no_noise():
    values = torch.rand(3, 20, 3)
    assert torch.equal(draw(values)[:, :, 1:], values[:, :, 1:])


def test_of_several_presets_each_window_draws_one():
    noisy = draw(torch.full((400, 50, 3), 2.0), "none gauge")[:, :, 0]
    silent = (noisy == 2.0).all(dim=1)
    assert silent.double().mean().item() == pytest.approx(0.5, abs=0.1)
    assert noisy[~silent].std().item() == pytest.approx(np.hypot(0.02, 0.01 / np.sqrt(12)), rel=0.05)
    with pytest.raises(EstimatorError, match="noise: 'loud' is not a preset of Tank; found none, gauge"):
        draw(torch.zeros(1, 2, 3), "none loud")
