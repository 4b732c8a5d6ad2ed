import matplotlib.image
import numpy as np
import pytest

from trainer.figures import draw_loss_curve, draw_scatter


def test_a_loss_curve_is_drawn(tmp_path):
    rows = [(10, 0.1, float("nan"), 1.0), (20, 0.2, 0.9, 0.7), (30, 0.3, 0.5, 0.8)]
    draw_loss_curve(rows, "toy", tmp_path / "curve.png", 20, 0.4)
    assert matplotlib.image.imread(tmp_path / "curve.png").std() > 0


@pytest.mark.parametrize("parameters", [1, 5, 8])
def test_a_scatter_has_a_panel_for_each_parameter(tmp_path, parameters):
    truth = np.random.default_rng(0).uniform(1, 2, (30, parameters))
    cloud = (truth, truth + 0.1, np.full(parameters, 0.5))
    names = [f"p{k}" for k in range(parameters)]
    draw_scatter({"paper": cloud, "unseen": cloud}, names, ["m"] * parameters, "toy", tmp_path / "scatter.png")
    height, width = matplotlib.image.imread(tmp_path / "scatter.png").shape[:2]
    assert width == pytest.approx(150 * 3.2 * min(parameters, 4), abs=2)
    assert height == pytest.approx(150 * (3.1 * -(-parameters // 4) + 0.5), abs=2)
