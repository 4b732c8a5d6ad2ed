"""Whether stated intervals hold the truth: worked out by hand, and honest ones of a normal posterior."""

import numpy as np
import pytest

from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Moved, Sized, Verdict
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


def test_an_answer_whose_fit_was_of_another_cause_is_told_apart(tmp_path):
    """Of a set that cannot be told apart another member than the true one may have been fitted."""
    good, off = moved((1.0, 0.5, 2.0), (10.0, 9.0, 11.0)), moved((10.0, 1.0, 5.0), (14.0, 12.0, 16.0))
    either = named("a", (6.0, 5.0, 7.0), off).model_copy(update={"named": ["a", "b"], "chosen": ["b"]})
    true = named("a", (6.0, 5.0, 7.0), good).model_copy(update={"chosen": ["a"]})
    found = scored(tmp_path, [Case("library", ("a",), sizes=(2.0,), room=4.0, verdict=one) for one in (either, true)])
    assert found["parameters: a true cause in the answer, after what was chosen is added"].held.n == 2
    only = found["parameters: the same, nothing but true causes added"].held
    assert (only.value, only.n) == (1.0, 1)
