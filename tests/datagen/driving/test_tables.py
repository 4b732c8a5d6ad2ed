"""The merged input table: reproduces each signal, means are integrals, jumps are where signals jump."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from datagen.driving.tables import Piecewise, merge

START, STOP = -4.0, 12.0
CELL = 1 / 8
"""Knots fall on quarters, so that the midpoint rule on eighths is exact."""


@st.composite
def signals(draw):
    kind = draw(st.sampled_from(["linear", "previous"]))
    quarters = draw(st.lists(st.integers(-40, 80), min_size=1, max_size=12, unique=True))
    values = draw(st.lists(st.integers(-5, 5), min_size=len(quarters), max_size=len(quarters)))
    return Piecewise(np.sort(quarters) / 4.0, np.array(values, float), kind)


@st.composite
def tables(draw):
    made = draw(st.lists(signals(), max_size=4))
    return {f"s{k}": signal for k, signal in enumerate(made)}


@given(tables())
def test_table_reproduces_each_signal(made):
    table = merge(made, START, STOP)
    t = np.concatenate([np.arange(START, STOP, CELL), np.random.default_rng(0).uniform(START, STOP, 200)])
    got = table.at(t)
    assert got.shape == (len(t), len(made))
    for k, signal in enumerate(made.values()):
        np.testing.assert_allclose(got[:, k], signal.at(t), rtol=0, atol=1e-12)


@given(tables())
def test_means_are_integrals(made):
    table = merge(made, START, STOP)
    edges = np.array([START, START + 0.25, 0.0, 0.5, 3.0, 9.75, STOP])
    got = table.means(edges)
    middles = np.arange(START + CELL / 2, STOP, CELL)
    fine = table.at(middles)
    for j in range(len(edges) - 1):
        inside = (middles > edges[j]) & (middles < edges[j + 1])
        np.testing.assert_allclose(got[j], fine[inside].mean(axis=0), rtol=0, atol=1e-12)


@given(tables(), st.integers(-16, 46), st.integers(1, 40))
def test_restricted_and_refined_keep_the_signal(made, first, length):
    table = merge(made, START, STOP)
    begin, end = first / 4 + 0.1, min(first / 4 + length / 4, STOP)
    part = table.restricted(begin, end)
    assert (part.start, part.stop) == (begin, end)
    t = np.random.default_rng(1).uniform(begin, end, 100)
    np.testing.assert_allclose(part.at(t), table.at(t), rtol=0, atol=1e-12)
    np.testing.assert_allclose(part.means([begin, end]), table.means([begin, end]), rtol=0, atol=1e-12)
    finer = part.refined(np.arange(-5, 13, 0.3))
    np.testing.assert_allclose(finer.at(t), table.at(t), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(finer.time[finer.jump], part.time[part.jump])


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Piecewise([0, 0], [1, 2]), "strictly increase"),
        (lambda: Piecewise([0, 1], [1, np.nan]), "not finite"),
        (lambda: merge({}, 3, 3), "expected start < stop"),
        (lambda: merge({}, 0, 10).means([0, 11]), "not within the inputs"),
    ],
)
def test_misuse_is_refused(make, text):
    with pytest.raises(ValueError, match=text):
        make()
