import pytest
import torch

from trainer.models.base import Shape
from trainer.models.features import Summary

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
