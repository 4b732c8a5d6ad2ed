"""Principal directions against numpy's singular value decomposition, whichever of rows and columns are more."""

import numpy as np
import pytest

from diagnosis.fitting.linearisation import principal


@pytest.mark.parametrize("shape", [(30, 8), (8, 30), (9, 9)])
def test_is_the_singular_value_decomposition(shape):
    rng = np.random.default_rng(3)
    columns = rng.standard_normal(shape) * np.geomspace(1.0, 0.001, shape[1])
    columns[:, -1] = columns[:, -2]
    squares, unknowns, rows = principal(columns, 0.05)
    lengths = np.linalg.svd(columns, compute_uv=False)
    kept = lengths[lengths**2 > 0.05]
    assert 0 < len(kept) < shape[1]
    np.testing.assert_allclose(squares, kept[::-1] ** 2, rtol=1e-9)
    np.testing.assert_allclose(unknowns.T @ unknowns, np.eye(len(kept)), atol=1e-9)
    np.testing.assert_allclose(rows.T @ rows, np.eye(len(kept)), atol=1e-9)
    np.testing.assert_allclose(columns @ unknowns, rows * np.sqrt(squares), atol=1e-9)


@pytest.mark.parametrize("shape", [(0, 4), (4, 0), (0, 0)])
def test_nothing_has_no_directions(shape):
    squares, unknowns, rows = principal(np.zeros(shape), 0.0)
    assert squares.shape == (0,) and unknowns.shape == (shape[1], 0) and rows.shape == (shape[0], 0)
