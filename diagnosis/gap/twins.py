"""Twins: recordings that the fitted model itself would make, taken through the same estimation as the recording.

Unknowns are drawn from the posterior, nuisances from their prior, noise with the residual's own colour (and with how
unsure that is); each twin is then estimated anew. All that in the linearised problem, hundreds at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from diagnosis.fitting.gaussian import triangle
from diagnosis.fitting.grams import Colours, Grams, Product, Projected, projected

TWINS = 400
SHOWN = 200
"""Of these the residual series are kept."""


@dataclass(frozen=True)
class Twins:
    """Twins and what they leave.

    ``rows``: by channel, whitened (readings, twins); ``scores`` (columns, twins) and ``squares`` (twins,) of them;
    ``residuals`` (shown, outputs, steps) [unit of each] after estimation, and ``residual`` (outputs, steps), the
    recording's own by the same map.
    """

    product: Product
    left: Projected
    rows: dict[int, np.ndarray]
    scores: np.ndarray
    squares: np.ndarray
    residuals: np.ndarray
    residual: np.ndarray

    @property
    def misfits(self) -> np.ndarray:
        """Squares that nuisance and unknowns leave, shape (twins,)."""
        return np.asarray(self.squares - self.left.explained(self.scores))


def draw_twins(grams: Grams, colours: Colours, count: int = TWINS, seed: int = 0) -> Twins:
    """Draw and estimate twins of a linearised fit."""
    rng = np.random.default_rng(seed)
    product = grams.total(colours.best)
    inner = grams.inner.size
    left = projected(product, inner)
    n = grams.n_nuisance
    prior_mean = grams.lin.z / grams.spread
    # the unknowns' posterior: the last block of the inverse of root root'
    pick = np.zeros((inner, inner - n))
    pick[n:] = np.eye(inner - n)
    spread = triangle(solve_triangular(left.root, pick, lower=True))
    true = np.concatenate(
        [
            rng.standard_normal((n, count)),
            prior_mean[:, None] + spread @ rng.standard_normal((inner - n, count)),
        ]
    )
    time = grams.lin.problem.time
    scores, squares, whitened = np.zeros((len(product.score), count)), np.zeros(count), {}
    series = np.full((len(grams.rows), len(time), count), np.nan)
    model = grams.explained(true)
    for k in range(len(grams.rows)):
        if k not in grams.channels:
            continue
        errors = draw_errors(colours.weights[k], time, count, rng)
        series[k] = model[k] + errors
        columns = grams.whitened_columns(k, colours.best[k])
        rows = whitened[k] = grams.whitened(k, colours.best[k], series[k])
        scores += columns.T @ rows
        squares += np.sum(rows**2, axis=0)
    shown = min(count, SHOWN)
    found = left.inner(scores[:, :shown])
    residuals = series[..., :shown] - grams.explained(found)
    own = grams.rows - grams.explained(cho_solve((left.root, True), product.score[:inner]))
    own = np.where(np.isfinite(grams.lin.residual), own, np.nan)
    return Twins(product, left, whitened, scores, squares, np.moveaxis(residuals, -1, 0), own)


def draw_errors(
    weights: list[tuple[tuple[float, float, float], float]], time: np.ndarray, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Errors of one channel, each twin's with a colour drawn from the posterior, shape (steps, count)."""
    colours = np.array([one for one, _ in weights])
    white, slow, memory = colours[rng.choice(len(weights), count, p=[share for _, share in weights])].T
    made = white * rng.standard_normal((len(time), count))
    state = slow * rng.standard_normal(count)
    made[0] += state
    decay = np.exp(-np.diff(time)[:, None] / memory)
    kick = slow * np.sqrt(1 - decay**2)
    for i in range(1, len(time)):
        state = decay[i - 1] * state + kick[i - 1] * rng.standard_normal(count)
        made[i] += state
    return made
