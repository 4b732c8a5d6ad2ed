from itertools import pairwise

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from trainer import figures
from trainer.figures import draw_loss_curve, draw_scatter, save_png


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


def test_dollars_in_names_are_drawn_as_they_stand(tmp_path):
    truth = np.random.default_rng(0).uniform(1, 2, (30, 1))
    cloud = (truth, truth + 0.1, np.full(1, 0.5))
    draw_scatter({"paper": cloud, "unseen": cloud}, ["Room$20Air_$2d"], ["m"], "a$b_$", tmp_path / "scatter.png")
    assert matplotlib.image.imread(tmp_path / "scatter.png").std() > 0


def test_powers_of_ten_on_a_logarithmic_axis_are_drawn_as_such(tmp_path):
    figure = Figure()
    axes = figure.subplots()
    axes.plot([1, 2], [0.4, 0.9])
    axes.set(yscale="log", title="a$b_$")
    save_png(figure, tmp_path / "log.png")
    labels = axes.get_yticklabels(which="both")
    assert any("mathdefault" in one.get_text() for one in labels)
    assert all(one.get_parse_math() for one in labels) and not axes.title.get_parse_math()


@pytest.mark.parametrize(
    ("high", "low"), [(1.5, 0.9), (1.04, 0.95), (1.0, 0.9999), (0.24, 0.2), (1.2, 0.15), (150, 20)]
)
def test_the_losses_of_a_short_fit_can_be_read_off(tmp_path, monkeypatch, high, low):
    drawn, save = [], figures.save_png
    monkeypatch.setattr(figures, "save_png", lambda figure, path: (save(figure, path), drawn.append(figure)))
    rows = [(10, 0.1, high, high), (20, 0.2, (high + low) / 2, (high + low) / 2), (30, 0.3, low, low)]
    draw_loss_curve(rows, "toy", tmp_path / "curve.png", 30, None)
    (axes,) = drawn[0].axes
    bottom, top = axes.get_ylim()
    labels = {one.get_position()[1]: one.get_text() for one in axes.get_yticklabels(which="both") if one.get_text()}
    within = {place: text for place, text in labels.items() if bottom <= place <= top}
    assert len(within) >= 3
    assert [float(text) for text in within.values()] == pytest.approx(list(within), rel=1e-5)
    boxes = [one.get_window_extent() for one in axes.get_yticklabels() if one.get_text()]
    assert all(below.y1 < above.y0 for below, above in pairwise(sorted(boxes, key=lambda box: box.y0)))


def test_steps_are_whole_numbers(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures, "save_png", lambda figure, path: drawn.append(figure))
    for count in (1, 2, 3):
        draw_loss_curve([(k + 1, 0.1, 1.0, 1.0) for k in range(count)], "toy", tmp_path / "curve.png", 1, None)
        assert all(tick == round(tick) for tick in drawn[-1].axes[0].get_xticks())


def test_losses_over_decades_keep_powers_of_ten(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures, "save_png", lambda figure, path: drawn.append(figure))
    draw_loss_curve([(1, 0.1, 1.0, 1.0), (2, 0.1, 0.01, 0.01)], "toy", tmp_path / "curve.png", 2, None)
    drawn[0].draw_without_rendering()
    assert any("10^{" in one.get_text() for one in drawn[0].axes[0].get_yticklabels())
