"""What the page of a diagnosis says beside the report."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from diagnosis.gap import diagnosed as concluded
from diagnosis.gap import page as pictures
from diagnosis.gap.page import answered_by, dated, render
from diagnosis.gap.schema import Report
from diagnosis.physics import Finding
from diagnosis.where.sources import SUSPECT
from shared.numbers import number
from tests.diagnosis.gap.report_cases import named, place, report


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
