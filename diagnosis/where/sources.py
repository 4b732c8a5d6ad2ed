"""The source that would close the residual (missing heat, missing CO2), and whether a balance or a sensor is off.

A missing source acts on the outputs as the model's own sources do; a sensor's error shows on its channel alone, and
imitating it takes a source that looks like a derivative. Both explanations get the same prior; the likelihood
says which is the better.

A series that would explain the residuals, by regularised inversion, and how much better it explains them than noise.

With white unit noise e = G u + noise and a prior u ~ N(0, tau K), K an Ornstein-Uhlenbeck covariance, the posterior
mean is the Tikhonov (or Kalman-smoother) solution, and the marginal likelihood has a closed form in the eigenbasis of
the whitened Gram matrix (Rasmussen and Williams 2006, Gaussian Processes for Machine Learning, sections 2.1 and 5.4).
One decomposition serves all rows.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from diagnosis.where.finding import Finding
from diagnosis.where.series import ALPHA, DAY, HOUR, MaxTest, Residuals, Whitened, max_test, whitened

_GRID = np.concatenate([[0.0], np.logspace(-2, 8, 41)])
"""Prior variances tried, relative to the one at which the best-seen direction has a signal-to-noise ratio of 1."""


@dataclass(frozen=True)
class Inverse:
    """A decomposed inverse problem with pulses ``root`` @ ``vectors`` and coefficients of the rows in that basis.

    ``strength`` (pulses,): squared singular values; ``basis`` (readings, pulses), times the singular values;
    ``projected`` (rows, pulses): rows in it.
    """

    root: np.ndarray
    vectors: np.ndarray
    strength: np.ndarray
    basis: np.ndarray
    projected: np.ndarray

    @property
    def unit(self) -> float:
        """Prior variance at which the best-seen direction has a signal-to-noise ratio of 1."""
        return 1 / float(self.strength.max()) if self.strength.max() > 0 else 0.0

    def gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Log marginal likelihood of each row over that of mere noise, at its best prior variance: both (rows,)."""
        grid = _GRID * self.unit
        best, at = np.zeros(len(self.projected)), np.zeros(len(self.projected))
        for tau in grid[1:]:
            ratio = tau / (1 + tau * self.strength)
            gain = 0.5 * (self.projected**2 @ ratio - np.log1p(tau * self.strength).sum())
            better = gain > best
            best, at = np.where(better, gain, best), np.where(better, tau, at)
        return best, at

    def solve(self, tau: float) -> np.ndarray:
        """Posterior means of all rows at one prior variance, shape (rows, pulses)."""
        return (self.projected * (tau / (1 + tau * self.strength))) @ (self.root @ self.vectors).T

    def by_reading(self, tau: float) -> np.ndarray:
        """The same of each reading of a row, shape (readings, pulses): the mean is a row times this."""
        return (self.basis * (tau / (1 + tau * self.strength))) @ (self.root @ self.vectors).T

    def uncertainty(self, tau: float) -> np.ndarray:
        """Posterior standard deviation of each pulse, shape (pulses,)."""
        basis = self.root @ self.vectors
        return np.sqrt(np.einsum("ij,j,ij->i", basis, tau / (1 + tau * self.strength), basis))

    def tau_for(self, share: float) -> float:
        """Prior variance at which the solution has ``share`` of its degrees of freedom, sum tau s / (1 + tau s)."""
        target = share * np.count_nonzero(self.strength > 1e-10 * self.strength.max())
        low, high = -10.0, 14.0
        for _ in range(60):
            middle = (low + high) / 2
            tau = 10**middle * self.unit
            if (tau * self.strength / (1 + tau * self.strength)).sum() < target:
                low = middle
            else:
                high = middle
        return float(10**low * self.unit)


def decompose(rows: np.ndarray, response: np.ndarray, centres: np.ndarray, memory: float) -> Inverse:
    """Prepare an inversion.

    Parameters
    ----------
    rows
        Whitened residuals, shape (rows, readings).
    response
        Whitened response to unit pulses, shape (readings, pulses).
    centres
        Middle of each pulse [s].
    memory
        Time over which the series remembers itself [s].
    """
    covariance = np.exp(-np.abs(centres[:, None] - centres) / memory)
    root = np.linalg.cholesky(covariance + 1e-10 * np.eye(len(centres)))
    driven = response @ root
    strength, vectors = np.linalg.eigh(driven.T @ driven)
    strength = np.maximum(strength, 0.0)
    strength[strength < 1e-12 * strength.max(initial=0.0)] = 0.0
    basis = driven @ vectors
    return Inverse(root, vectors, strength, basis, rows @ basis)


STRONG = 3.0
"""Log likelihood ratio that Kass and Raftery (1995) call strong."""

SUSPECT = "suspect that sensor"
FAINT = "too little for a gap"
OTHERWISE = "that is of the base model, and the answer explains it otherwise"
"""Of a source whose rival, or of a sensor whose source, is beside the answer."""

Verdict = Literal["balance", "sensor", "undecided", "none"]


@dataclass(frozen=True)
class Operator:
    """Response of the outputs to a source, linearised at the calibrated model.

    ``response`` (outputs, steps, pulses) [unit of the output per unit of the source]; pulse ``j`` holds from
    ``edges[j]`` to ``edges[j + 1]`` [s].
    """

    name: str
    label: str
    unit: str
    response: np.ndarray
    edges: np.ndarray


@dataclass(frozen=True)
class Source:
    """A source that would close the residual.

    ``estimate``, ``uncertainty`` (pulses,) [unit]: posterior mean and standard deviation; ``low``, ``high``: where 95 %
    of the twins' lie, which have no gap. ``adjusted`` (pulses,): family-wise p of each pulse. ``gain``: log
    likelihood over noise alone; ``p_value`` of that against the twins. ``rival``: the channel, of those that the source
    moves, whose own error explains most; ``balance``: the source's gain less the rival's. ``verdict``: ``balance``,
    ``sensor``, ``undecided`` by that difference, or ``none`` when neither explains more than in twins. ``by_reading``
    (readings, pulses): the estimate is a whitened row times this.
    """

    name: str
    label: str
    unit: str
    edges: np.ndarray
    estimate: np.ndarray
    uncertainty: np.ndarray
    low: np.ndarray
    high: np.ndarray
    adjusted: np.ndarray
    gain: float
    p_value: float
    rival: str
    balance: float
    verdict: Verdict
    by_reading: np.ndarray

    @property
    def needed(self) -> bool:
        """Whether the source itself explains more than in twins, whatever its rival does."""
        return self.p_value <= ALPHA


@dataclass(frozen=True)
class SourceTest:
    """Result of :func:`scan_sources`.

    ``sensor_gains``: log likelihood over noise, by channel, of an error on that channel alone; ``suspect``: the channel
    of which it explains most of all, if that is more than in twins. The cells of ``test`` are the sources, then the
    sensors. ``stands``: whether what they explain is more than in twins when all other places are tested with them.
    ``white``: how residuals were whitened.
    """

    test: MaxTest
    sources: list[Source]
    sensor_gains: dict[str, float]
    suspect: str | None
    findings: list[Finding]
    white: Whitened
    stands: bool = True

    def courses(self, series: np.ndarray) -> dict[str, np.ndarray]:
        """What of each source a part of the residual stands for, shape (pulses,) [unit of the source].

        Parameters
        ----------
        series
            The part, shape (outputs, steps) [unit of each].
        """
        row = self.white.response(series[..., None])[:, 0]
        return {one.name: row @ one.by_reading for one in self.sources}

    def words(self, one: Source, rival: str, *, answered: Collection[Verdict] = ()) -> str:
        """What the tests say of a source and its rival, whose label is given; goes on after the source's own label.

        Where a source explains no more than in twins, its rival may still be what another source explains better: a
        sensor is suspected only where the sensors' own test says so, of all sources and sensors together.
        All that is of the base model alone: ``answered`` says of which sort the effects are that an answer names, which
        were fitted with the parameters and are not contradicted; "none" where the answer is that there is no gap.
        """
        if one.verdict == "none":
            return "explains no more than in replicates without a gap"
        # a page that finds no place must not name a sensor or a balance
        suspected = self.stands and self.verdict == "sensor" and self.suspect == one.rival
        suspect = OTHERWISE if "balance" in answered else SUSPECT
        off = OTHERWISE if "sensor" in answered else "this balance is off"
        if "none" in answered:
            suspect = off = FAINT
        if not one.needed:
            instead = f"; an error of {rival} alone explains more: {suspect}" if suspected else ""
            return f"explains no more than in replicates without a gap: none of it is needed{instead}"
        if not self.stands:
            return "explains more than in replicates without a gap, but not once all places are tested together"
        if one.verdict == "balance":
            better = f"explains the residual better than an error of {rival} alone"
            return f"{better}: {off}" if self.verdict == "balance" else better
        if one.verdict == "undecided":
            return f"and an error of {rival} alone explain the residual about equally well"
        worse = f"explains the residual worse than an error of {rival} alone"
        return f"{worse}: {suspect}" if suspected else worse

    def said(self, labels: Mapping[str, str], answered: Collection[Verdict] = ()) -> list[str]:
        """A sentence on each source: its label and :meth:`words`; ``labels`` of the channels by name."""
        ones = ((one, self.words(one, labels[one.rival], answered=answered)) for one in self.sources)
        return [f"{one.label} {words} (p = {one.p_value:.2g})" for one, words in ones]

    @property
    def verdict(self) -> Verdict:
        """That of the source which, with its rival, explains most, unless a sensor that no source moves explains more.

        Of sources that one and the same sensor can be mistaken for, the one that itself explains most. Parameters that
        make up for such a sensor's error leave in other channels what looks like a source.
        """
        foremost = max(self.sources, key=lambda one: (max(one.gain, self.sensor_gains[one.rival]), one.gain))
        if self.suspect is None or self.suspect == foremost.rival:
            return foremost.verdict
        balance = foremost.gain - self.sensor_gains[self.suspect]
        return foremost.verdict if balance > STRONG else verdict_of(balance)


def verdict_of(balance: float) -> Verdict:
    """Whether a source or a sensor explains more, by the log likelihood of the one over the other."""
    return "balance" if balance > STRONG else "sensor" if balance < -STRONG else "undecided"


MEMORIES = (6 * HOUR, 72 * HOUR)
"""Two priors: a source that changes within hours, and one that changes within days [s]."""
SHARES = (0.05, 0.2)
"""Degrees of freedom per pulse at which single pulses are tested: fixed beforehand, not fitted to the recording."""
_MOST_PULSES = 336
_MOVES = 0.05
"""An output is moved by a source when its response, in units of its noise, is this share of the largest."""


def scan_sources(
    residuals: Residuals, operators: Sequence[Operator], *, left: Callable[[np.ndarray], np.ndarray] | None = None
) -> SourceTest:
    """Invert the residuals of recording and twins for every source, and weigh sources against sensors.

    Parameters
    ----------
    operators
        One for each source.
    left
        What calibration leaves of a series on the outputs, (outputs, steps, n) in and out: it has already been applied
        to the residuals, and is to the operators' responses and the sensors' errors. Without it all are as they are.
    """
    white = whitened(residuals)
    grouped = [_grouped(one) for one in operators]
    kept = [one.response if left is None else left(one.response) for one in grouped]
    problems = [
        _problems(white, white.response(response), one.edges, MEMORIES)
        for one, response in zip(grouped, kept, strict=True)
    ]
    sources: list[tuple[Operator, Inverse, float]] = []
    pulses, source_gains = [], []
    for one, smooth in zip(grouped, problems, strict=True):
        gains, taus = (np.stack(v) for v in zip(*(p.gains() for p in smooth), strict=True))
        best = int(np.argmax(gains[:, 0]))
        source_gains.append(gains.max(axis=0))
        levels = np.stack([p.solve(p.tau_for(share)) for p in smooth for share in SHARES], axis=1)
        pulses.append(levels.reshape(len(levels), -1))
        tau = taus[best, 0] or smooth[best].tau_for(SHARES[0])
        sources.append((one, smooth[best], tau))
    sensors = _sensor_gains(residuals, white, grouped[0].edges, left)
    gains_of_all = np.stack([*source_gains, *sensors.values()], axis=1)
    whole = max_test(np.sqrt(gains_of_all), upper=True)
    pulse_test = max_test(np.concatenate(pulses, axis=1))
    found, offset = [], 0
    for j, (one, problem, tau) in enumerate(sources):
        width = len(one.edges) - 1
        levels_p = pulse_test.adjusted[offset : offset + pulses[j].shape[1]].reshape(-1, width)
        offset += pulses[j].shape[1]
        solved = problem.solve(tau)
        low, high = np.quantile(solved[1:], [0.025, 0.975], axis=0)
        rival = max((k for k in sensors if k in _moved(white, one)), key=lambda k: float(sensors[k][0]))
        balance = float(source_gains[j][0] - sensors[rival][0])
        sure = min(whole.adjusted[j], whole.adjusted[len(sources) + list(sensors).index(rival)]) <= ALPHA
        found.append(
            Source(
                name=one.name,
                label=one.label,
                unit=one.unit,
                edges=one.edges,
                estimate=solved[0],
                uncertainty=problem.uncertainty(tau),
                low=low,
                high=high,
                adjusted=levels_p.min(axis=0),
                gain=float(source_gains[j][0]),
                p_value=float(whole.adjusted[j]),
                rival=residuals.names[rival],
                balance=balance,
                verdict=verdict_of(balance) if sure else "none",
                by_reading=problem.by_reading(tau),
            )
        )
    by_channel = {residuals.names[k]: float(gains[0]) for k, gains in sensors.items()}
    p_values = dict(zip(by_channel, whole.adjusted[len(sources) :], strict=True))
    suspect = max(by_channel, key=lambda name: by_channel[name])
    done = SourceTest(whole, found, by_channel, suspect if p_values[suspect] <= ALPHA else None, [], white)
    return replace(done, findings=_findings(residuals, done, list(sensors)))


def _grouped(operator: Operator) -> Operator:
    """Sum neighbouring pulses until there are few enough to decompose quickly."""
    pulses = operator.response.shape[2]
    size = -(-pulses // _MOST_PULSES)
    if size == 1:
        return operator
    cuts = np.arange(0, pulses, size)
    edges = np.append(operator.edges[:-1][cuts], operator.edges[-1])
    return Operator(
        operator.name, operator.label, operator.unit, np.add.reduceat(operator.response, cuts, axis=2), edges
    )


def _problems(white: Whitened, response: np.ndarray, edges: np.ndarray, memories: Sequence[float]) -> list[Inverse]:
    centres = (edges[1:] + edges[:-1]) / 2
    return [decompose(white.rows, response, centres, memory) for memory in memories]


def _sensor_gains(
    residuals: Residuals, white: Whitened, edges: np.ndarray, left: Callable[[np.ndarray], np.ndarray] | None
) -> dict[int, np.ndarray]:
    """Gains (rows,) by output of an error on that output alone, as free to move as a source is."""
    within = (residuals.middle[:, None] > edges[:-1]) & (residuals.middle[:, None] <= edges[1:])
    found = {}
    for k in white.channels:
        alone = np.zeros((len(residuals.names), *within.shape))
        alone[k] = within
        alone = alone if left is None else left(alone)
        problems = _problems(white, white.response(alone), edges, MEMORIES)
        found[k] = np.max([p.gains()[0] for p in problems], axis=0)
    return found


def _moved(white: Whitened, operator: Operator) -> list[int]:
    """Outputs that a source moves noticeably, in units of their noise: their sensors can be mistaken for it.

    By the source itself: what parameters do to other outputs to make up for it is no reason to suspect their sensors.
    """
    size = {
        k: float(np.linalg.norm(operator.response[k])) / s for k, s in zip(white.channels, white.scales, strict=True)
    }
    return [k for k, one in size.items() if one >= _MOVES * max(size.values())]


def _findings(residuals: Residuals, done: SourceTest, sensors: list[int]) -> list[Finding]:
    found: list[Finding] = []
    sources, whole = done.sources, done.test

    def suspected(name: str, against: Source, verdict: Verdict, balance: float) -> None:
        k = list(residuals.names).index(name)
        column = len(sources) + sensors.index(k)
        named = any(f.kind == "sensor" and f.channel == name for f in found)
        if whole.adjusted[column] <= ALPHA and verdict in ("sensor", "undecided") and not named:
            found.append(
                Finding(
                    kind="sensor",
                    channel=name,
                    label=residuals.labels[k],
                    cell={"against": against.name},
                    p_value=float(whole.adjusted[column]),
                    direction=_words(done, name, against, verdict),
                    size=-balance,
                    unit="1",
                    t=float(whole.t[column]),
                )
            )

    for j, one in enumerate(sources):
        if one.needed and one.verdict in ("balance", "undecided"):
            peak = int(np.argmax(np.abs(one.estimate)))
            day = (one.edges[peak] - one.edges[0]) / DAY
            found.append(
                Finding(
                    kind="source",
                    channel=one.name,
                    label=one.label,
                    cell={"period": f"largest on day {day:.2f}", "first_s": f"{one.edges[peak]:.0f}"},
                    p_value=one.p_value,
                    direction="the model lacks a gain" if one.estimate[peak] > 0 else "the model lacks a loss",
                    size=float(one.estimate[peak]),
                    unit=one.unit,
                    t=float(whole.t[j]),
                )
            )
    for one in sorted(sources, key=lambda one: -one.gain):  # a sensor beside the best of what it can be mistaken for
        suspected(one.rival, one, one.verdict, one.balance)
    if done.suspect is not None:
        most = max(sources, key=lambda one: one.gain)
        balance = most.gain - done.sensor_gains[done.suspect]
        suspected(done.suspect, most, verdict_of(balance), balance)
    return found


def _words(done: SourceTest, sensor: str, against: Source, verdict: Verdict) -> str:
    """What an error of a sensor explains beside a source; and if that is little, what explains the residual better."""
    than = "better than" if verdict == "sensor" else "about as well as"
    said = f"an error of this channel alone explains the residual {than} {against.label}"
    if not against.needed:
        said += ", of which none is needed"
    better = [one for one in done.sources if one.needed and one.gain - done.sensor_gains[sensor] > STRONG]
    if better:
        said += f", but worse than {max(better, key=lambda one: one.gain).label}"
    return said
