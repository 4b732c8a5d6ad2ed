"""Scores of verdicts that were made by hand, against figures that were worked out by hand."""

import base64
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from diagnosis.blind.score_report import markdown
from diagnosis.blind.scored import Score
from diagnosis.blind.scoring import counted, score
from diagnosis.blind.verdicts import (
    Moved,
    Outcome,
    Place,
    Shrunk,
    Sized,
    Verdict,
    Withheld,
    read_outcome,
    write_withheld,
)
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import AIR, QUIET, ROOM, Case, said, write_results, write_set

NONE = Verdict(verdict="none_of_these", probabilities={"a": 0.1, "b": 0.1}, none=0.8, nothing=0.0)
LONG, SHORT = 20.0, 2.0
"""Lengths beyond imitation of gaps that can be seen, and that cannot."""


def cases():
    """Twelve recordings; in the room those without an effect have gaps of 0.2 in the median."""
    moved = {
        "r": Moved(before_low=8.0, before_high=9.5, after_low=0.9, after_high=1.2),
        "v": Moved(before_low=9.0, before_high=13.0, after_low=11.0, after_high=13.0),
    }
    shrunk = {ROOM: Shrunk(share=0.9), AIR: Shrunk(share=None)}
    whole = {"shrinkage": shrunk, "parameters": moved}
    small, large = Sized(low=4.0, high=5.5), Sized(low=4.0, high=6.5)
    return [
        Case("none", truth="no_gap", room=0.4, length=1.0, verdict=QUIET.model_copy(update={"parameters": moved})),
        Case("none", truth="no_gap", room=0.2, length=1.0, verdict=said("a", p={"a": 0.5}, none=0.5)),
        Case("none", truth="no_gap", room=0.2, length=1.0, verdict=None),
        Case("library", ("a",), sizes=(2.0,), room=4.0, length=LONG,
             verdict=said("a", p={"a": 0.9, "b": 0.1}, where=[Place(channel=ROOM)],
                          sizes={"a": large}, **whole)),
        Case("library", ("a",), sizes=(0.3,), room=0.3, length=SHORT, verdict=QUIET),
        Case("library", ("b",), sizes=(2.0,), room=2.0, length=LONG,
             verdict=said("a", "b", p={"a": 0.6, "b": 0.3}, none=0.1, sizes={"a": large, "b": small}, **whole,
                          where=[Place(channel=ROOM, kind="source")])),
        Case("form", ("b",), room=3.0, length=LONG, replay=True, verdict=said("b")),
        Case("form", ("a",), room=2.0, length=LONG, verdict=NONE),
        Case("two", ("a", "b"), room=4.0, length=LONG, verdict=said("a", "b")),
        Case("two", ("a", "c"), room=4.0, length=LONG, verdict=said("b")),
        Case("outside", truth="none_of_these", room=3.0, length=LONG, verdict=NONE),
        Case("outside", truth="none_of_these", room=0.5, length=SHORT, verdict=said("c")),
    ]  # fmt: skip


def written(root, ones, **run):
    """Set, answers and results of cases."""
    folder, answers = write_set(root / "set", ones)
    return folder, answers, write_results(root / "results", folder, ones, **run)


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    root = tmp_path_factory.mktemp("scored")
    return score(*written(root, cases()), out=root / "score.html"), root


def line(done, *words):
    (found,) = [one for one in done.lines if all(word in one.what for word in words)]
    return found


def test_alarms_and_answers_are_those_worked_out(scored):
    done, _ = scored
    counts = {
        ("gaps answered",): (2, 3),  # one named an effect, one failed
        ("of the library",): (2, 2),
        ("named first",): (1, 2),
        ("by another law",): (1, 2),
        ("controllers simulated",): (3, 6),  # right: 3, 5, 8; wrong: 1, which has no cause, 9, and 11
        ("in replay",): (1, 1),
        ("no candidate describes",): (1, 1),  # the other cannot be seen
        ("two effects",): (1, 2),
        ("first place",): (1, 7),  # 3; the place of 5 is a missing source
        ("size that cover",): (1, 2),  # 6.0 is within that of 3, not of 5; a is no cause of 5
        ("withheld",): (0, 0),
    }
    assert {words: (line(done, *words).hits, line(done, *words).n) for words in counts} == counts
    assert done.failures == {"recordings/0002.nc": "SimulationError: it stopped"}
    assert done.answers == {
        "form": {"effect": 1, "ambiguous": 0, "none_of_these": 1, "no_gap": 0, "failed": 0},
        "library": {"effect": 1, "ambiguous": 1, "none_of_these": 0, "no_gap": 1, "failed": 0},
        "none": {"effect": 1, "ambiguous": 0, "none_of_these": 0, "no_gap": 1, "failed": 1},
        "outside": {"effect": 1, "ambiguous": 0, "none_of_these": 1, "no_gap": 0, "failed": 0},
        "two": {"effect": 1, "ambiguous": 1, "none_of_these": 0, "no_gap": 0, "failed": 0},
    }


def test_figures_are_those_worked_out(scored):
    done, _ = scored
    assert line(done, "median [s]").value is None  # the hand's outcomes do not know
    assert line(done, "names in an answer").value == 1.0  # 1, 1, 2, 1, 2, 1, 1
    # 0.9 of 3 and 5, nothing of 7, where none was named; 6, 8 and 9 gave no share
    oracles = 1 - 0.04 / np.array([16.0, 4.0, 4.0])
    removed = line(done, "removed")
    assert (removed.n, removed.value) == (3, pytest.approx(0.6 / oracles.mean()))
    assert removed.low < removed.value < removed.high
    # r is 1 and v 10: after what was named is added r alone is covered, in both; before, v alone
    after, quiet = line(done, "a true cause named"), line(done, "no gap answered")
    assert (after.n, after.value, quiet.n, quiet.value, quiet.low) == (2, 0.5, 1, 0.5, None)


def test_intervals_are_wilsons(scored):
    for hits, n in ((0, 3), (7, 20), (5, 5)):
        one = counted("x", [True] * hits + [False] * (n - hits))
        assert (one.low, one.high) == pytest.approx(tuple(binomtest(hits, n).proportion_ci(method="wilson")), abs=1e-9)
    assert counted("x", []).value is None


def test_probabilities_are_held_against_what_is_true(scored):
    done, _ = scored
    bins = {(one.what, one.low): (one.said, one.true.hits, one.true.n) for one in done.reliability}
    # the foremost was said with 0.1 0.5 0.9 0.1 0.6 1 0.1 0.5 1 0.1 1, and was true in 3 (0.9), 4 (0.1), 6 (1), 7, 8
    assert bins["the foremost candidate", 0.8] == (pytest.approx((0.9 + 1 + 1 + 1) / 4), 2, 4)
    assert bins["the foremost candidate", 0.4] == (pytest.approx(0.5), 1, 2)
    assert bins["none of these", 0.8] == (pytest.approx(0.8), 1, 2)
    assert bins["no gap", 0.8] == (pytest.approx(0.9), 1, 2)


def test_what_can_be_seen_is_that_of_the_whole_set_however_few_recordings_are_scored(tmp_path):
    """Twenty-five walls, the largest first: of the first five the largest is the limit, of all the second largest."""
    walls = [Case("none", truth="no_gap", room=3.0, length=length, verdict=QUIET) for length in [3.0] + [0.5] * 24]
    between = [Case("library", ("a",), room=2.0, length=6.0, verdict=said("a")) for _ in range(2)]
    ones = [*walls[:4], *between, *walls[4:]]
    folder, answers, results = written(tmp_path, ones)
    for first, expected in ((5, 1), (6, 2), (None, 2)):
        assert line(score(folder, answers, results, first=first), "of the library").n == expected


def test_an_effect_that_is_withheld_is_none_of_these(tmp_path):
    ones = [
        Case("library", ("a",), room=3.0, length=LONG, verdict=said("a", p={"a": 0.9, "b": 0.1})),
        Case("library", ("a",), room=3.0, length=LONG, verdict=said("a")),
        Case("form", ("b",), room=3.0, length=LONG, verdict=NONE),
        Case("library", ("b",), room=3.0, length=LONG, verdict=said("b")),
        Case("none", truth="no_gap", length=1.0, verdict=QUIET),
    ]
    folder, answers, results = written(tmp_path, ones)
    for k, outcomes in enumerate([{"a": NONE, "b": said("a")}, {"a": said("b")}, {}, {"b": None}, {}]):
        first = read_outcome(results, f"recordings/{k:04}.nc")
        made = {
            name: Outcome(file=first.file, sha256=first.sha256, seconds=1.0, verdict=one, failure="" if one else "x")
            for name, one in outcomes.items()
        }
        write_withheld(results, Withheld(file=first.file, outcomes=made))
    page = tmp_path / "score.html"
    done = score(folder, answers, results, out=page)
    # none; b for a; none at once; failed
    assert (line(done, "withheld").hits, line(done, "withheld").n) == (2, 4)
    assert done.left_out_failures == {"recordings/0003.nc": "x"}
    assert "<li>recordings/0003.nc: x</li>" in page.read_text()


def test_what_was_withheld_from_the_whole_run_is_none_of_these(tmp_path):
    ones = [
        Case("none", truth="no_gap", length=1.0, verdict=QUIET),
        Case("library", ("a",), room=3.0, length=LONG, verdict=NONE),
        Case("form", ("a",), room=3.0, length=LONG, verdict=said("b")),
        Case("two", ("a", "b"), room=3.0, length=LONG, verdict=said("b")),
    ]
    folder, answers, results = written(tmp_path, ones, library=("b", "c"), without=("a",))
    done = score(folder, answers, results)
    assert (line(done, "no candidate describes").hits, line(done, "no candidate describes").n) == (1, 2)
    assert done.answers["withheld"]["effect"] == done.answers["withheld"]["none_of_these"] == 1
    assert (line(done, "two effects").hits, line(done, "named first").n) == (1, 0)  # b is what is left of a and b


def test_page_json_and_markdown_say_the_same(scored):
    done, root = scored
    assert Score.model_validate_json((root / "score.json").read_text()) == done
    text = (root / "score.md").read_text()
    assert text == markdown(done) + "\n"
    assert "| gaps answered where there is no cause | 67% (2 of 3, 21% to 94%) | at most 4% |" in text
    assert "diagnosis blind make set --system Hand/system.toml --recordings 12 --seed 7 --hours 96" in text
    page = (root / "score.html").read_text()
    assert "67% (2 of 3, 21% to 94%)" in page
    assert "http" not in page.replace("http-equiv", "")  # nothing is loaded from elsewhere
    (picture,) = [part.split('"')[0] for part in page.split("data:image/png;base64,")[1:]]
    assert base64.b64decode(picture)[:4] == b"\x89PNG"


@pytest.mark.parametrize("where", ["taken/deep/score.html", "folder"])
def test_a_place_where_no_page_can_be_is_told_before_anything_is_opened(tmp_path, monkeypatch, where):
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "folder").mkdir()
    monkeypatch.setattr("diagnosis.blind.scoring.open_answers", lambda *_: pytest.fail("the answers were opened"))
    folder, answers, results = written(tmp_path, cases()[:1])
    expected = r"taken is a file; expected a folder|folder: is a folder; expected a name"
    with pytest.raises(RecordingError, match=expected):
        score(folder, answers, results, out=tmp_path / where)


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
    folder, answers, results = written(tmp_path, cases())
    for verdict in sorted((results / "verdicts").glob("*.json"))[5:]:
        verdict.unlink()
    done = score(folder, answers, results, first=5, out=tmp_path / "score.html")
    assert (done.recordings, done.planned, line(done, "gaps answered").hits) == (5, 12, 2)
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
