"""What the page of a diagnosis says beside the report."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import concluded
from diagnosis.gap import page as pictures
from diagnosis.gap.page import answered_by, dated, output_panels, render
from diagnosis.gap.schema import Report
from diagnosis.pages import long_named
from diagnosis.physics import Finding
from diagnosis.where.sources import SUSPECT
from tests.diagnosis.gap.report_cases import named, place, report


def residuals_of(left):
    """A stage whose residual (2, steps) is by the hour, from its start on."""
    outputs = [SimpleNamespace(name=name, long_name=f"air of the {name}", unit="K") for name in ("room", "wall")]
    problem = SimpleNamespace(
        time=3600.0 * np.arange(1, left.shape[1] + 1),
        recording=SimpleNamespace(zero=np.datetime64("2001-01-05"), step=3600.0),
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
    panel = output_panels(done)[0]
    (kept,) = panel.strips
    assert kept.hatched and kept.label == "days kept from the fit"
    assert [str(one)[:16] for one in kept.begins] == ["2001-01-06T00:00", "2001-01-08T00:00"]
    assert [str(one)[:16] for one in kept.ends] == ["2001-01-07T00:00", "2001-01-09T00:00"]
    said = [one.label for one in panel.curves]
    assert said == ["two standard deviations of noise", "base model", "with the nearest candidate"]
    assert (panel.title, panel.unit, str(panel.time[0])[:16]) == ("air of the room (room)", "K", "2001-01-05T01:00")


def test_the_page_loads_nothing_and_its_pictures_of_time_have_units(drifted):
    page = (drifted.out / "report.html").read_text(encoding="utf-8")
    without = re.sub(r"<script([^>]*)>.*?</script>", r"<script\1>", page, flags=re.S)
    assert not re.findall(r"""(?:src|href)=["'](?!data:|no picture)""", without) and "http:" not in without
    assert without.count("<script") == without.count("<script>") and "https:" not in without and len(page) < 2_500_000
    outputs = drifted.done.whole.system.outputs
    assert {(one.title, one.unit) for one in output_panels(drifted.done)} == {
        (long_named(one.name, one.long_name), one.unit.replace("°C", "K")) for one in outputs
    }
    assert page.count("This picture needs JavaScript.") == 2 and '"text":"room' in page


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


def test_what_the_effects_found_account_for_is_drawn_into_what_the_model_lacks(drifted, monkeypatch):
    """The readings that the effects took away stand for it: all of it where nothing is left."""
    drawn = {}
    monkeypatch.setattr(pictures, "source_panels", lambda *_, **given: drawn.update(given) or [])
    render(drifted.done)
    assert drawn["explained"].keys() == {one.name for one in drifted.done.where.sources.sources}
    where = drifted.done.where
    nothing = replace(where, residuals=replace(where.residuals, observed=np.zeros_like(where.residuals.observed)))
    render(replace(drifted.done, where_left=nothing))
    for one in where.sources.sources:
        assert drawn["explained"][one.name] == pytest.approx(one.estimate, abs=1e-6 * np.abs(one.estimate).max())
    render(replace(drifted.done, where_left=None))
    assert drawn["explained"] is None
