"""A linear solver for matrices of one pattern: who is zero is found once, then only the others are worked on.

Models of buildings, and most others, are sparse: a wall's node knows its neighbours. The matrix I - gamma J of implicit
integration is eliminated along its diagonal in the order of least fill (Markowitz, Management Science 3, 1957), without
pivoting: gamma goes to zero with the step, so that a step that is small enough always has a good pivot.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from datagen.fmi.compilation import njit

SMALLEST_PIVOT = 1e-10
"""The matrix is near one: a pivot below this is what rounding has left of nothing."""


@njit
def colour(pattern: Any, colours: Any) -> int:
    """Give columns that share no row the same colour; returns how many colours there are.

    ``pattern`` (rows, columns) of zeros and ones, ``colours`` (columns,) is filled.
    Curtis, Powell and Reid, J. Inst. Maths Applics 13, 117-119, 1974.
    """
    rows, columns = pattern.shape
    count = 0
    for j in range(columns):
        c = 0
        while True:
            clash = False
            for k in range(j):
                if colours[k] == c:
                    for i in range(rows):
                        if pattern[i, k] != 0 and pattern[i, j] != 0:
                            clash = True
                            break
                if clash:
                    break
            if not clash:
                break
            c += 1
        colours[j] = c
        count = max(count, c + 1)
    return count


@njit
def analyse(pattern: Any, order: Any, starts: Any, low: Any, high: Any, places: Any) -> None:
    """Order of elimination, and what it fills.

    Parameters
    ----------
    pattern
        At least (n, n), of zeros and ones; the diagonal counts as full.
    order
        Filled, (n,): pivots in order.
    starts, low, high
        Filled, (2, n + 1), (n * n,), (n * n,): rows below the k-th pivot are ``low[starts[0, k]:starts[0, k + 1]]``,
        columns right of it ``high[starts[1, k]:starts[1, k + 1]]``.
    places
        Filled, (2 * n * n,): row and column of each factor in the order in which :func:`substitute` takes them, those
        below the diagonal first.
    """
    n = len(order)
    full = np.zeros((n, n), dtype=np.bool_)
    left = np.ones(n, dtype=np.bool_)
    for i in range(n):
        for j in range(n):
            full[i, j] = pattern[i, j] != 0 or i == j
    n_low = n_high = 0
    for step in range(n):
        best, best_cost = -1, 0
        for k in range(n):
            if left[k]:
                rows = columns = 0
                for i in range(n):
                    if left[i] and i != k:
                        rows += full[i, k]
                        columns += full[k, i]
                cost = rows * columns
                if best < 0 or cost < best_cost:
                    best, best_cost = k, cost
        left[best] = False
        order[step] = best
        starts[0, step], starts[1, step] = n_low, n_high
        for i in range(n):
            if left[i] and full[i, best]:
                places[2 * n_low], places[2 * n_low + 1] = i, best
                low[n_low] = i
                n_low += 1
            if left[i] and full[best, i]:
                high[n_high] = i
                n_high += 1
        for p in range(starts[0, step], n_low):
            for q in range(starts[1, step], n_high):
                full[low[p], high[q]] = True
    starts[0, n], starts[1, n] = n_low, n_high
    count = n_low
    for step in range(n - 1, -1, -1):
        for earlier in range(step):
            if full[order[earlier], order[step]]:
                places[2 * count], places[2 * count + 1] = order[earlier], order[step]
                count += 1


@njit
def factorise(a: Any, order: Any, starts: Any, low: Any, high: Any, places: Any, pivots: Any, values: Any) -> bool:
    """LU of ``a`` (n, n), in place; also packed: the pivots' inverses (n,), and the factors (n * n,) by their places.

    False if a pivot is too small.
    """
    n = len(order)
    for step in range(n):
        k = order[step]
        if not abs(a[k, k]) > SMALLEST_PIVOT:
            return False
        inverse = 1.0 / a[k, k]
        pivots[k] = inverse
        columns = high[starts[1, step] : starts[1, step + 1]]
        for p in range(starts[0, step], starts[0, step + 1]):
            i = low[p]
            factor = a[i, k] * inverse
            values[p] = factor
            for q in range(len(columns)):
                a[i, columns[q]] -= factor * a[k, columns[q]]
    n_low = starts[0, n]
    for p in range(n_low, n_low + starts[1, n]):
        i = places[2 * p]
        values[p] = a[i, places[2 * p + 1]] * pivots[i]
    return True


@njit
def substitute(pivots: Any, values: Any, places: Any, n_low: int, n_all: int, b: Any) -> None:
    """Solve with packed factors; the first ``len(pivots)`` of ``b`` become the solution."""
    for p in range(n_low):
        b[places[2 * p]] -= values[p] * b[places[2 * p + 1]]
    for i in range(len(pivots)):
        b[i] *= pivots[i]
    values, places = values[n_low:], places[2 * n_low :]
    for p in range(n_all - n_low):
        b[places[2 * p]] -= values[p] * b[places[2 * p + 1]]
