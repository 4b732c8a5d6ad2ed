"""The default estimator: missing readings and shorter contexts."""

import pytest
import torch

from shared.errors import EstimatorError
from trainer.models import build
from trainer.models.base import Shape

SHAPE = Shape(length=96, outputs=2, recorded=3, columns=5, parameters=4, step=3600.0)


@pytest.fixture
def model():
    torch.manual_seed(0)
    return build("multiscale-transformer", SHAPE, {"width": 32, "layers": 2, "feedforward": 64})[0].eval()


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
