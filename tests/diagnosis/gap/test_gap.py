"""The whole diagnosis on a small house, whose recordings another program made (an exact recursion)."""

import json
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from diagnosis.fitting.starting import begun
from diagnosis.gap.diagnosed import diagnose
from diagnosis.gap.page import LINES, render
from diagnosis.gap.schema import Report
from diagnosis.measurements.importer import import_recording
from diagnosis.recording import read_recording
from shared.stretches import Stretch
from tests.diagnosis.conftest import WARM_UP
from tests.diagnosis.gap.gap_cases import candidates, changed, drifting

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
def test_a_drifting_sensor_is_found_told_how_large_and_removed(drifted, house):
    report, out = drifted.done.report, drifted.out
    assert report.verdict == "effect"
    assert [one.name for one in report.effects if one.named] == ["drift"]
    first = report.effects[0]
    assert first.low < 3.0 < first.high
    # no narrower than if all but the drift were known: 3.29 * 0.05 K / sqrt(sum of (hours / 720)^2 = 24.28)
    assert 0.033 < first.high - first.low < 0.4
    assert first.probability > 0.5
    (room,) = report.shrinkage
    assert room.share > 0.8 > room.placebo
    assert room.low < room.share < room.high
    assert room.before > 2 * room.floor
    assert report.where and report.where[0].p_value <= 0.05
    total = report.none_of_these + report.no_gap + sum(one.probability for one in report.effects)
    assert total == pytest.approx(1.0, abs=1e-6)
    again = Report.model_validate(json.loads((out / "report.json").read_text(encoding="utf-8")))
    assert again == report
    begin = np.datetime64(again.zero) + np.timedelta64(round(again.start), "s")
    assert str(begin.astype("datetime64[m]")).replace("T", " ") == read_recording(drifted.path, house("me")).began
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Hours are of standard time" in page
    assert page.index(report.summary[0][:20]) < page.index("<img")
    words = " ".join(page.split())
    assert "Both are fitted to the days that are not hatched" in words and "base model fitted to all days" in words
    assert ("fit of the base model had not converged" in words) == (not report.converged)
    # which hours these are, and how many more than the page shows, depends on rounding
    assert {one.kind for one in report.where if "first_s" in one.cell} >= {"episode"}
    for one in [one for one in report.where[:LINES] if "first_s" in one.cell]:
        at = datetime.fromisoformat(str(again.zero)) + timedelta(seconds=int(one.cell["first_s"]))
        assert f"({at.day} {at:%b %H:%M}" in words, one
    assert sorted(one.name for one in out.iterdir()) == ["report.html", "report.json"]


@pytest.mark.slow
def test_without_a_gap_none_is_reported(house, house_recording):
    system = house("me")
    done = diagnose(system, house_recording(hours=120, seed=4), effects=candidates(system), warm_up=WARM_UP)
    report = done.report
    assert report.verdict == "no_gap", report.stages
    page = " ".join(render(done).split())
    assert "effects found" not in page and page.count("<th>after</th>") == page.count("<th>noise alone</th>")
    assert not any(one.named for one in report.effects)
    assert report.no_gap > 0.3
    assert all(one.p_value > 0.02 for one in report.stages)


@pytest.mark.slow
def test_a_cause_that_is_not_among_the_candidates_is_none_of_these(house, house_recording):
    """A sensor that fails for two days in the middle: no drift, lag, gain or weather looks like it."""
    system = house("me")
    path = changed(
        house_recording(hours=240, seed=5),
        lambda t, y: y + 1.5 * np.sin(2 * np.pi * t / (53 * 3600.0)) * (t % 3e5 < 2e5),
    )
    done = diagnose(system, path, effects=candidates(system), warm_up=WARM_UP)
    report = done.report
    assert report.verdict == "none_of_these", report.stages
    assert done.evidence.gap and done.evidence.candidates and min(done.evidence.candidates.values()) >= 0.0
    assert report.none_of_these > max(one.probability for one in report.effects)
    assert report.stages[0].left_over > 10


SPENT = {"simulations", "seconds", "cpu_seconds"}


def alike(found, fresh, where=""):
    """Whether two JSON values are the same but for rounding."""
    if isinstance(fresh, dict):
        assert found.keys() == fresh.keys(), where
        for name in fresh:
            alike(found[name], fresh[name], f"{where}.{name}")
    elif isinstance(fresh, list):
        assert len(found) == len(fresh), where
        for k, (a, b) in enumerate(zip(found, fresh, strict=True)):
            alike(a, b, f"{where}[{k}]")
    elif isinstance(fresh, float):
        assert found == pytest.approx(fresh, rel=1e-7, abs=1e-9), where
    else:
        assert found == fresh, where


@pytest.mark.slow
def test_without_a_candidate_is_what_a_fresh_diagnosis_without_it_says(house, house_recorded, tmp_path, monkeypatch):
    """The cause is withheld."""
    spent = []

    def noted(problem, starts):
        one = begun(problem, starts)
        spent.append(problem.simulations)
        return one

    monkeypatch.setattr("diagnosis.gap.diagnosed.begun", noted)
    system, path = house("me"), drifting(house_recorded(tmp_path, hours=96, seed=3), by=5.0)
    effects = [one for one in candidates(system) if one.name in ("drift", "gain")]
    done = diagnose(system, path, effects=effects, warm_up=WARM_UP)
    assert "drift" in {one.name for one in done.report.effects if one.named}
    fresh = diagnose(system, path, effects=effects[1:], warm_up=WARM_UP)
    again = done.without(["drift"])
    assert again.report.simulations <= fresh.report.simulations - spent[-1]  # its fit is known
    alike(again.report.model_dump(exclude=SPENT), fresh.report.model_dump(exclude=SPENT))
    assert "drift" not in {one.name for one in again.report.effects}


@pytest.mark.slow
def test_weather_that_the_import_computed_is_no_gap(tmp_path):
    """The README's own room, which has none: its log has the sun on the horizontal, and neither facade nor sky."""
    example = ROOT / "docs" / "example"
    import_recording(example / "mapping.toml", example / "measurements.csv", out=tmp_path / "recording.nc")
    report = diagnose("MixedAirCO2", tmp_path / "recording.nc", stretch=Stretch(end="2001-01-08")).report
    assert report.verdict == "no_gap", report.summary
    assert report.no_gap > max(report.none_of_these, *(one.probability for one in report.effects))
    assert "split by Erbs" in report.assumed["HFac"]
