"""The sparse solver against numpy's dense one."""

import numpy as np
import pytest

from datagen.simulating.sparse import analyse, colour, factorise, substitute


def solver_of(pattern):
    n = len(pattern)
    order, starts = np.zeros(n, dtype=np.uint64), np.zeros((2, n + 1), dtype=np.int64)
    low, high = (np.zeros(n * n, dtype=np.uint64) for _ in range(2))
    places = np.zeros(2 * n * n, dtype=np.uint64)
    analyse(pattern, order, starts, low, high, places)
    return order, starts, low, high, places


def solved(matrix, structure, b):
    n = len(matrix)
    order, starts, low, high, places = structure
    pivots, values, x = np.zeros(n), np.zeros(n * n), b.copy()
    assert factorise(matrix.copy(), order, starts, low, high, places, pivots, values)
    substitute(pivots, values, places, starts[0, n], starts[0, n] + starts[1, n], x)
    return x


@pytest.mark.parametrize("n", [2, 30])
@pytest.mark.parametrize("density", [0.0, 0.15, 1.0])
def test_solutions_are_numpys(n, density):
    dice = np.random.default_rng(n)
    pattern = (dice.random((n + 2, n)) < density).astype(np.int64)
    structure = solver_of(pattern[:n])
    assert sorted(structure[0].tolist()) == list(range(n))
    for _ in range(3):  # one structure, several matrices
        matrix = np.where(pattern[:n], dice.normal(size=(n, n)), 0.0)
        np.fill_diagonal(matrix, n * (1.0 + dice.random(n)))
        b = dice.normal(size=n)
        np.testing.assert_allclose(solved(matrix, structure, b), np.linalg.solve(matrix, b), rtol=1e-10, atol=1e-13)


def test_a_singular_matrix_is_refused():
    order, starts, low, high, places = solver_of(np.ones((2, 2), dtype=np.int64))
    assert not factorise(np.ones((2, 2)), order, starts, low, high, places, np.zeros(2), np.zeros(4))


def test_columns_of_one_colour_share_no_row():
    dice = np.random.default_rng(0)
    pattern = (dice.random((40, 30)) < 0.06).astype(np.int64)
    colours = np.full(30, -1, dtype=np.int64)
    count = colour(pattern, colours)
    assert set(colours.tolist()) == set(range(count))
    assert count < 15
    for c in range(count):
        assert pattern[:, colours == c].sum(axis=1).max() <= 1
