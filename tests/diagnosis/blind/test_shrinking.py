"""Shares of the gap removed, beside an oracle's."""

from types import SimpleNamespace

import pytest

from diagnosis.blind.shrinking import WORST, removed


@pytest.mark.parametrize(("share", "counted"), [(0.6, 0.6), (1.33, 1.0), (-9.0, WORST)])
def test_a_share_above_one_is_all_of_the_gap_and_makes_up_for_no_other(share, counted):
    verdict = SimpleNamespace(shrinkage={"room": SimpleNamespace(share=share)})
    row = SimpleNamespace(
        truth="effect", visible=["room"], gap={"room": 2.0}, named=("one",), answer={"replay": False},
        outcome=SimpleNamespace(verdict=verdict),
    )  # fmt: skip
    (found,), lost = removed([row], {(False, "room"): 1.0})
    assert found.share == counted and found.oracle == pytest.approx(0.75) and not lost
