"""Regressions inside the network, against numpy's least squares."""

import numpy as np
import pytest
import torch

from trainer.models.regressions import Regressions


@pytest.fixture
def plain():
    """One regression of column 2 on columns 0 and 1, over all samples alike, with next to no penalty."""
    layer = Regressions(3, count=1, regressors=2, responses=1, filters=3, reach=1)
    with torch.no_grad():
        for part in layer.parameters():
            part.zero_()
        layer.left.weight[:] = torch.eye(3)[:, :, None]
        layer.choice.weight[:, :3] = torch.eye(3)
        layer.log_penalty.fill_(-25.0)
    return layer


def test_a_regression_gives_the_coefficients_t_values_and_residuals_of_least_squares(plain):
    rng = np.random.default_rng(3)
    x = rng.normal(size=(200, 2)) @ np.array([[1.0, 0.7], [0.0, 0.5]]) + 4.0
    y = x @ np.array([0.8, -0.3]) + 0.2 * rng.normal(size=200) + 7.0
    given = torch.tensor(np.column_stack([x, y])[None], dtype=torch.float32)
    slope_1, slope_2, t_1, t_2, residual, *inflation = (2 * plain(given)[0]).tolist()

    design = np.column_stack([x, np.ones(200)])
    slope = np.linalg.lstsq(design, y, rcond=None)[0]
    left = y - design @ slope
    inverse = np.linalg.inv(design.T @ design)[:2, :2]
    assert np.sinh([slope_1, slope_2]) == pytest.approx(slope[:2], rel=1e-4)
    assert np.exp(2 * residual) == pytest.approx(np.mean(left**2), rel=1e-3)
    # a t-value counts samples as one: it is in units of sqrt(n)
    expected = slope[:2] / np.sqrt(np.diag(inverse) * 200 * np.mean(left**2))
    assert np.sinh([t_1, t_2]) == pytest.approx(expected, rel=1e-3)
    spread = x.var(axis=0)
    assert np.exp(2 * np.array(inflation)) == pytest.approx(np.diag(inverse) * 200 * spread, rel=1e-3)


def test_what_does_not_vary_or_repeats_is_no_trouble():
    torch.manual_seed(0)
    layer = Regressions(3)
    for given in (
        torch.zeros(2, 50, 3),
        torch.ones(2, 50, 3),
        torch.randn(2, 50, 1).expand(2, 50, 3),
        torch.randn(2, 3, 3),
    ):
        given = given.clone().requires_grad_()
        statistics = layer(given)
        statistics.sum().backward()
        assert statistics.shape == (2, layer.size)
        assert torch.isfinite(statistics).all()
        assert torch.isfinite(given.grad).all()
