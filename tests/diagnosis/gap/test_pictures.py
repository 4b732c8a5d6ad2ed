"""Pictures of a diagnosis show what its sentences say, and all of it; from diagnoses made up for the purpose."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import page as pictures
from diagnosis.gap.page import LEAST, draw_outputs, draw_shares
from diagnosis.gap.schema import ShrinkageOf
from diagnosis.gap.sentences import _share


def shrunk(share, low, high, placebo=0.0):
    return ShrinkageOf(
        channel="room",
        unit="K",
        readings=24,
        before=1.0,
        after=0.1,
        floor=0.1,
        share=share,
        low=low,
        high=high,
        placebo=placebo,
        placebo_best=0.2,
    )


@pytest.mark.parametrize(
    ("share", "low", "high"), [(1.3, 1.1, 2.3), (0.7, 0.4, 0.9), (0.9, 0.2, 1.2), (0.1, -4.0, 0.3)]
)
def test_shares_are_drawn_as_they_are_said(share, low, high):
    """More than all of a gap cannot be gone; an interval that goes on beyond the picture's edge says how far."""
    one = shrunk(share, low, high)
    (axes,) = draw_shares(SimpleNamespace(report=SimpleNamespace(shrinkage=[one]), base=based([]))).axes
    interval, dot = axes.lines[:2]
    drawn = [*dot.get_xdata(), *interval.get_xdata()]
    assert [_share(x) for x in one.told] == [_share(x) if x > LEAST else _share(low) for x in drawn]
    assert max(drawn) <= 1.0 < axes.get_xlim()[1] and axes.get_xlim()[0] < min(drawn)
    marks = [text.get_text() for text in axes.texts]
    assert marks == ([f"{low:.0%} ←"] if low < LEAST else [])
    assert (one.share, one.low, one.high) == (share, low, high)  # report.json has what was found


def based(parameters):
    outputs = [SimpleNamespace(name="room", long_name="air of the room")]
    return SimpleNamespace(problem=SimpleNamespace(system=SimpleNamespace(parameters=parameters, outputs=outputs)))


def residuals_of(left):
    """A stage whose residual (2, steps) is by the hour, from its start on."""
    outputs = [SimpleNamespace(name=name, long_name=f"air of the {name}", unit="K") for name in ("room", "wall")]
    problem = SimpleNamespace(
        time=3600.0 * np.arange(1, left.shape[1] + 1),
        recording=SimpleNamespace(start=0.0, step=3600.0, began="2001-01-05 00:00"),
        system=SimpleNamespace(outputs=outputs),
    )
    return SimpleNamespace(
        twins=SimpleNamespace(residual=left),
        lin=SimpleNamespace(problem=problem),
        grams=SimpleNamespace(channels=[0, 1]),
        colours=SimpleNamespace(best={0: (0.1, 0.0, 1.0), 1: (0.1, 0.0, 1.0)}),
    )


def test_kept_days_are_shaded_from_their_midnight_to_their_midnight(monkeypatch):
    """A step's time is its end: the first of a day is an hour after its begin."""
    monkeypatch.setattr(pictures, "left_by", lambda one, *_: one)
    left = np.zeros((2, 96))
    stage = residuals_of(left)
    scored = (np.arange(96) // 24 == 1) | (np.arange(96) // 24 == 3)
    done = SimpleNamespace(
        search=SimpleNamespace(stages=[stage], last=stage),
        apart=SimpleNamespace(before=left, after=left),
        whole=SimpleNamespace(observed=None),
        scored=scored,
        report=SimpleNamespace(verdict="none_of_these"),
    )
    panel = draw_outputs(done).axes[0]
    spans = [(one.get_x(), one.get_x() + one.get_width()) for one in panel.patches]
    assert [one for one in spans if one[0] > 0] == [pytest.approx((1.0, 2.0)), pytest.approx((3.0, 4.0))]
    said = [text.get_text() for text in panel.get_legend().get_texts()]
    assert said[:1] + said[-1:] == ["two standard deviations of noise", "days kept from the fit"] and len(said) == 4
    assert said[2] == "with the nearest candidate"
    noise, *kept = panel.patches
    assert noise.get_hatch() is None and {one.get_hatch() for one in kept} == {"//"}
    assert panel.get_ylabel().split("\n")[0] == "air of the room (room)"


def test_days_have_their_dates_below_them():
    stage = residuals_of(np.zeros((2, 96)))
    made = draw_outputs(SimpleNamespace(search=SimpleNamespace(stages=[stage]), apart=None))
    made.draw_without_rendering()
    labels = [one.get_text().split("\n") for one in made.axes[-1].get_xticklabels()]
    assert ["1", "6 Jan"] in labels and ["2", "7 Jan"] in labels
