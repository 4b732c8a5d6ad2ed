from hypothesis import given
from hypothesis import strategies as st

from trainer.runs.spans import packed, unpacked


@given(st.lists(st.integers(0, 30)))
def test_what_was_packed_comes_back(numbers):
    assert unpacked(packed(numbers)) == numbers


def test_stretches_and_repetitions_take_little_room():
    assert packed([0, 1, 2, 3, 5, 8, 9]) == "0-3 5 8-9"
    assert packed([2026] * 1000) == "2026*1000"
    assert packed([]) == ""
