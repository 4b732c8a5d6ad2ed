import numpy as np
import pytest
import torch

from trainer.models.base import Shape
from trainer.models.features import Summary
from trainer.reading.windows import Batch

HOUR = 3600.0


def windows(batch=6, length=72, columns=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(batch, length, columns, generator=generator), torch.arange(batch).double() * 5 * HOUR


@pytest.mark.parametrize(("length", "step"), [(1, HOUR), (168, HOUR), (9, 86400.0)])
def test_statistics_are_finite_and_as_many_as_announced(length, step):
    summary = Summary(Shape(length, 2, 2, 4, 3, step))
    x, time = windows(length=length, columns=4)
    for series in (x, 0 * x):
        answer = summary(series, time)
        assert answer.shape == (6, summary.size)
        assert torch.isfinite(answer).all()


def test_statistics_are_standardised_by_what_was_seen():
    summary = Summary(Shape(72, 2, 2, 2, 3, HOUR))
    x, time = windows(batch=500)
    summary.prepare(Batch(x, time, torch.zeros(500, 3)))
    answer = summary(x, time)
    varying = summary.sd != 1
    assert answer.mean(dim=0).abs().max() < 0.01
    assert answer[:, varying].std(dim=0).median().item() == pytest.approx(1, abs=0.05)


def test_the_linear_model_recovers_a_system_that_is_linear():
    rng = np.random.default_rng(0)
    u, shock = rng.normal(size=(2, 6000))
    y = np.zeros(6000)
    for t in range(1, 6000):
        y[t] = 0.9 * y[t - 1] + 0.3 * u[t] - 0.2 * u[t - 1] + 0.1 * shock[t]
    x = torch.tensor(np.stack([y, u], axis=1)[None], dtype=torch.float32)
    summary = Summary(Shape(6000, 1, 2, 2, 1, HOUR))
    coefficients, left, _ = summary._dynamics(x, torch.zeros(1, dtype=torch.float64))
    # regressors: y, u an hour ago; y, u two hours ago; u now; clock and constant
    np.testing.assert_allclose(coefficients[0, :5], [0.9 - 1, -0.2, 0, 0, 0.3], atol=0.03)
    np.testing.assert_allclose(left.exp(), [[0.1]], rtol=0.05)
