"""How many effects answers name, and what chance makes of as many."""

from itertools import combinations

import pytest

from diagnosis.blind.opened import Row
from diagnosis.blind.rates import by_chance, names
from diagnosis.blind.score_report import by_size, markdown
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Outcome, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set

LIBRARY = tuple("abcdefgh")


def said(*named, candidates=LIBRARY):
    word = "effect" if len(named) == 1 else "ambiguous"
    return Verdict(verdict=word, probabilities={name: 1 / len(candidates) for name in candidates}, named=list(named))


def row(named, effects, candidates=LIBRARY):
    verdict = said(*named, candidates=candidates) if named else Verdict(verdict="no_gap")
    truth = "effect" if effects else "no_gap"
    return Row({}, Outcome(file="x", sha256="", seconds=1.0, verdict=verdict), "", truth, tuple(effects), None)


@pytest.mark.parametrize(
    ("named", "effects", "candidates"),
    [("abc", "ah", "abcdefgh"), ("ab", "h", "abcd")],
)
def test_chance_is_the_share_of_all_answers_of_that_length(named, effects, candidates):
    """The last cause but one is none of the recording's candidates, so that no answer of any length would hold it."""
    drawn = [bool(set(one) & set(effects)) for one in combinations(candidates, len(named))]
    assert by_chance(row(named, effects, candidates)) == pytest.approx(sum(drawn) / len(drawn))


def test_answers_are_counted_by_how_many_effects_they_name():
    found = names([row("a", "a"), row("b", "a"), row("abc", "a"), row("abcdefgh", ""), row("", "a")])
    assert (found.median.value, found.nine_in_ten.value, found.largest) == (2.0, 8.0, 8)
    assert [(one.held.hits, one.held.n) for one in found.by_size] == [(2, 4), (1, 2), (1, 1), (0, 1)]
    assert [one.chance.value for one in found.by_size] == pytest.approx([(1 / 8 + 1 / 8 + 3 / 8) / 4, 1 / 8, 3 / 8, 0])
    assert [what for what, _, _ in by_size(found)] == ["any number", "1", "2 to 4", "5 or more"]


def test_an_answer_that_names_the_whole_library_covers_more_and_so_would_chance(tmp_path):
    scored = []
    for name, first in (("short", said("b")), ("long", said(*LIBRARY))):
        ones = [Case("library", ("a",), room=3.0, verdict=one) for one in (first, said("a"))]
        folder, answers = write_set(tmp_path / name, ones)
        results = write_results(tmp_path / f"{name}.results", folder, ones, library=LIBRARY)
        scored.append(score(folder, answers, results, out=tmp_path / f"{name}.html"))
    short, long = scored
    assert (short.effects[0].covered.hits, long.effects[0].covered.hits) == (1, 2)
    assert short.names.by_size[0].chance.value == pytest.approx(1 / 8)
    assert long.names.by_size[0].chance.value == pytest.approx((1 + 1 / 8) / 2)
    assert "| 5 or more | 100% (21% to 100%; 1 of 1) | 100% (1.0 of 1) |" in markdown(long)
    assert "<td>100% (1.0 of 1)</td>" in (tmp_path / "long.html").read_text()
    assert long.schema_version == 9
