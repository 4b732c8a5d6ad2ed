"""The default estimator: what it sees of small deviations, missing readings and shorter contexts."""

import numpy as np
import pytest
import torch

from shared.errors import EstimatorError
from trainer.models import build
from trainer.models.base import Shape
from trainer.models.multiscale_transformer import GAIN, LEVEL_SCALES, STEP_SCALES

SHAPE = Shape(length=96, outputs=2, recorded=3, columns=5, parameters=4, step=3600.0)


@pytest.fixture
def model():
    torch.manual_seed(0)
    return build("multiscale-transformer", SHAPE, {"width": 32, "layers": 2, "feedforward": 64})[0].eval()


def test_columns_hold_what_their_formulas_say(model):
    windows = torch.randn(3, 96, 5)
    columns = model.columns(windows).numpy()
    assert columns.shape == (3, 96, 5 + 2 * (2 + len(LEVEL_SCALES) + len(STEP_SCALES)))
    series = windows[:, :, :2].numpy().astype(np.float64)
    steps = np.diff(series, axis=1, prepend=series[:, :1])
    above = series - np.quantile(series, 0.02, axis=1, keepdims=True)
    expected = [windows.numpy(), 5 * steps]
    expected += [GAIN * np.arcsinh(above / s) for s in (1e-3, 1e-2, 1e-1)]
    expected += [GAIN * np.arcsinh(steps / s) for s in (1e-3, 1e-2)]
    expected += [np.zeros_like(series)]
    np.testing.assert_allclose(columns, np.concatenate(expected, axis=2), atol=2e-4)


def test_missing_readings_are_zero_and_flagged(model):
    windows = torch.randn(2, 96, 5)
    windows[0, 10:20, 1] = torch.nan
    windows[1, :, 0] = torch.nan
    columns = model.columns(windows)
    assert torch.isfinite(columns).all()
    flags = columns[:, :, -2:]
    assert torch.equal(flags[0, :, 1].nonzero().flatten(), torch.arange(10, 20))
    assert flags[1, :, 0].all()
    assert not flags[1, :, 1].any()
    assert not columns[1, :, 0].any()
    assert torch.isfinite(model(windows, torch.zeros(2))).all()


def test_a_shorter_context_is_read_from_its_end(model):
    windows = torch.randn(2, 96, 5)
    time = torch.zeros(2, dtype=torch.float64)
    assert model(windows[:, -24:], time).shape == (2, 4)
    # 30 samples hold two patches of twelve: the oldest six are left out
    assert torch.equal(model(windows[:, -30:], time), model(windows[:, -24:], time))
    assert not torch.equal(model(windows[:, -36:], time), model(windows[:, -24:], time))
    with pytest.raises(EstimatorError, match="a window has 108 samples; expected 12 to 96"):
        model(torch.randn(2, 108, 5), time)


def test_a_deviation_of_a_thousandth_is_seen(model):
    """At the lowest scale a change of 1e-3 standard deviations moves a column as much as one of 0.2 in the level's."""
    windows = torch.zeros(1, 96, 5)
    windows[:, 48:, 0] = 1e-3
    change = (model.columns(windows) - model.columns(torch.zeros(1, 96, 5)))[0, 60]
    assert change.abs().max() > 0.2
    assert change[0] == pytest.approx(1e-3)


def with_views(count):
    torch.manual_seed(0)
    return build("multiscale-transformer", SHAPE, {"width": 32, "layers": 2, "feedforward": 64, "views": count})[0]


def test_views_are_the_same_window_in_patches_that_begin_elsewhere(model):
    """The second of two views by hand: half a patch of missing readings before and behind the window."""
    windows = torch.randn(3, 48, 5)
    columns = model.columns(windows)
    nothing = torch.zeros(3, 6, columns.shape[2])
    nothing[:, :, -2:] = 1
    facts = torch.zeros(3, 0)
    second = model.read(torch.cat([nothing, columns, nothing], dim=1), facts)
    both = with_views(2).eval()
    torch.testing.assert_close(both.embed(windows), (model.embed(windows) + second) / 2)
    # the longest window has no room for a patch more: the oldest half patch is left out
    columns = model.columns(torch.randn(3, 96, 5))
    second = model.read(torch.cat([columns, nothing], dim=1)[:, -96:], facts)
    torch.testing.assert_close(both.read(columns, facts), (model.read(columns, facts) + second) / 2)


def test_a_patch_longer_than_the_context_is_refused():
    with pytest.raises(EstimatorError, match="patch is 97 samples; expected no more than the 96"):
        build("multiscale-transformer", SHAPE, {"patch": 97})
    with pytest.raises(EstimatorError, match="width is 30; expected a multiple of the 8 attention heads"):
        build("multiscale-transformer", SHAPE, {"width": 30})
