"""Scores of verdicts that were made by hand, against figures that were worked out by hand."""

import base64
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from diagnosis.blind.score_report import markdown
from diagnosis.blind.score_schema import read_score
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Moved, Outcome, Place, Shrunk, Verdict, Withheld, read_outcome, write_withheld
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import AIR, QUIET, ROOM, Case, counts, said, write_results, write_set

NONE = Verdict(verdict="none_of_these", probabilities={"a": 0.1, "b": 0.1}, none=0.8, nothing=0.0)


def cases():
    """Twelve recordings; the structural gap of those without effect is at most 0.4 in the room."""
    at_noon = [Place(channel=ROOM, cell={"hours": "08:00-10:00", "day_type": "any", "band": "all"}, p_value=0.005)]
    moved = {"r": Moved(before=10.0, after=1.0), "v": Moved(before=12.0, after=11.0)}
    shrunk = {ROOM: Shrunk(share=0.9, low=0.8, high=1.0), AIR: Shrunk(share=None, low=None, high=None)}
    return [
        Case("none", truth="no_gap", room=0.4, verdict=QUIET),
        Case("none", truth="no_gap", room=0.2, verdict=said("a", p={"a": 0.5}, none=0.5)),
        Case("none", truth="no_gap", room=0.2, verdict=None),
        Case("library", ("a",), sizes=(2.0,), room=4.0, hours=(8, 10),
             verdict=said("a", p={"a": 0.9, "b": 0.1}, where=at_noon, shrinkage=shrunk, parameters=moved)),
        Case("library", ("a",), sizes=(0.3,), room=0.3, verdict=QUIET),
        Case("library", ("b",), sizes=(1.0,), room=2.0, air=2.0,
             verdict=said("a", "b", p={"a": 0.6, "b": 0.3}, none=0.1, shrinkage=shrunk, parameters=moved,
                          where=[Place(channel=AIR, kind="episode", cell={"period": "x"}, p_value=0.01)])),
        Case("form", ("b",), sizes=(2.0,), room=3.0, air=3.0, verdict=said("b")),
        Case("form", ("a",), sizes=(0.6,), room=2.0, verdict=NONE),
        Case("two", ("a", "b"), sizes=(1.0, 4.0), room=4.0, verdict=said("a", "b")),
        Case("two", ("a", "c"), sizes=(1.0, 1.0), room=4.0, verdict=said("c")),
        Case("outside", truth="none_of_these", room=3.0, verdict=NONE),
        Case("outside", truth="none_of_these", room=0.5, verdict=said("c")),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    root = tmp_path_factory.mktemp("scored")
    folder, answers = write_set(root / "set", cases())
    results = write_results(root / "results", folder, cases())
    return score(folder, answers, results, out=root / "score.html"), root


def test_false_alarms_recall_and_coverage_are_those_worked_out(scored):
    done, _ = scored
    assert counts(done.false_alarms) == (2, 3)  # one named an effect, one failed
    assert counts(done.named_without_cause) == (1, 3)
    assert counts(done.named_rightly) == (5, 7)  # wrong: 1, which has no cause, and 11, whose cause is none of them
    assert counts(done.none_of_these) == (1, 2)
    assert counts(done.none_of_these_visible) == (1, 1)  # 0.5 of the noise cannot be seen
    by_what = {one.what: one for one in done.effects}
    seen = by_what["as the candidate has it, visible"]
    assert (counts(seen.found), counts(seen.top), counts(seen.covered)) == ((2, 2), (1, 2), (2, 2))
    every = by_what["as the candidate has it, all amplitudes"]
    assert (counts(every.found), counts(every.top), counts(every.covered)) == ((2, 3), (1, 3), (2, 3))
    both = by_what["both, visible"]
    assert (counts(both.found), counts(both.top), counts(both.covered)) == ((4, 4), (2, 4), (3, 4))
    assert (counts(done.two.one), counts(done.two.first), counts(done.two.both)) == ((2, 2), (2, 2), (1, 2))
    # right: 0 no gap; 3 and 6 the first effect; 8 and 9 one of two; 10 none of these
    assert counts(done.right) == (6, 12)
    assert done.failures == {"recordings/0002.nc": "SimulationError: it stopped"}


def test_confusion_matrices_count_every_recording(scored):
    done, _ = scored
    strata = dict(zip(done.strata.rows, done.strata.counts, strict=True))
    assert done.strata.columns == ["effect", "ambiguous", "none_of_these", "no_gap", "failed"]
    assert strata == {
        "none": [1, 0, 0, 1, 1], "library": [1, 1, 0, 1, 0], "form": [1, 0, 1, 0, 0], "two": [1, 1, 0, 0, 0],
        "outside": [1, 0, 1, 0, 0],
    }  # fmt: skip
    named = {
        (true, name): n
        for true, row in zip(done.confusion.rows, done.confusion.counts, strict=True)
        for name, n in zip(done.confusion.columns, row, strict=True)
        if n
    }
    assert named == {
        ("a", "a"): 1, ("a", "no gap"): 1, ("a", "none of these"): 1, ("b", "a"): 1, ("b", "b"): 1,
        ("none of these", "none of these"): 1, ("none of these", "c"): 1,
        ("no gap", "no gap"): 1, ("no gap", "a"): 1, ("no gap", "failed"): 1,
    }  # fmt: skip


def test_power_is_counted_in_bins_of_amplitude_and_of_the_sealed_gap(scored):
    done, _ = scored
    # sizes 2, 0.3, 1, 2, 0.6 of one effect; bins below 0.5, to 1, to 2, above
    assert [counts(point.found) for point in done.power_by_size] == [(0, 1), (1, 1), (1, 1), (2, 2)]
    assert [counts(point.top) for point in done.power_by_size] == [(0, 1), (0, 1), (0, 1), (2, 2)]
    # gaps 4, 0.3, 2, 3, 2
    assert [counts(point.found) for point in done.power_by_gap] == [(0, 1), (0, 0), (0, 0), (3, 3), (1, 1), (0, 0)]
    assert done.power_by_gap[-1].high is None


def test_reliability_and_brier(scored):
    done, _ = scored
    first = done.first_statement
    assert sum(one.happened.n for one in first.bins) == 11  # all with a verdict
    # what was said first: 0.9 0.5 0.9 0.9 0.6 1 0.8 0.5 1 0.8 1; what came: 1 0 1 0 0 1 0 1 1 1 0
    p = np.array([0.9, 0.5, 0.9, 0.9, 0.6, 1.0, 0.8, 0.5, 1.0, 0.8, 1.0])
    y = np.array([1, 0, 1, 0, 0, 1, 0, 1, 1, 1, 0])
    assert first.brier.value == pytest.approx(np.mean((p - y) ** 2))
    assert first.reference == pytest.approx(y.mean() * (1 - y.mean()))
    bins = {(one.low, one.high): (one.said, counts(one.happened)) for one in first.bins}
    assert bins[0.4, 0.6] == (pytest.approx(0.5), (1, 2))
    assert bins[0.6, 0.8] == (pytest.approx(0.6), (0, 1))
    assert bins[0.8, 0.95] == (pytest.approx(0.86), (3, 5))
    assert bins[0.95, 1.0] == (pytest.approx(1.0), (2, 3))
    # |sum of said - sum of happened| over bins: |1-1|, |.6-0|, |4.3-3|, |3-2|
    assert first.error.value == pytest.approx((0.0 + 0.6 + 1.3 + 1.0) / 11)
    # all answers, one cause at most: 0.02, 1 + .25 + .25, 1, .02, .81 + .81, .36+.49+.01, 0, .81+.01+.64, .06, 2
    expected = [0.02, 1.5, 1.0, 0.02, 1.62, 0.86, 0.0, 1.46, 0.06, 2.0]
    assert done.brier.n == 10
    assert done.brier.value == pytest.approx(np.mean(expected))


def test_places_are_held_against_the_sealed_gap(scored):
    done, _ = scored
    # visible gaps: 3 (right cell), 5 (air, as large as the room), 6, 7, 8, 9, 10 (no place)
    assert counts(done.where.channel) == (2, 7)
    assert counts(done.where.cell) == (1, 1)
    assert done.where.lift.value == pytest.approx(12.0)  # two hours of twenty-four
    # two-hour cells overlap the gap's when shifted by 0, 1 or 23 h modulo a day: 3 + 4 + 4 of 95 shifts
    assert done.where.chance.value == pytest.approx(11 / 95)


def test_shrinkage_is_held_against_the_oracle(scored):
    done, _ = scored
    by_channel = {one.channel: one for one in done.shrinkage}
    room = by_channel[ROOM]
    # visible in the room with causes of the library: 3, 5 (0.9 each), 6 (named, no figure), 7 (nothing named: 0),
    # 8 and 9 (named, no figure); the structural gap is 0.2, the median
    assert (room.share.n, room.unknown) == (3, 3)
    assert room.share.value == pytest.approx(1.8 / 3)
    oracles = 1 - 0.04 / np.array([16.0, 4.0, 4.0])
    assert room.oracle.value == pytest.approx(oracles.mean())
    assert room.ratio.value == pytest.approx(0.6 / oracles.mean())
    assert room.median.value == pytest.approx(0.9 / oracles[0])  # of 0.9 / .9975, 0.9 / .99 and 0: the middle one
    assert (by_channel[AIR].share.n, by_channel[AIR].unknown) == (0, 2)
    largest = by_channel["where the gap is largest"]
    assert largest.share.n + largest.unknown == 6  # each of these recordings once, with a figure or without
    assert f"{largest.share.n} of 6 have a figure, {largest.unknown} named effects but gave no share" in markdown(done)
    assert (room.least.n, room.least.value) == (6, pytest.approx(1.8 / (oracles.sum() + 3 - 0.04 * (1 / 9 + 2 / 16))))


def test_errors_of_parameters_are_shares_of_their_ranges(scored):
    done, _ = scored
    by_name = {one.parameter: one for one in done.parameters}
    # r: 10 against 1 on a logarithmic range of 1 to 100 is half of it; v: 12 and 11 against 10 on 0 to 20
    assert (by_name["r"].before.value, by_name["r"].after.value) == pytest.approx((0.5, 0.0))
    assert (by_name["v"].before.value, by_name["v"].after.value) == pytest.approx((0.1, 0.05))
    assert by_name["all parameters"].change.value == pytest.approx(-0.275)
    assert by_name["v"].before.n == 2


def test_leave_one_out_counts_both_ways(tmp_path):
    ones = [
        Case("library", ("a",), room=3.0, verdict=said("a", p={"a": 0.9, "b": 0.1}, alike={"a": ["b"]})),
        Case("library", ("a",), room=3.0, verdict=said("a", alike={"a": ["c"]})),
        Case("form", ("b",), room=3.0, verdict=NONE),
        Case("library", ("b",), room=3.0, verdict=said("b")),
        Case("none", truth="no_gap", verdict=QUIET),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    again = [{"a": said("b"), "b": said("a")}, {"a": said("b")}, {}, {"b": None}, {}]
    for k, outcomes in enumerate(again):
        first = read_outcome(results, f"recordings/{k:04}.nc")
        made = {
            name: Outcome(file=first.file, sha256=first.sha256, seconds=1.0, verdict=one, failure="" if one else "x")
            for name, one in outcomes.items()
        }
        write_withheld(results, Withheld(file=first.file, outcomes=made))
    page = tmp_path / "score.html"
    whole = score(folder, answers, results, out=page)
    done = whole.left_out
    # b for a where they are confusable; b for a where they are not; none at once; failed
    assert (done.n, done.again) == (4, 3)
    assert (counts(done.none), counts(done.none_or_alike), counts(done.quiet)) == ((1, 4), (2, 4), (0, 4))
    # a diagnosis that failed is told, not only counted as a wrong answer
    assert (done.failed, whole.left_out_failures) == (1, {"recordings/0003.nc": "x"})
    assert "1 of 4 failed, at first or again, and count as wrong |" in markdown(whole)
    assert "<li>recordings/0003.nc: x</li>" in page.read_text()


@pytest.mark.parametrize("where", ["taken/deep/score.html", "folder"])
def test_a_place_where_no_page_can_be_is_told_before_anything_is_opened(tmp_path, monkeypatch, where):
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "folder").mkdir()
    monkeypatch.setattr("diagnosis.blind.scoring.open_answers", lambda *_: pytest.fail("the answers were opened"))
    folder, answers = write_set(tmp_path / "set", cases()[:1])
    results = write_results(tmp_path / "results", folder, cases()[:1])
    with pytest.raises(
        RecordingError, match=r"taken is a file; expected a folder|folder: is a folder; expected a name"
    ):
        score(folder, answers, results, out=tmp_path / where)


def test_what_was_withheld_from_the_library_is_none_of_these(tmp_path):
    ones = [
        Case("library", ("a",), room=3.0, verdict=NONE),
        Case("form", ("a",), room=3.0, verdict=said("b")),
        Case("two", ("a", "b"), room=3.0, verdict=said("b")),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones, library=("b", "c"), without=("a",))
    done = score(folder, answers, results)
    assert counts(done.none_of_these) == (1, 2)
    assert dict(zip(done.strata.rows, done.strata.counts, strict=True))["withheld"] == [1, 0, 1, 0, 0]
    assert counts(done.right) == (2, 3)  # b is what is left of a and b


def test_what_the_diagnosis_declared_it_would_see_is_scored_by_itself(tmp_path):
    ones = [
        Case("library", ("a",), sizes=(1.0,), room=3.0, verdict=said("a", smallest={"a": 2.9})),
        Case("library", ("a",), sizes=(1.0,), room=3.0, verdict=said("b", smallest={"a": 3.0})),  # 3 in its unit
        Case("library", ("a",), sizes=(1.0,), room=3.0, verdict=said("b", smallest={"a": 3.1})),
        Case("library", ("a",), sizes=(1.0,), room=3.0, verdict=said("a", smallest={"a": None})),
        Case("form", ("a",), sizes=(2.0,), room=3.0, verdict=said("a", smallest={"a": 0.1})),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    done = score(folder, answers, write_results(tmp_path / "results", folder, ones))
    assert counts(done.declared.top) == (1, 2)


def test_page_json_and_markdown_say_the_same(scored):
    done, root = scored
    assert read_score(root / "score.json") == done
    text = (root / "score.md").read_text()
    assert text == markdown(done) + "\n"
    assert "| false alarms without any effect | 67% (21% to 94%; 2 of 3) | at most 5 % |" in text
    assert "diagnosis blind make set --system Hand/system.toml --recordings 12 --seed 7 --hours 96" in text
    page = (root / "score.html").read_text()
    assert "67% (21% to 94%; 2 of 3)" in page
    assert "http" not in page.replace("http-equiv", "")  # nothing is loaded from elsewhere
    pictures = [part.split('"')[0] for part in page.split("data:image/png;base64,")[1:]]
    assert len(pictures) == 6
    assert all(base64.b64decode(one)[:4] == b"\x89PNG" for one in pictures)


def test_verdicts_of_another_set_and_incomplete_ones_are_refused(scored, tmp_path):
    _, root = scored
    folder, answers = write_set(tmp_path / "set", cases()[:2], seed=8)
    with pytest.raises(RecordingError, match="is a run of another set"):
        score(folder, answers, root / "results")
    results = write_results(tmp_path / "results", folder, cases()[:2])
    (results / "verdicts" / "0001.json").unlink()
    with pytest.raises(RecordingError, match=r"0001\.json: no such file; expected a file of `diagnosis blind run`"):
        score(folder, answers, results)
    (results / "verdicts" / "0001.json").write_text('{"schema": "blind-verdict-1", "file": 3}')
    with pytest.raises(RecordingError, match=r"0001\.json: file: .* \(found 3\)"):
        score(folder, answers, results)


def test_a_run_that_was_stopped_is_scored_as_far_as_it_came(scored, tmp_path):
    folder, answers = write_set(tmp_path / "set", cases())
    results = write_results(tmp_path / "results", folder, cases())
    for verdict in sorted((results / "verdicts").glob("*.json"))[5:]:
        verdict.unlink()
    done = score(folder, answers, results, first=5, out=tmp_path / "score.html")
    assert (done.recordings, done.planned) == (5, 12)
    assert counts(done.false_alarms) == (2, 3)
    assert counts(done.right) == (2, 5)
    text = (tmp_path / "score.md").read_text()
    assert text.startswith("the first 5 of 12 recordings of 96 h, seed 7")
    assert "score.html --seed 0 --first 5" in text
    assert "the first 5 of 12 recordings" in (tmp_path / "score.html").read_text()
    for wrong in (0, 13):
        with pytest.raises(RecordingError, match=rf"first is {wrong}; .* holds 12 recordings; expected 1 to 12"):
            score(folder, answers, results, first=wrong)


OPENED = """
import json, sys
opened = []
sys.addaudithook(lambda name, args: opened.append(str(args[0])) if name == "open" else None)
from diagnosis.blind.scoring import score
score(*sys.argv[1:4])
print(json.dumps({"opened": opened, "modules": list(sys.modules)}))
"""


def test_a_score_sees_verdicts_and_answers_and_no_more(scored):
    """Of the results it opens the verdict files alone, whatever lies beside them; and no diagnosis is loaded."""
    done, root = scored
    for decoy in ("report.html", "verdicts/0000.npz", "residuals.nc"):
        (root / "results" / decoy).write_text("not to be read")
    paths = [str(root / "set"), str(root / "set.answers.json"), str(root / "results")]
    made = subprocess.run([sys.executable, "-c", OPENED, *paths], capture_output=True, text=True, check=True)
    found = json.loads(made.stdout.splitlines()[-1])
    inside = {Path(one).relative_to(root).as_posix() for one in found["opened"] if one.startswith(str(root))}
    recordings = {f"set/recordings/{k:04}.nc" for k in range(12)}
    verdicts = {f"results/verdicts/{k:04}.json" for k in range(12)}
    assert inside == {"set/manifest.json", "set.answers.json", "results/run.json", *recordings, *verdicts}
    assert not [name for name in found["modules"] if name.startswith(("diagnosis.gap", "diagnosis.blind.running"))]
    assert done.recordings == 12
