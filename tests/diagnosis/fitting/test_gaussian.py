"""Factors of precisions: those of exact arithmetic, where rounding has spoilt the matrix as well."""

from fractions import Fraction

import numpy as np
import pytest

from diagnosis.fitting.gaussian import factor, no_less_than_nothing


def exact_logdet(columns):
    """log det(1 + C'C) in rational numbers."""
    n = columns.shape[1]
    rows = [[Fraction(float(x)) for x in row] for row in columns]
    gram = [[sum(r[i] * r[j] for r in rows) + (i == j) for j in range(n)] for i in range(n)]
    det = Fraction(1)
    for k in range(n):
        det *= gram[k][k]
        for i in range(k + 1, n):
            share = gram[i][k] / gram[k][k]
            gram[i] = [a - share * b for a, b in zip(gram[i], gram[k], strict=True)]
    return float(np.log(float(det)))


@pytest.mark.parametrize("size", [1.0, 1e9])
def test_a_factor_of_columns_that_are_nearly_alike(size):
    """Of columns a billion times as long as the prior's one, Cholesky's own factor does not exist any more."""
    rng = np.random.default_rng(0)
    columns = size * np.repeat(rng.standard_normal((9, 1)), 4, axis=1)
    columns[:, 3] = rng.standard_normal(9)
    lower = factor(columns.T @ columns)
    assert np.allclose(lower, np.tril(lower)) and (np.diag(lower) > 0).all()
    scale = np.sqrt(1 + np.sum(columns**2, axis=0))
    np.testing.assert_allclose(
        (lower @ lower.T - np.eye(4) - columns.T @ columns) / np.outer(scale, scale), 0, atol=1e-12
    )
    if size == 1.0:
        assert 2 * np.sum(np.log(np.diag(lower))) == pytest.approx(exact_logdet(columns), rel=1e-12)


def test_a_long_column_costs_a_short_one_nothing():
    gram = np.diag([1e30, 4.0, 0.0])
    gram[0, 1] = gram[1, 0] = -1.3e15 * 2.0  # beyond what two columns can have: rounding
    left = no_less_than_nothing(gram)
    assert left[2, 2] == 0 and left[1, 1] == pytest.approx(4.0, rel=0.2)
    assert np.linalg.eigvalsh(left / np.sqrt(np.outer([1e30, 1, 1], [1e30, 1, 1])))[0] > -1e-12
