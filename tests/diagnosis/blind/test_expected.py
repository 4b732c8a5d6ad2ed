"""What can be expected of verdicts, against lengths that were put into the sealed answers by hand."""

from diagnosis.blind.expected import Expected
from diagnosis.blind.opened import Row
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Outcome, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set

LIBRARY = ("a", "b", "c")
NAMED = Verdict(verdict="effect", probabilities={"a": 1.0}, named=["a"])
NONE = Verdict(verdict="none_of_these", none=1.0)


def row(truth, length, beside=None, effects=(), replay=False):
    sealed = None if length is None else {"length": length, "beside": beside or {}}
    answer = {"verdict": truth, "replay": replay, "detectability": sealed}
    return Row(answer, Outcome(file="x", sha256="", seconds=0.0), "library", truth, tuple(effects), 1.0)


def test_walls_of_the_same_actuators_are_added():
    nothing = [row("no_gap", 2.0), row("no_gap", 3.0), row("no_gap", 9.0, replay=True)]
    expected = Expected([one.answer for one in nothing], LIBRARY)
    least = 3.0 + expected.needed
    assert expected.detectable(row("effect", least + 0.01, effects=["a"]))
    assert not expected.detectable(row("effect", least - 0.01, effects=["a"]))
    assert not expected.detectable(row("effect", least + 0.01, effects=["a"], replay=True))
    assert not expected.detectable(nothing[2])  # nothing is there to be seen
    assert not expected.detectable(row("effect", None, effects=["a"]))  # a set without sealed lengths


def test_a_score_counts_them_apart(tmp_path):
    ones = [
        Case("none", truth="no_gap", length=1.0),
        Case("library", ("a",), length=20.0, beside={"a": 0.0, "b": 20.0, "c": 20.0}, verdict=NAMED, room=4.0),
        Case("library", ("a",), length=2.0, beside={"a": 0.0, "b": 2.0, "c": 2.0}, room=4.0),
        Case("form", ("b",), length=20.0, beside={"a": 1.0, "b": 8.0, "c": 20.0}, verdict=NAMED, room=4.0),
        Case("two", ("a", "b"), length=20.0, verdict=NAMED, room=4.0),
        Case("outside", truth="none_of_these", length=20.0, beside={"a": 19.0, "b": 19.0, "c": 19.0}, verdict=NONE),
        Case("outside", truth="none_of_these", length=20.0, beside={"a": 1.0, "b": 19.0, "c": 19.0}, verdict=NAMED),
    ]  # fmt: skip
    folder, answers = write_set(tmp_path / "set", ones)
    done = score(folder, answers, write_results(tmp_path / "results", folder, ones), out=tmp_path / "score.html")
    plain, form, both, apart, kind = ((one.top.hits, one.top.n) for one in done.detectable)
    assert (plain, form, both, apart, kind) == ((1, 1), (0, 1), (1, 2), (1, 1), (0, 1))
    assert (done.none_of_these_unlike.hits, done.none_of_these_unlike.n) == (1, 1)
    assert (done.two_detectable.one.n, done.two_detectable.both.hits) == (1, 0)
    # the bin from 0 to 4 has the silent one, that from 16 to 32 the two that were answered
    assert [(one.found.hits, one.found.n) for one in done.power_by_length] == [(0, 1), (0, 0), (0, 0), (2, 2), (0, 0)]
    assert "at least 90 %" in (tmp_path / "score.md").read_text()
