"""Systems that a run has seen: pairs of root seed and index, written in order."""

from hypothesis import given
from hypothesis import strategies as st

from trainer.runs.systems import Systems, packed, unpacked

PAIRS = st.sets(st.tuples(st.integers(0, 3), st.integers(0, 40)))


def systems(pairs):
    return Systems(root_seeds=[seed for seed, _ in pairs], indices=[index for _, index in pairs])


@given(PAIRS, PAIRS)
def test_both_s_systems_are_those_of_either_once_and_in_order(one, other):
    both = systems(list(one)).with_those(systems(list(other)))
    assert list(zip(both.root_seeds, both.indices, strict=True)) == sorted(one | other)


@given(st.lists(st.integers(0, 30)))
def test_what_was_packed_comes_back(numbers):
    assert unpacked(packed(numbers)) == numbers
