"""Linear Gaussian arithmetic on a linearised recording: products of whitened columns, by channel and colour of noise.

With standard normal nuisance and unknowns, the residual is r = A x + e, e ~ N(0, S) and S block diagonal by channel.
Everything that is asked later - evidences, scores, what parameters can imitate - follows from A' S^-1 A, A' S^-1 r and
r' S^-1 r (Rasmussen and Williams 2006, section 2.7), which are sums over channels; so trying another colour on one
channel costs one product.

How large and how slow the error of each channel is: the noise of the null, and what a gap adds to it.

The description says how large a sensor's error is, not how it is coloured. A colour that were free in size would
take up the gap itself; so the size stays what the description says (noise, rounding and the model's own accuracy), and
only the colour is estimated: the share of the variance that is slow, and its memory; and beside it a slow error of the
model itself (the floor) of at most the sensor's own. That is done with the amplitudes of all candidates integrated
out, lest a candidate's signature pass for colour (type II maximum likelihood, Rasmussen and Williams 2006, section
5.4.1). Channels take turns.

Recording and twins are judged by one colour for each channel, the posterior's mean. Judged by the most plausible colour
alone, twins that are drawn with another plausible one would seem to hold gaps, and a real gap would have to be larger
than theirs to be seen.

A **discrepancy** is a slow error beyond that size: what is left when no cause is named. Its gain in log evidence
measures a gap of whatever cause.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import cho_solve

from diagnosis.fitting.gaussian import factor, no_less_than_nothing
from diagnosis.fitting.lines import Linearised
from diagnosis.fitting.noise import HOUR, NoiseModel

AMPLITUDE = 2.0
"""Prior standard deviation of a fitted amplitude [scale of the effect]: larger ones than expected are no surprise."""
Colour = tuple[float, float, float]
"""White part, slow part [unit of the output] and memory of the slow part [s] of one channel's error."""


@dataclass(frozen=True)
class Product:
    """Of one channel or all: ``gram`` (columns, columns), ``score`` (columns,), ``square``, ``logdet``, ``count``."""

    gram: np.ndarray
    score: np.ndarray
    square: float
    logdet: float
    count: int

    def __add__(self, other: Product) -> Product:
        return Product(
            self.gram + other.gram,
            self.score + other.score,
            self.square + other.square,
            self.logdet + other.logdet,
            self.count + other.count,
        )


@dataclass
class Grams:
    """Columns in the order nuisance, unknowns, candidate effects; rows are the readings that are ``observed``.

    The residual is taken at the prior mean of the unknowns, so that all columns have a prior centred on zero;
    ``spread`` (unknowns,) are the unknowns' prior standard deviations, by which their columns are multiplied.
    """

    lin: Linearised
    observed: np.ndarray
    like: Grams | None = None
    _cache: dict[tuple[int, Colour], Product] = field(default_factory=dict)
    _nuisance: dict[int, tuple[Colour, np.ndarray, np.ndarray]] = field(default_factory=dict)
    _root: dict[tuple[Colour, ...], np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lin = self.lin
        first = len(lin.problem.system.parameters)
        self.spread = np.ones(len(lin.z))
        self.spread[first : first + len(lin.chosen)] = AMPLITUDE
        self.free = np.concatenate([lin.by_unknown * self.spread, lin.by_effect], axis=2)
        self.n_nuisance, self.n_unknown = lin.by_nuisance.shape[2], lin.by_unknown.shape[2]
        self.rows = np.where(np.isfinite(lin.residual), lin.residual, 0.0) + lin.by_unknown @ lin.z
        self.channels = [k for k in range(len(self.rows)) if self.observed[k].any()]
        like = self.like
        if like and like.lin.by_nuisance is lin.by_nuisance and np.array_equal(like.observed, self.observed):
            self._nuisance, self._root = like._nuisance, like._root  # the same columns: whitened and factorised once

    @property
    def inner(self) -> np.ndarray:
        """Places of nuisance and unknowns."""
        return np.arange(self.n_nuisance + self.n_unknown)

    @property
    def outer(self) -> np.ndarray:
        """Places of the candidate effects."""
        return np.arange(self.n_nuisance + self.n_unknown, self.n_nuisance + self.free.shape[2])

    def whitened(self, k: int, colour: Colour, values: np.ndarray) -> np.ndarray:
        """One channel's series (steps[, n]) as rows of unit noise, shape (readings[, n])."""
        return _model(colour).whiten(values[None], self.observed[k : k + 1], self.lin.problem.time)

    def whitened_columns(self, k: int, colour: Colour) -> np.ndarray:
        """One channel's columns, shape (readings, columns)."""
        return np.concatenate([self._white_nuisance(k, colour)[0], self.whitened(k, colour, self.free[k])], axis=1)

    def explained(self, x: np.ndarray) -> np.ndarray:
        """Series that nuisance and unknowns (inner columns[, n]) make, shape (outputs, steps[, n]) [unit of each]."""
        n = self.n_nuisance
        return np.asarray(self.lin.by_nuisance @ x[:n] + self.free[..., : self.n_unknown] @ x[n:])

    def channel(self, k: int, colour: Colour) -> Product:
        """Products of one channel with one colour."""
        key = (k, colour)
        if key not in self._cache:
            nuisance, gram = self._white_nuisance(k, colour)
            made = self.whitened(k, colour, np.column_stack([self.rows[k], self.free[k]]))
            rows, free = made[:, 0], made[:, 1:]
            across = nuisance.T @ free
            self._cache[key] = Product(
                np.block([[gram, across], [across.T, free.T @ free]]),
                np.concatenate([nuisance.T @ rows, free.T @ rows]),
                float(rows @ rows),
                _model(colour).logdet(self.observed[k : k + 1], self.lin.problem.time),
                len(rows),
            )
        return self._cache[key]

    def _white_nuisance(self, k: int, colour: Colour) -> tuple[np.ndarray, np.ndarray]:
        """Nuisance columns of one channel, whitened, and their products; the last colour's are kept."""
        kept = self._nuisance.get(k)
        if kept is None or kept[0] != colour:
            columns = self.whitened(k, colour, self.lin.by_nuisance[k])
            kept = self._nuisance[k] = (colour, columns, columns.T @ columns)
        return kept[1], kept[2]

    def total(self, colours: dict[int, Colour]) -> Product:
        """Sum over all channels that have readings, with the line's slope by the unknowns."""
        parts = [self.channel(k, colours[k]) for k in self.channels]
        whole = parts[0]
        for one in parts[1:]:
            whole = whole + one
        if not self.lin.slope or not self.n_unknown:
            return whole
        slopes, where = self.lin.slopes
        score = whole.score.copy()
        score[self.n_nuisance : self.n_nuisance + self.n_unknown] -= self.spread * slopes
        return replace(whole, score=score, square=whole.square - 2 * float(slopes @ where))

    def without_nuisance(self, colours: dict[int, Colour]) -> Projected:
        """All other columns when the nuisance has explained what it can; its factor is kept for the last colours."""
        product, key = self.total(colours), tuple(colours[k] for k in self.channels)
        found = projected(product, self.n_nuisance, self._root.get(key))
        if key not in self._root:
            self._root.clear()
            self._root[key] = found.root
        return found

    def evidence(self, colours: dict[int, Colour], effects: float = 0.0) -> float:
        """Log evidence; the candidates' amplitudes are N(0, ``effects``^2) scales as well, or zero."""
        return evidence(self.total(colours), self.inner.size, effects)


def _model(colour: Colour) -> NoiseModel:
    return NoiseModel(*(np.array([value]) for value in colour))


def evidence(product: Product, inner: int, effects: float = 0.0) -> float:
    """Log evidence of rows with standard normal unknowns in the first ``inner`` columns; see :meth:`Grams.evidence`."""
    prior = np.ones(len(product.score))
    prior[inner:] = effects
    keep = prior > 0
    scale = prior[keep]
    gram = product.gram[np.ix_(keep, keep)] * np.outer(scale, scale)
    score = product.score[keep] * scale
    root = factor(gram)
    explained = float(score @ cho_solve((root, True), score))
    return -0.5 * (
        product.square
        - explained
        + 2 * float(np.sum(np.log(np.diag(root))))
        + product.logdet
        + product.count * np.log(2 * np.pi)
    )


@dataclass(frozen=True)
class Projected:
    """What is left of scores and signatures when nuisance and unknowns have explained what they can.

    ``information`` (effects, effects) and ``score`` (effects,) by amplitudes in scales; ``whole`` (effects,): squared
    length of the signatures before; ``square``: of the residual after.
    """

    information: np.ndarray
    score: np.ndarray
    whole: np.ndarray
    square: float
    root: np.ndarray
    across: np.ndarray

    def score_of(self, scores: np.ndarray) -> np.ndarray:
        """Scores (columns, n) of other rows, projected: (effects, n)."""
        inner = len(self.root)
        return np.asarray(scores[inner:] - self.across.T @ scores[:inner])

    def explained(self, scores: np.ndarray) -> np.ndarray:
        """What nuisance and unknowns explain of other rows' squares, shape (n,)."""
        inner = scores[: len(self.root)]
        return np.asarray(np.sum(inner * cho_solve((self.root, True), inner), axis=0))

    def inner(self, scores: np.ndarray) -> np.ndarray:
        """Posterior mean of nuisance and unknowns of rows with these scores (columns, n)."""
        return np.asarray(cho_solve((self.root, True), scores[: len(self.root)]))


def projected(product: Product, inner: int, root: np.ndarray | None = None) -> Projected:
    """Integrate out the first ``inner`` columns; ``root`` is the factor of their precision, where it is known."""
    if root is None:
        root = factor(product.gram[:inner, :inner])
    across = cho_solve((root, True), product.gram[:inner, inner:])
    left = product.gram[inner:, inner:] - product.gram[inner:, :inner] @ across
    score = product.score[inner:] - across.T @ product.score[:inner]
    explained = float(product.score[:inner] @ cho_solve((root, True), product.score[:inner]))
    whole = np.diag(product.gram)[inner:].copy()
    left = no_less_than_nothing(0.5 * (left + left.T))
    return Projected(left, score, whole, product.square - explained, root, across)


SHARES = (0.3, 0.5)
MEMORIES = (3 * HOUR, 10 * HOUR)
FLOORS = (0.25, 0.5)
"""Standard deviations of the model's own slow error, in those of the channel's noise: a model that is right in all that
matters is still no more than a model, and no smaller discrepancy than this is called a gap. With 0.7 and 1.0 it took
up gaps that could be seen."""
FLOOR_MEMORIES = (10 * HOUR, 40 * HOUR)
SIZES = (1.5, 3.0, 6.0, 12.0)
"""Standard deviations of a discrepancy, in those of the channel's noise."""
DISCREPANCY_MEMORIES = (4 * HOUR, 24 * HOUR)
GRAIN = 0.1
"""To which variances of a mean colour are rounded, in those of the channel's noise."""
WIDE = 2.0
"""Prior standard deviation of the candidates' amplitudes while colours are estimated [scales]."""
_PASSES = 2


@dataclass(frozen=True)
class Colours:
    """``best`` colour by channel, to judge by; ``weights``: posterior of each channel's colours, others at the best."""

    best: dict[int, Colour]
    weights: dict[int, list[tuple[Colour, float]]]
    evidence: float


def estimated_colours(grams: Grams, size: np.ndarray) -> Colours:
    """The colour of each channel's noise of a given size (outputs,) [unit of each], and how sure it is."""
    options: dict[int, list[Colour]] = {}
    for k in grams.channels:
        one = float(size[k])
        slow = [(one * (1 - s) ** 0.5, one * s**0.5, memory) for s in SHARES for memory in MEMORIES]
        floor = [(one, one * f, memory) for f in FLOORS for memory in FLOOR_MEMORIES]
        options[k] = [(one, 0.0, HOUR), *slow, *floor]
    found = _climbed(grams, {k: ones[0] for k, ones in options.items()}, options, WIDE, 0.0)
    return replace(found, best={k: mean_colour(found.weights[k], float(size[k])) for k in grams.channels})


def mean_colour(weights: list[tuple[Colour, float]], size: float) -> Colour:
    """Mean of colours: of the variances of both parts, and of the memory's logarithm by the slow part's variance.

    Rounded, so that what was made with a colour is found again when the candidates are a few fewer.
    """
    share = np.array([one for _, one in weights])
    white, slow, memory = np.array([colour for colour, _ in weights]).T
    both = np.array([share @ white**2, share @ slow**2]) / size**2
    rounded = GRAIN * np.round(both / GRAIN)
    if rounded[1] <= 0:
        return float(size * np.sqrt(max(rounded[0], GRAIN))), 0.0, HOUR
    log = share * slow**2 @ np.log(memory) / (share @ slow**2)
    nearest = min({*MEMORIES, *FLOOR_MEMORIES}, key=lambda one: abs(np.log(one) - log))
    return float(size * np.sqrt(max(rounded[0], GRAIN))), float(size * np.sqrt(rounded[1])), nearest


def discrepancy(grams: Grams, colours: Colours, size: np.ndarray) -> tuple[float, dict[int, Colour]]:
    """Gain in log evidence of slow errors beyond the noise, and the colours with them.

    Every channel pays for the choice among its colours.
    """
    options = {
        k: [colours.best[k]]
        + [(float(size[k]), float(size[k]) * each, memory) for each in SIZES for memory in DISCREPANCY_MEMORIES]
        for k in grams.channels
    }
    cost = float(np.log(len(SIZES) * len(DISCREPANCY_MEMORIES)))
    found = _climbed(grams, colours.best, options, 0.0, cost)
    return found.evidence - grams.evidence(colours.best), found.best


def _climbed(
    grams: Grams, start: dict[int, Colour], options: dict[int, list[Colour]], effects: float, cost: float
) -> Colours:
    """Channel by channel the best of its options; any but the first pays ``cost``."""
    best, weights, value = dict(start), {}, 0.0
    for _ in range(_PASSES):
        before = dict(best)
        for k in grams.channels:
            found = [
                grams.evidence({**best, k: one}, effects) - (cost if one != options[k][0] else 0.0)
                for one in options[k]
            ]
            best[k] = options[k][int(np.argmax(found))]
            share = np.exp(np.array(found) - max(found))
            weights[k] = list(zip(options[k], (share / share.sum()).tolist(), strict=True))
        if best == before:
            break
    value = grams.evidence(best, effects) - cost * sum(best[k] != options[k][0] for k in grams.channels)
    return Colours(best, weights, value)
