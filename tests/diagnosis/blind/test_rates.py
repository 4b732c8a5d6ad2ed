"""How often what was said with a probability was so, and how sure that is."""

from itertools import combinations

import numpy as np
import pytest

from diagnosis.blind.opened import Row
from diagnosis.blind.rates import Figure, _reliability, by_chance, figure, names, share, wilson
from diagnosis.blind.score_report import by_chance as said_by_chance
from diagnosis.blind.score_report import by_size, markdown, number
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Moved, Outcome, Sized, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set


def test_intervals_are_wilsons_and_the_bootstraps():
    one = share([True, False])
    # by hand: n = 2, p = 1/2, z = 1.959964
    z2 = 1.959964**2
    half = 1.959964 * np.sqrt(0.25 / 2 + z2 / 16) / (1 + z2 / 2)
    assert (one.low, one.high) == pytest.approx((0.5 - half, 0.5 + half), abs=1e-6)
    assert one.low == pytest.approx(0.0945, abs=1e-4)
    assert share([]).value is None
    found = figure(np.random.default_rng(0).standard_normal(400), seed=1)
    assert found.high - found.low == pytest.approx(2 * 1.96 / 20, rel=0.1)


@pytest.mark.parametrize(("hits", "n"), [(0, 3), (7, 20)])
def test_wilsons_interval_is_that_of_scipy(hits, n):
    one = share([True] * hits + [False] * (n - hits))
    assert wilson(hits / n, n) == pytest.approx((one.low, one.high), abs=1e-12)


def test_one_recording_does_not_say_how_others_would_be():
    one = figure(np.array([0.8]))
    assert one == Figure(n=1, value=0.8, low=None, high=None)
    assert (number(one), said_by_chance(one)) == ("0.8 (n = 1)", "80% (0.8 of 1)")
    two = figure(np.array([0.8, 0.4]))
    assert (two.low, two.high) == (0.4, 0.8)


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


def scored(tmp_path, cases):
    folder, answers = write_set(tmp_path / "set", cases)
    done = score(folder, answers, write_results(tmp_path / "results", folder, cases))
    return {one.what: one for one in done.held}


def moved(r, v, after=True):
    """Parameters r and v as (value, low, high), with the effect or without."""
    kind = "after" if after else "before"
    found = {}
    for name, (value, low, high) in {"r": r, "v": v}.items():
        told = {kind: value, f"{kind}_low": low, f"{kind}_high": high}
        found[name] = Moved(**{"before": value, **told})
    return found


def named(name, size, parameters):
    return Verdict(
        verdict="effect", named=[name], probabilities={name: 0.9}, parameters=parameters,
        sizes={name: Sized(value=size[0], low=size[1], high=size[2])},
    )  # fmt: skip


def test_shares_and_errors_are_those_worked_out(tmp_path):
    # the truth: r = 1, v = 10, amplitudes of 3 times the size
    good = moved((1.0, 0.5, 2.0), (10.0, 9.0, 11.0))
    off = moved((10.0, 1.0, 100.0), (14.0, 12.0, 16.0))  # r on its end, one half-width off; v two half-widths off
    found = scored(
        tmp_path,
        [
            Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=named("a", (6.0, 5.0, 7.0), good)),
            Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=named("a", (4.0, 3.0, 5.0), off)),
            # another law has an amplitude of its own, a wrong effect none at all
            Case("form", ("a",), sizes=(2.0,), room=4.0, verdict=named("a", (1.0, 0.9, 1.1), good), replay=True),
            Case("library", ("b",), sizes=(2.0,), room=4.0, verdict=named("a", (6.0, 5.0, 7.0), off)),
            Case(
                "none", truth="no_gap",
                verdict=Verdict(verdict="no_gap", parameters=moved((1.0, 0.5, 2.0), (12.0, 11.0, 13.0), after=False)),
            ),
        ],
    )  # fmt: skip
    size = found["size of an effect of the library that was rightly named"]
    assert (size.held.value, size.held.n) == (0.5, 2)  # 5 to 7 holds 6, 3 to 5 does not
    assert size.error.value == pytest.approx(np.sqrt((0 + (2 * 1.645) ** 2) / 2))
    after = found["parameters: a true cause in the answer, after what was chosen is added"]
    assert after.held.n == 3
    assert after.held.value == pytest.approx((1 + 0.5 + 1) / 3)
    assert after.error.value == pytest.approx(1.645 * np.sqrt((0 + (1**2 + 2**2) / 2 + 0) / 3))
    assert {name: (one.hits, one.n) for name, one in after.by_parameter.items()} == {"r": (3, 3), "v": (2, 3)}
    assert found["parameters: the same, in replay"].held.n == 1
    assert found["parameters: only wrong causes named, after they are added"].held.value == 0.5
    quiet = found["parameters: no gap found, and no effect there"]
    assert (quiet.held.value, quiet.held.n) == (0.5, 1)
    assert (
        found["parameters: a true cause in the answer, before what was chosen is added"].held.n == 0
    )  # no interval was stated


def test_intervals_of_a_normal_posterior_are_honest(tmp_path):
    rng = np.random.default_rng(0)
    cases = []
    for _ in range(400):
        size = 6.0 + rng.standard_normal()
        r, v = np.exp(0.3 * rng.standard_normal()), 10.0 + 2.0 * rng.standard_normal()
        spread = np.exp(0.3 * 1.645)
        told = moved((r, r / spread, r * spread), (v, v - 3.29, v + 3.29))
        cases.append(
            Case("library", ("a",), sizes=(2.0,), room=4.0,
                 verdict=named("a", (size, size - 1.645, size + 1.645), told))
        )  # fmt: skip
    for one in scored(tmp_path, cases).values():
        if one.held.n:
            assert one.held.value == pytest.approx(0.9, abs=0.05)
            assert one.error.value == pytest.approx(1.0, abs=0.1)


def test_an_answer_whose_fit_was_of_another_cause_is_told_apart(tmp_path):
    """Of a set that cannot be told apart another member than the true one may have been fitted."""
    good, off = moved((1.0, 0.5, 2.0), (10.0, 9.0, 11.0)), moved((10.0, 1.0, 5.0), (14.0, 12.0, 16.0))
    either = named("a", (6.0, 5.0, 7.0), off).model_copy(update={"named": ["a", "b"], "chosen": ["b"]})
    true = named("a", (6.0, 5.0, 7.0), good).model_copy(update={"chosen": ["a"]})
    found = scored(tmp_path, [Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=one) for one in (either, true)])
    assert found["parameters: a true cause in the answer, after what was chosen is added"].held.n == 2
    only = found["parameters: the same, nothing but true causes added"].held
    assert (only.value, only.n) == (1.0, 1)


@pytest.mark.parametrize("times", [1, 10])
def test_statements_about_one_recording_count_as_one_when_it_is_said_how_sure_a_frequency_is(times):
    """Twenty recordings, of which each says the same thing once or ten times: nothing more is known."""
    said = [[(0.3, k % 2 == 0)] * times for k in range(20)]
    (found,) = (one.happened for one in _reliability(said, 0).bins if one.happened.n)
    once = share([k % 2 == 0 for k in range(20)])
    assert (found.n, found.value) == (20 * times, 0.5)
    assert found.low == pytest.approx(once.low, abs=0.06)
    assert found.high == pytest.approx(once.high, abs=0.06)


def test_intervals_of_a_frequency_hold_it_where_few_recordings_all_say_alike():
    """Four statements of each recording, all of them true or none: the interval of 95 % holds the true frequency."""
    recordings = 5
    rng, held = np.random.default_rng(0), 0
    for seed in range(60):
        said = [[(0.1, bool(so))] * 4 for so in rng.random(recordings) < 0.1]
        (found,) = (one.happened for one in _reliability(said, seed).bins if one.happened.n)
        held += found.low <= 0.1 <= found.high
    assert held >= 54  # of 57 expected
