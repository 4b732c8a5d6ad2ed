"""Whether stated intervals hold the truth: worked out by hand, and honest ones of a normal posterior."""

import numpy as np
import pytest

from diagnosis.blind.intervals import share
from diagnosis.blind.opened import Row
from diagnosis.blind.score_report import held, percent
from diagnosis.blind.score_schema import Score, read_score
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Moved, Outcome, Sized, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set


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


def test_a_plain_share_of_recordings_has_the_interval_of_every_other_share(tmp_path):
    """A recording has one size, and several parameters: of the first it is a share, of the second a mean of shares."""
    sizes = [(6.0, 5.0, 7.0)] * 11 + [(4.0, 3.0, 5.0)] * 4
    told = moved((1.0, 0.5, 2.0), (14.0, 12.0, 16.0))
    ones = [Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=named("a", size, told)) for size in sizes]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    done = score(folder, answers, results, out=tmp_path / "score.html")
    size, *parameters = done.held
    assert size.held == share([True] * 11 + [False] * 4)
    assert held(done)[0][1] == percent(size.held) == "73% (48% to 89%; 11 of 15)"
    assert "73% (48% to 89%; 11 of 15)" in (tmp_path / "score.html").read_text()
    after = next(one for one in parameters if "after what was chosen" in one.what).held
    assert (after.n, after.value, after.low, after.high) == (15, 0.5, 0.5, 0.5)
    read = read_score(tmp_path / "score.json")
    assert isinstance(read, Score) and read == done


def test_verdicts_without_intervals_are_not_counted(tmp_path):
    told = {"r": Moved(before=1.0, after=1.0), "v": Moved(before=10.0, after=10.0)}
    verdict = Verdict(verdict="effect", named=["a"], probabilities={"a": 0.9}, parameters=told)
    found = scored(tmp_path, [Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=verdict)])
    assert all(one.held.n == 0 for one in found.values())


def test_another_law_s_amplitude_is_no_size_of_its_candidate():
    """0.05 kg/s of a power law at 4 m/s are not 0.05 kg/m of a straight line."""
    causes = [
        {"effect": "wind", "form": "power law", "amplitude": 0.05, "unit": "kg/s"},
        {"effect": "clock", "form": "", "amplitude": -0.5, "unit": "h"},
    ]
    verdict = Verdict(verdict="no_gap", probabilities={}, none=0.5, nothing=0.5)
    outcome = Outcome(file="0000.nc", sha256="", seconds=1.0, verdict=verdict)
    assert Row({"causes": causes}, outcome, "two", "effect", ("wind", "clock"), 1.0).true_sizes == {"clock": -0.5}


def test_an_answer_whose_fit_was_of_another_cause_is_told_apart(tmp_path):
    """Of a set that cannot be told apart another member than the true one may have been fitted."""
    good, off = moved((1.0, 0.5, 2.0), (10.0, 9.0, 11.0)), moved((10.0, 1.0, 5.0), (14.0, 12.0, 16.0))
    either = named("a", (6.0, 5.0, 7.0), off).model_copy(update={"named": ["a", "b"], "chosen": ["b"]})
    true = named("a", (6.0, 5.0, 7.0), good).model_copy(update={"chosen": ["a"]})
    found = scored(tmp_path, [Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=one) for one in (either, true)])
    assert found["parameters: a true cause in the answer, after what was chosen is added"].held.n == 2
    only = found["parameters: the same, nothing but true causes added"].held
    assert (only.value, only.n) == (1.0, 1)
