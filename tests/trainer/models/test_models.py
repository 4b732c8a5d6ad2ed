import numpy as np
import pytest
import torch
from torch import nn

from shared.errors import EstimatorError
from trainer.models import ESTIMATORS, build, option_defaults
from trainer.models.base import Shape
from trainer.models.ridge import solve_ridge

PAPER = Shape(length=168, outputs=2, recorded=2, columns=2, parameters=8, step=3600.0)


def weights(model: nn.Module) -> int:
    return sum(p.numel() for p in model.parameters())


def test_patch_transformer_has_the_weights_of_table_2():
    embedding = 2 * 12 * 64 + 64
    attention = 3 * (64 * 64 + 64) + (64 * 64 + 64)
    feedforward = (64 * 256 + 256) + (256 * 64 + 64)
    layer = attention + feedforward + 2 * (64 + 64)
    head = (64 + 64) + (64 * 128 + 128) + (128 * 64 + 64) + (64 * 8 + 8)
    assert embedding + 4 * layer + head == 218_760
    assert weights(build("patch-transformer", PAPER, {})[0]) == 218_760


def test_patch_transformer_is_that_of_table_2():
    model, options = build("patch-transformer", PAPER, {})
    assert options == {"patch": 12, "width": 64, "layers": 4, "heads": 8, "feedforward": 256, "dropout": 0.2}
    assert model.tokens == 14
    layers = [m for m in model.modules() if isinstance(m, nn.TransformerEncoderLayer)]
    assert len(layers) == 4
    assert {m.self_attn.num_heads for m in layers} == {8}
    assert not any(m.norm_first for m in layers)
    assert {m.p for m in model.modules() if isinstance(m, nn.Dropout)} == {0.2}
    assert {m.negative_slope for m in model.modules() if isinstance(m, nn.LeakyReLU)} == {0.2}
    assert not any(isinstance(m, nn.ReLU) for m in model.modules())


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.parametrize("length", [24, 168])
def test_every_estimator_answers_with_a_row_per_window(name, length):
    shape = Shape(length, 2, 2, 4, 8, 3600.0)
    model, _ = build(name, shape, {})
    model.eval()
    x, time = torch.randn(5, length, 4), torch.arange(5).double() * 3600
    answer = model(x, time)
    assert answer.shape == (5, 8)
    torch.testing.assert_close(answer[3:], model(x[3:], time[3:]), rtol=1e-4, atol=1e-5)
    assert torch.isfinite(model(torch.zeros_like(x), time)).all()  # sensors that stand still have no spread


def test_ridge_agrees_with_least_squares_on_augmented_rows():
    rng = np.random.default_rng(0)
    x, y = rng.normal(1.0, 2.0, (60, 5)), rng.normal(size=(60, 3))
    design = np.concatenate([x, np.ones((60, 1))], axis=1)
    alphas = np.array([0.0, 0.3, 10.0])
    answers = solve_ridge(design.T @ design / 60, design.T @ y / 60, alphas)
    for alpha, answer in zip(alphas, answers, strict=True):
        penalty = np.sqrt(60 * alpha) * np.eye(6)[:5]  # the intercept is free
        rows = np.concatenate([design, penalty])
        expected = np.linalg.lstsq(rows, np.concatenate([y, np.zeros((5, 3))]), rcond=None)[0]
        np.testing.assert_allclose(answer, expected, atol=1e-9)


def test_options_are_listed_and_checked():
    assert option_defaults("lstm") == {"width": 112, "layers": 2, "dropout": 0.2}
    assert weights(build("lstm", PAPER, {"width": 16})[0]) < 10_000
    with pytest.raises(EstimatorError, match="lstm: no option 'patch'; found width, layers, dropout"):
        build("lstm", PAPER, {"patch": 12})
    with pytest.raises(EstimatorError, match=r"option 'width' is 1.5; expected a whole number"):
        build("lstm", PAPER, {"width": 1.5})
    with pytest.raises(EstimatorError, match=r"not enough memory for a lstm of width 1e\+09 \(.*\); expected less"):
        build("lstm", PAPER, {"width": 1e9})
    with pytest.raises(EstimatorError, match=r"lstm: option 'width' is 1e\+30; expected at most 2147483647"):
        build("lstm", PAPER, {"width": 1e30})
    with pytest.raises(EstimatorError, match="patch is 12 samples; expected no more than the 6 of the context"):
        build("patch-transformer", Shape(6, 2, 2, 2, 8, 3600.0), {})
    with pytest.raises(EstimatorError, match="expected a multiple of the 8 attention heads"):
        build("patch-transformer", PAPER, {"width": 60})
