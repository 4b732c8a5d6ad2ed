"""Newton's iteration for CVODE's implicit steps, compiled, with all that belongs to it in one place.

CVODE keeps its step sizes, orders, error tests and roots. It hands the algebraic equations of each step to
:data:`solve`, which does what CVODE's own modified Newton iteration does (Hindmarsh et al., ACM TOMS 31, 2005,
section 2.1: the same tests and constants), but knows the Jacobian's pattern. The pattern is found by differences
column by column, at first and now and then; in between columns that share no row are differenced together. A pattern
that has become too small costs convergence, never accuracy, and is then found anew.

The quadratures at the end of the state vector do not act back on the states: they follow from these.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray

from datagen.fmi.calls import (
    CV_SYSTEM,
    FACTORS,
    JACOBIAN,
    MATRIX,
    N_MEANS,
    N_STATES,
    NEWTON_COUNTS,
    NEWTON_REALS,
    PATTERN,
    PLAN_SIZE,
    RESIDUAL,
    STRUCTURE,
    SYSTEM,
    VECTOR_DATA,
    doubles,
    integers,
    unsigned,
)
from datagen.fmi.compilation import cfunc, njit
from datagen.fmi.foreign import foreign
from datagen.simulating.evaluation import evaluate
from datagen.simulating.sparse import analyse, colour, factorise, substitute

# places in the counts
STEPS_SINCE_FACTORS, STEPS_SINCE_JACOBIAN, FAILED, ITERATIONS, FACTORISATIONS, JACOBIANS, COLOURS, PATTERNS = range(8)
COUNTS = 8
# places in the reals: gamma of the factors, and the rate at which iterations have converged with them
GAMMA, RATE = 0, 1
REALS = 2

RECOVERABLE = 902  # SUN_NLS_CONV_RECVR: CVODE takes a smaller step
RHS_RECOVERABLE = 9  # the FMU discarded the states: likewise
RHS_FAILED = -8
MAX_ITERATIONS = 3
FACTORS_LAST = 20  # steps
JACOBIAN_LASTS = 50  # steps, also beyond an event: what it changes shows as bad convergence
GAMMA_CHANGE = 0.3
RATE_DOWN = 0.3
DIVERGES = 2.0
LEARN_FIRST, LEARN_EVERY = 4, 32
"""The first Jacobians, and each of so many later ones, are taken column by column and may show new entries."""
_ROOT_OF_ROUNDING = float(np.sqrt(np.finfo(np.float64).eps))
_ROUNDING = float(np.finfo(np.float64).eps)

_address_of = foreign("p:p")
_c_system = foreign("i:ppppppppp")


def sizes(n_states: int, size: int) -> dict[int, int]:
    """Places in the plan of arrays of eight-byte numbers that the iteration needs, and their lengths."""
    return {
        SYSTEM: 8,
        NEWTON_REALS: REALS,
        NEWTON_COUNTS: COUNTS,
        JACOBIAN: size * max(n_states, 1),
        MATRIX: n_states * n_states + 1,
        FACTORS: n_states * n_states + n_states + 1,
        PATTERN: size * n_states + n_states + 1,
        STRUCTURE: 3 * n_states + 2 + 4 * n_states * n_states,
        RESIDUAL: 2 * size,
    }


@njit
def weighted_norm(x: Any, w: Any) -> float:
    """Root of the mean square of ``x`` times ``w``: four sums side by side, in the same order on each machine."""
    a = b = c = d = 0.0
    n = len(x)
    fours = n - n % 4
    for i in range(0, fours, 4):
        a += (x[i] * w[i]) ** 2
        b += (x[i + 1] * w[i + 1]) ** 2
        c += (x[i + 2] * w[i + 2]) ** 2
        d += (x[i + 3] * w[i + 3]) ** 2
    for i in range(fours, n):
        a += (x[i] * w[i]) ** 2
    return float(np.sqrt((a + b + c + d) / n))


@njit
def _product(x: Any, y: Any, n: int) -> float:
    a = b = c = d = 0.0
    fours = n - n % 4
    for i in range(0, fours, 4):
        a += x[i] * y[i]
        b += x[i + 1] * y[i + 1]
        c += x[i + 2] * y[i + 2]
        d += x[i + 3] * y[i + 3]
    for i in range(fours, n):
        a += x[i] * y[i]
    return a + b + c + d


@njit
def _jacobian(plan: Any, t: float, step: float, y: Any, f: Any, w: Any, relearn: bool) -> int:
    """Differences as CVODE takes them; the pattern grows if need be."""
    n, size = plan[N_STATES], len(y)
    if n == 0:
        return 0
    counts = carray(integers(plan[NEWTON_COUNTS]), (COUNTS,))
    jacobian = carray(doubles(plan[JACOBIAN]), (size, n))
    pattern = carray(integers(plan[PATTERN]), (size, n))
    colours = carray(integers(plan[PATTERN] + 8 * size * n), (n,))
    moved = carray(doubles(plan[RESIDUAL] + 8 * size), (size,))
    out = carray(doubles(plan[RESIDUAL]), (size,))
    done = counts[JACOBIANS]
    learn = relearn or done < LEARN_FIRST or done % LEARN_EVERY == 0
    counts[JACOBIANS] += 1
    norm = weighted_norm(f, w)
    least = 1000.0 * abs(step) * _ROUNDING * size * norm if norm > 0.0 else 1.0
    moved[:] = y
    grown = False
    for c in range(n if learn else counts[COLOURS]):
        for j in range(n):
            if (learn and j == c) or (not learn and colours[j] == c):
                moved[j] = y[j] + max(_ROOT_OF_ROUNDING * abs(y[j]), least / w[j])
        code = evaluate(plan, t, moved.ctypes.data, out.ctypes.data)
        if code != 0:
            return code
        for j in range(n):
            if moved[j] != y[j]:
                inverse = 1.0 / (moved[j] - y[j])
                moved[j] = y[j]
                for i in range(size):
                    difference = out[i] - f[i]
                    if learn and difference != 0.0 and pattern[i, j] == 0:
                        pattern[i, j] = 1
                        grown = True
                    if pattern[i, j] != 0:
                        jacobian[i, j] = difference * inverse
    if grown or done == 0:
        counts[PATTERNS] += 1
        counts[COLOURS] = colour(pattern, colours)
        order, starts, low, high, places = _structure(plan, n)
        analyse(pattern, order, starts, low, high, places)
    return 0


@njit
def _structure(plan: Any, n: int) -> Any:
    """The arrays of :func:`datagen.simulating.sparse.analyse`."""
    a, square = plan[STRUCTURE], 8 * n * n
    order = carray(unsigned(a), (n,))
    starts = carray(integers(a + 8 * n), (2, n + 1))
    a += 8 * (3 * n + 2)
    low, high = carray(unsigned(a), (n * n,)), carray(unsigned(a + square), (n * n,))
    return order, starts, low, high, carray(unsigned(a + 2 * square), (2 * n * n,))


@njit
def _factorise(plan: Any, gamma: float, size: int) -> bool:
    n = plan[N_STATES]
    order, starts, low, high, places = _structure(plan, n)
    matrix = carray(doubles(plan[MATRIX]), (n, n))
    jacobian = carray(doubles(plan[JACOBIAN]), (size, n))
    for p in range(starts[0, n] + starts[1, n]):
        matrix[places[2 * p], places[2 * p + 1]] = -gamma * jacobian[places[2 * p], places[2 * p + 1]]
    for i in range(n):
        matrix[i, i] = 1.0 - gamma * jacobian[i, i]
    pivots = carray(doubles(plan[FACTORS]), (n,))
    values = carray(doubles(plan[FACTORS] + 8 * n), (n * n,))
    return factorise(matrix, order, starts, low, high, places, pivots, values)


@cfunc("int32(intp, intp, intp, intp, float64, int32, intp)")
def solve(solver: int, y0: int, correction: int, weights: int, tolerance: float, setup: int, memory: int) -> int:
    """SUNNonlinearSolver's solve function."""
    plan = carray(integers(carray(integers(solver), (1,))[0]), (PLAN_SIZE,))
    n, means = plan[N_STATES], plan[N_MEANS]
    size = max(n + means, 1)
    at = plan[SYSTEM]
    _c_system(plan[CV_SYSTEM], memory, at, at + 8, at + 16, at + 24, at + 32, at + 40, at + 48, at + 56)
    pointers, reals = carray(integers(at), (8,)), carray(doubles(at), (8,))
    t, gamma, rl1 = reals[0], reals[4], reals[5]
    get = plan[VECTOR_DATA]
    y_address, f_address = _address_of(get, pointers[2]), _address_of(get, pointers[3])
    predicted = carray(doubles(_address_of(get, pointers[1])), (size,))
    y = carray(doubles(y_address), (size,))
    f = carray(doubles(f_address), (size,))
    slope = carray(doubles(_address_of(get, pointers[6])), (size,))
    total = carray(doubles(_address_of(get, correction)), (size,))
    w = carray(doubles(_address_of(get, weights)), (size,))
    residual = carray(doubles(plan[RESIDUAL]), (size,))
    jacobian = carray(doubles(plan[JACOBIAN]), (size, n))
    counts = carray(integers(plan[NEWTON_COUNTS]), (COUNTS,))
    memo = carray(doubles(plan[NEWTON_REALS]), (REALS,))
    _, starts, _, _, places = _structure(plan, n)
    pivots = carray(doubles(plan[FACTORS]), (n,))
    values = carray(doubles(plan[FACTORS] + 8 * n), (n * n,))

    jacobian_due = counts[JACOBIANS] == 0 or counts[STEPS_SINCE_JACOBIAN] >= JACOBIAN_LASTS or counts[FAILED] != 0
    due = jacobian_due or counts[STEPS_SINCE_FACTORS] >= FACTORS_LAST or abs(gamma / memo[GAMMA] - 1.0) > GAMMA_CHANGE
    relearn = counts[FAILED] != 0
    while True:
        for i in range(size):
            total[i] = 0.0
            y[i] = predicted[i]
        code = evaluate(plan, t, y_address, f_address)
        if code == 0 and due and n > 0:
            if jacobian_due:
                code = _jacobian(plan, t, gamma / rl1, y, f, w, relearn)
                counts[STEPS_SINCE_JACOBIAN] = 0
            if code == 0:
                if not _factorise(plan, gamma, size):
                    counts[FAILED] = 1
                    return RECOVERABLE
                counts[FACTORISATIONS] += 1
                memo[GAMMA], memo[RATE] = gamma, 1.0
                counts[STEPS_SINCE_FACTORS] = 0
        if code != 0:
            counts[FAILED] = 1
            return RHS_RECOVERABLE if code > 0 else RHS_FAILED
        scale = 2.0 / (1.0 + gamma / memo[GAMMA]) if n > 0 else 1.0
        before = 0.0
        n_low, n_all = starts[0, n], starts[0, n] + starts[1, n]
        for iteration in range(MAX_ITERATIONS):
            counts[ITERATIONS] += 1
            for i in range(size):
                residual[i] = gamma * f[i] - rl1 * slope[i] - total[i]
            if n > 0:
                substitute(pivots, values, places, n_low, n_all, residual)
                for i in range(n):
                    residual[i] *= scale
                for i in range(n, n + means):
                    residual[i] += gamma * _product(jacobian[i], residual, n)
            for i in range(size):
                total[i] += residual[i]
                y[i] = predicted[i] + total[i]
            norm = weighted_norm(residual, w)
            if iteration > 0:
                memo[RATE] = max(RATE_DOWN * memo[RATE], norm / before)
            if norm * min(1.0, memo[RATE]) <= tolerance:
                counts[FAILED] = 0
                counts[STEPS_SINCE_FACTORS] += 1
                counts[STEPS_SINCE_JACOBIAN] += 1
                return 0
            if (iteration > 0 and norm > DIVERGES * before) or iteration + 1 == MAX_ITERATIONS:
                break
            before = norm
            code = evaluate(plan, t, y_address, f_address)
            if code != 0:
                counts[FAILED] = 1
                return RHS_RECOVERABLE if code > 0 else RHS_FAILED
        if due and jacobian_due:
            counts[FAILED] = 1
            return RECOVERABLE
        due = jacobian_due = True


@cfunc("int32(intp)")
def kind(solver: int) -> int:
    """SUNNonlinearSolver's type: one that finds roots."""
    return 0


@cfunc("int32(intp, intp)")
def set_function(solver: int, function: int) -> int:
    """CVODE offers its own residual, which is not needed."""
    return 0
