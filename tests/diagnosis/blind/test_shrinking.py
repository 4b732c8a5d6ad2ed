"""Shares of the gap removed, beside an oracle's."""

from types import SimpleNamespace

import pytest

from diagnosis.blind.score_report import against_oracle, bound, number
from diagnosis.blind.shrinking import WORST, removed, where_largest


@pytest.mark.parametrize(("share", "counted"), [(0.6, 0.6), (1.33, 1.0), (-9.0, WORST)])
def test_a_share_above_one_is_all_of_the_gap_and_makes_up_for_no_other(share, counted):
    verdict = SimpleNamespace(shrinkage={"room": SimpleNamespace(share=share)})
    row = SimpleNamespace(
        truth="effect", visible=["room"], gap={"room": 2.0}, named=("one",), answer={"replay": False},
        outcome=SimpleNamespace(verdict=verdict),
    )  # fmt: skip
    (found,), lost, unseen = removed([row], {(False, "room"): 1.0})
    assert found.share == counted and found.oracle == pytest.approx(0.75) and not lost and not unseen


def test_recordings_without_a_figure_are_told_and_what_they_could_make_of_it():
    """Named without a share, named nothing (which counts as nothing removed), and a gap that no channel shows."""
    given = SimpleNamespace(shrinkage={"room": SimpleNamespace(share=0.6)})
    silent = SimpleNamespace(shrinkage={"room": SimpleNamespace(share=None)})
    common = {"truth": "effect", "visible": ["room"], "gap": {"room": 2.0}, "answer": {"replay": False}}
    rows = [
        SimpleNamespace(**common | {"named": named, "outcome": SimpleNamespace(verdict=verdict)} | more)
        for named, verdict, more in (
            (("one",), given, {}),
            ((), silent, {}),
            (("one",), silent, {}),
            (("one",), given, {"visible": [], "gap": {"air": 0.5, "room": 1.25}}),
            (("one",), given, {"visible": [], "gap": {"air": 0.5, "room": 0.9}}),  # no more than walls make
            (("one",), given, {"truth": "none_of_these", "visible": []}),
        )
    ]
    limits = {(False, "room"): 1.0, (False, "air"): 0.0}
    done = where_largest(*removed(rows, limits))
    assert (done.share.n, done.unknown, done.unseen, done.asked) == (2, 1, 2, 5)
    assert done.ratio.value == pytest.approx(0.3 / 0.75)
    # of the gap that no channel shows an oracle leaves 1 / 1.25 ** 2
    assert done.least.n == 4 and done.least.value == pytest.approx(0.6 / (3 * 0.75 + 0.36))
    said = against_oracle(done)
    assert said.startswith(f"{number(done.ratio)}; 2 of 5 have a figure, 1 named effects but gave no share on the sco")
    assert said.endswith("2 with a gap that no channel shows") and bound(done) == number(done.least)
    whole = where_largest(*removed(rows[:2], limits))
    assert against_oracle(whole) == number(whole.ratio)
