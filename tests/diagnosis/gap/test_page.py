"""What the page of a diagnosis says beside the report."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.gap import concluded
from diagnosis.gap.page import answered_by, output_panels, render
from diagnosis.gap.schema import Report
from diagnosis.pages import long_named
from diagnosis.physics import Finding
from diagnosis.where.sources import SUSPECT


def test_kept_days_are_shaded_from_their_midnight_to_their_midnight(drifted):
    """A step's time is its end: the first of a day is an hour after its begin."""
    (panel,), scored = output_panels(drifted.done), drifted.done.scored
    (kept,) = panel.strips
    assert kept.hatched and kept.label == "days kept from the fit"
    assert {str(one)[11:16] for one in (*kept.begins, *kept.ends)} == {"00:00"}
    hours = [(panel.time > begin) & (panel.time <= end) for begin, end in zip(kept.begins, kept.ends, strict=True)]
    np.testing.assert_array_equal(np.any(hours, axis=0), scored)
    said = [one.label for one in panel.curves]
    assert said == ["two standard deviations of noise", "base model", "with the effects found"]


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
    assert SUSPECT not in page and "this balance is off" not in page and answered_by(drifted.done) == {"sensor"}
    assert drifted.done.report.dropped == [] and "None of this is enough" not in " ".join(render(drifted.done).split())


def test_what_the_effects_found_account_for_is_drawn_into_what_the_model_lacks(drifted, monkeypatch):
    """The readings that the effects took away stand for it: all of it where nothing is left."""
    drawn = {}
    monkeypatch.setattr("diagnosis.gap.page.source_panels", lambda *_, **given: drawn.update(given) or [])
    render(drifted.done)
    assert drawn["explained"].keys() == {one.name for one in drifted.done.where.sources.sources}
    where = drifted.done.where
    nothing = replace(where, residuals=replace(where.residuals, observed=np.zeros_like(where.residuals.observed)))
    render(replace(drifted.done, where_left=nothing))
    for one in where.sources.sources:
        assert drawn["explained"][one.name] == pytest.approx(one.estimate, abs=1e-6 * np.abs(one.estimate).max())
    render(replace(drifted.done, where_left=None))
    assert drawn["explained"] is None
