"""What the page of a diagnosis says beside the report."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import concluded
from diagnosis.gap import page as pictures
from diagnosis.gap.page import LEAST, answered_by, dated, draw_outputs, draw_shares, render
from diagnosis.gap.schema import Report, ShrinkageOf
from diagnosis.gap.sentences import _share
from diagnosis.physics import Finding
from diagnosis.where.sources import SUSPECT
from shared.numbers import number
from tests.diagnosis.gap.report_cases import named, place, report


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


def test_findings_that_have_a_time_have_a_date():
    zero = np.datetime64("2024-02-28T00:00:00")
    stretch = place("room").model_copy(update={"cell": {"first_s": "86400", "last_s": "216000"}})
    assert dated(stretch, zero) == " (29 Feb 00:00 to 1 Mar 12:00)"
    assert dated(place("room"), zero) == ""


def test_an_answer_is_of_a_sensor_of_a_balance_or_of_both():
    effects = [
        SimpleNamespace(name="offset", changes=["output:room"]),
        SimpleNamespace(name="leak", changes=["parameter"]),
    ]
    search = SimpleNamespace(stages=[SimpleNamespace(lin=SimpleNamespace(effects=effects))])

    def answered(*names):
        ones = [named(name, answer=name in names) for name in ("offset", "leak")]
        return answered_by(SimpleNamespace(search=search, report=report(effects=ones)))

    assert [answered(), answered("offset"), answered("leak"), answered("offset", "leak")] == [
        set(),
        {"sensor"},
        {"balance"},
        {"sensor", "balance"},
    ]


def test_what_cannot_be_stands_before_the_answer_and_hints_after_it(drifted):
    """In the box, and in the JSON before the verdict, which reads as it was written."""
    wrong = Finding("clock", ("room",), -8.0, "h", "The room comes 8 h early.", "Write shift = 28800.0.", strong=True)
    hint = Finding("description", ("room",), 2.0, "K", "The room is cooled.", "Describe it.", strong=False)
    told = drifted.done.report.model_copy(update={"physics": [wrong, hint]})
    page = " ".join(render(replace(drifted.done, report=told)).split())
    places = [
        page.index(text)
        for text in ("Correct this before believing what follows: The room comes", 'class="head"', told.summary[0][:20])
    ]
    assert places == sorted(places) and places[-1] < page.index("Worth a look: The room is cooled. Describe it.")
    assert list(told.model_dump())[:3] == ["schema_version", "physics", "verdict"]
    assert Report.model_validate_json(told.model_dump_json()) == told
    assert drifted.done.report.physics == []


def test_where_there_is_no_gap_no_place_is_called_one(drifted, monkeypatch):
    """Places are listed at one in twenty, a gap takes one in a hundred; and what was fitted and given up is said."""
    monkeypatch.setattr(concluded, "gap_found", lambda *_: False)
    done = drifted.done.without([])
    assert (done.report.verdict, done.report.dropped, done.report.balance) == ("no_gap", ["drift"], "none")
    assert done.report.where and not any(one.named for one in done.report.effects)
    assert "drift fits the recording much better" in done.report.summary[0]
    page = " ".join(render(done).split())
    assert "None of this is enough for a gap" in page and {"none"} == answered_by(done)
    assert SUSPECT not in page and "this balance is off" not in page
    assert drifted.done.report.dropped == [] and "None of this is enough" not in " ".join(render(drifted.done).split())


def test_a_candidate_without_a_bar_is_not_told_to_explain_nothing(drifted, monkeypatch):
    monkeypatch.setattr(pictures, "_MOST", 1)
    scan = drifted.done.search.stages[0].scan
    with_bar = int((scan.beyond / scan.threshold > 0.01).sum())
    page = " ".join(render(drifted.done).split())
    assert with_bar > 1 and "explain nothing" not in page
    assert f"has less than 1% of its threshold, or is one of {with_bar - 1} with shorter bars" in page
    monkeypatch.setattr(pictures, "_MOST", 14)
    assert "with shorter bars" not in " ".join(render(drifted.done).split())


def test_the_noise_of_the_null_has_its_unit(drifted):
    (one,) = drifted.done.report.noise
    page = " ".join(render(drifted.done).split())
    assert f"{number(one.size)} degC" in page.split("Noise of the null:")[1]
