"""Chains whose stationary distribution is the posterior of all that is unknown about a recording.

Unknowns are parameters, constants and the uniform numbers that the occupancy sampler makes an occupancy of: their prior
is uniform, so that a move which is symmetric in them needs the likelihood alone. A simulation costs far more than a
matrix product. So each step runs a short chain on a surrogate, linear in persons and quadratic in all else, and the
simulator decides whether its end is accepted (delayed acceptance, Christen and Fox 2005; with a chain in the first
stage, Liu 2001, section 9.4.3): with the surrogate's chain reversible for prior times surrogate likelihood L*,

    accept with probability min(1, L(new) L*(old) / (L(old) L*(new)))

leaves the exact posterior invariant, however bad the surrogate. Moves on the surrogate choose among candidates that
have been drawn exchangeably with the present state (Tjelmeland 2004). A move of persons takes the parameters along with
it, as the linearisation says that they must follow: what is held is x - A q, q: mean persons over intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from datagen.driving.occupancy import Draw, lead_days, occupancy_means, occupancy_prior
from shared.signals import Occupancy

HALF = np.sqrt(3.0)
"""Half-width of a uniform distribution of variance one."""
CANDIDATES = 32
"""Of a move on the surrogate."""
LENGTHS = (8, 16, 32)
"""Moves on the surrogate between two simulations: many go far, few are accepted more often."""
DESIGN, ROUNDS = 1.5, 3
"""Of the fit: simulations for each feature in a round, and rounds. The first knows the linearisation alone."""
RIDGE = 0.3
"""Of that fit, whose features have about unit size."""
OF_UNKNOWNS = 0.25
"""Share of the moves that are of unknowns alone."""
LEAST = 0.05
"""Directions of the readings in which the prior moves them by less, in standard deviations of noise, are left out."""


@dataclass(frozen=True, eq=False)
class State:
    """Values of the unknowns: ``x`` (unknowns,) in prior standard deviations about the prior's middle; ``persons``."""

    x: np.ndarray
    persons: Draw | None


@dataclass(frozen=True, eq=False)
class Problem:
    """A recording and what it depends on; readings are in standard deviations of their noise.

    The first ``uniform`` unknowns are uniform, the others normal. ``outputs`` gives the readings (readings,) of a
    state; ``by_unknown`` (readings, unknowns) and ``by_person`` (readings, intervals) are their derivatives about the
    truth. Persons are means over intervals between ``edges`` [s].
    """

    truth: State
    readings: np.ndarray
    uniform: int
    outputs: Callable[[State], np.ndarray]
    by_unknown: np.ndarray
    by_person: np.ndarray
    spec: Occupancy | None = None
    edges: np.ndarray | None = None

    def log_prior(self, x: np.ndarray) -> np.ndarray:
        """Logarithm of the prior density of unknowns (n, unknowns), but for a constant, shape (n,)."""
        inside = (np.abs(x[:, : self.uniform]) <= HALF).all(axis=1)
        return np.where(inside, -0.5 * (x[:, self.uniform :] ** 2).sum(axis=1), -np.inf)

    def means(self, persons: Draw | None, reach: slice | None = None) -> np.ndarray:
        """Mean persons over the intervals of a draw (intervals,) or of many (draws, intervals), some edges or all."""
        if persons is None or self.spec is None or self.edges is None:
            return np.zeros(0)
        if persons.rows.ndim == 2:
            return self.means(Draw(persons.usual[None], persons.rows[None], persons.days), reach)[0]
        return occupancy_means(self.spec, persons, self.edges if reach is None else self.edges[reach])


@dataclass(frozen=True, eq=False)
class Chain:
    """What a chain visited.

    ``x`` (steps, unknowns); ``acceptance``, of proposals that the simulator saw; ``linearised`` posterior variance of
    each unknown (unknowns,) of the same recording, 1 is the prior; ``last``, the state that it ends in.
    """

    x: np.ndarray
    acceptance: float
    linearised: np.ndarray
    last: State


class _Surrogate:
    """Readings as a quadratic in the unknowns and linear in mean persons, with the moves on it.

    Readings are in a basis that leaves out what nothing moves; a ``part`` is what persons add to them.
    """

    def __init__(self, problem: Problem, rng: np.random.Generator) -> None:
        self.problem, self.rng = problem, rng
        by_unknown, by_person = problem.by_unknown, problem.by_person
        self.centre, self.q = problem.truth.x, problem.means(problem.truth.persons)
        spread = np.zeros((0, len(problem.readings)))
        if problem.spec is not None and problem.edges is not None and problem.truth.persons is not None:
            draws = occupancy_prior(problem.spec, problem.edges, 1000, 0)
            away = (draws - draws.mean(axis=0)) / np.sqrt(len(draws))
            spread = away @ by_person.T
            begin, end = (86400.0 * (problem.truth.persons.days + k) for k in (0, 1 + lead_days(problem.spec)))
            first = np.maximum(np.searchsorted(problem.edges, begin, side="right") - 1, 0)
            last = np.searchsorted(problem.edges, end) + 1
            self.reach = [slice(*ends) for ends in zip(first, np.maximum(last, first + 2), strict=True)]
            effect = np.linalg.norm(away, axis=0) * np.linalg.norm(by_person, axis=0)
            weight = np.array([effect[one.start : one.stop - 1].sum() for one in self.reach])
            self.often = weight / weight.sum() if weight.any() else np.full(len(weight), 1 / len(weight))
        unit = np.eye(by_unknown.shape[1])
        covariance = np.eye(len(problem.readings)) + spread.T @ spread
        self.posterior = np.linalg.inv(unit + by_unknown.T @ np.linalg.solve(covariance, by_unknown))
        given = np.linalg.inv(unit + by_unknown.T @ by_unknown)  # where persons are known
        self.follow = -by_person.T @ by_unknown @ given
        self.root, self.given = np.linalg.cholesky(self.posterior), np.linalg.cholesky(given)
        self.to_z = np.linalg.inv(self.root).T
        _, size, ways = np.linalg.svd(np.concatenate([self.root.T @ by_unknown.T, spread]), full_matrices=False)
        self.basis = ways[size > LEAST].T
        self.by_person = by_person.T @ self.basis
        self.target = problem.readings @ self.basis
        self.pairs = np.triu_indices(len(unit))
        self.fitted = np.zeros((1 + len(unit) + len(self.pairs[0]), self.basis.shape[1]))
        self.fitted[0] = problem.outputs(problem.truth) @ self.basis
        self.fitted[1 : len(unit) + 1] = self.root.T @ by_unknown.T @ self.basis
        self.linear = self.fitted

    def features(self, x: np.ndarray) -> np.ndarray:
        """One, unknowns (n, unknowns) in linearised posterior deviations, and products of two, shape (n, features)."""
        z = (x - self.centre) @ self.to_z
        first, second = self.pairs
        return np.concatenate([np.ones((len(z), 1)), z, z[:, first] * z[:, second]], axis=1)

    def fit(self, states: Sequence[State], outputs: Sequence[np.ndarray]) -> None:
        """Fit to simulations what the linearisation does not say."""
        design = self.features(np.array([one.x for one in states]))
        part = np.array([self.part(self.problem.means(one.persons)) for one in states])
        left = np.array(outputs) @ self.basis - design @ self.linear - part
        gram = design.T @ design + RIDGE * np.eye(design.shape[1])
        self.fitted = self.linear + np.linalg.solve(gram, design.T @ left)

    def part(self, q: np.ndarray) -> np.ndarray:
        """What mean persons (..., intervals) do to the readings, in the basis."""
        return (q - self.q) @ self.by_person

    def log_likelihood(self, x: np.ndarray, part: np.ndarray) -> np.ndarray:
        """That of the surrogate (n,), but for a constant, of unknowns (n, unknowns) and what persons do (n, basis)."""
        predicted = self.features(x) @ self.fitted
        predicted += part
        predicted -= self.target
        return -0.5 * np.einsum("ij,ij->i", predicted, predicted)

    def after(self, state: State, moves: int) -> tuple[State, np.ndarray]:
        """A state, and what its persons do, after random moves, reversible for prior times surrogate likelihood."""
        part = self.part(self.problem.means(state.persons))
        for _ in range(moves):
            if state.persons is None or self.rng.random() < OF_UNKNOWNS:
                state = self._unknowns(state, part)
            else:
                state, part = self._persons(state, part, state.persons)
        return state, self.part(self.problem.means(state.persons))

    def _unknowns(self, state: State, part: np.ndarray) -> State:
        root = self.root if self.rng.random() < 0.2 else self.given
        steps = self.rng.choice([0.2, 0.5, 1.0]) * self.rng.standard_normal((CANDIDATES + 1, len(state.x))) @ root.T
        x = state.x + steps[0] + steps[1:]  # exchangeable, given a point between
        x[0] = state.x
        return replace(state, x=x[self._choose(x, np.broadcast_to(part, (len(x), len(part))))])

    def _persons(self, state: State, part: np.ndarray, persons: Draw) -> tuple[State, np.ndarray]:
        rng, problem = self.rng, self.problem
        usual = rng.random() < 0.05
        day = int(rng.choice(len(self.often), p=self.often))
        numbers = persons.usual if usual else persons.rows[day]
        count = CANDIDATES // 2 if usual else CANDIDATES
        some = rng.random(len(numbers)) < rng.choice([1.5 / len(numbers), 0.4, 1.0])
        new = rng.random((count, len(numbers)))
        if rng.random() < 0.6:  # a little, from a point between
            steps = 10 ** rng.uniform(-2, -0.3) * rng.standard_normal((count + 1, len(numbers)))
            new = (numbers + steps[0] + steps[1:]) % 1.0
        new = np.where(some, new, numbers)
        new[0] = numbers
        if usual:
            reach = slice(0, len(self.q) + 1)
            many = Draw(new, np.broadcast_to(persons.rows, (count, *persons.rows.shape)), persons.days)
        else:
            reach = self.reach[day]
            many = Draw(np.broadcast_to(persons.usual, (count, 3)), new[:, None], persons.days[[day]])
        change = problem.means(many, reach)
        change -= change[0].copy()
        columns = slice(reach.start, min(reach.stop, len(self.q) + 1) - 1)
        x = state.x + change @ self.follow[columns]
        parts = part + change @ self.by_person[columns]
        chosen = self._choose(x, parts)
        if usual:
            persons = replace(persons, usual=new[chosen])
        else:
            rows = persons.rows.copy()
            rows[day] = new[chosen]
            persons = replace(persons, rows=rows)
        return State(x[chosen], persons), parts[chosen]

    def _choose(self, x: np.ndarray, part: np.ndarray) -> int:
        weight = self.problem.log_prior(x)
        possible = np.flatnonzero(np.isfinite(weight))
        weight[possible] += self.log_likelihood(x[possible], part[possible])
        return int(np.argmax(weight + self.rng.gumbel(size=len(weight))))


def sample(problem: Problem, steps: int, rng: np.random.Generator) -> Chain:
    """A chain of so many steps, each with a simulation, after the rounds that the surrogate is fitted in.

    It begins at the truth, itself a draw from the posterior given its recording, so nothing is left out in search of
    the likely. It is stationary but for what the surrogate, linearised about the truth, knows.
    """
    surrogate, n = _Surrogate(problem, rng), len(problem.truth.x)
    states: list[State] = []
    outputs: list[np.ndarray] = []
    for count in range(ROUNDS):
        state = problem.truth
        for _ in range(int(DESIGN * len(surrogate.fitted))):
            if count:
                state, _ = surrogate.after(state, LENGTHS[0])
            else:  # unknowns from the linearised posterior
                x = problem.truth.x + surrogate.root @ rng.standard_normal(n)
                x[: problem.uniform] = np.clip(x[: problem.uniform], -HALF, HALF)
                state = replace(problem.truth, x=x)
            states.append(state)
            outputs.append(problem.outputs(state))
        surrogate.fit(states, outputs)
    return _run(problem, surrogate, problem.truth, steps)


def _run(problem: Problem, surrogate: _Surrogate, state: State, steps: int) -> Chain:
    def error(state: State, part: np.ndarray) -> float:
        """Of the surrogate's log likelihood."""
        misfit = float(((problem.readings - problem.outputs(state)) ** 2).sum())
        return -0.5 * misfit - float(surrogate.log_likelihood(state.x[None], part[None])[0])

    present = error(*surrogate.after(state, 0))
    visited, accepted = np.empty((steps, len(state.x))), 0
    for step in range(steps):
        proposal, part = surrogate.after(state, int(surrogate.rng.choice(LENGTHS)))
        proposed = error(proposal, part)
        if np.log(surrogate.rng.random()) < proposed - present:
            state, present, accepted = proposal, proposed, accepted + 1
        visited[step] = state.x
    return Chain(visited, accepted / max(steps, 1), np.diag(surrogate.posterior), state)


def effective(x: np.ndarray) -> np.ndarray:
    """Effective sample size of each column of a chain (steps, unknowns), shape (unknowns,); 0 where it never moved.

    Geyer's initial monotone positive sequence (1992, Statistical Science 7:473).
    """
    n = len(x)
    centred = x - x.mean(axis=0)
    spectrum = np.fft.rfft(centred, 2 * n, axis=0)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[:n] / n
    found = np.zeros(x.shape[1])
    for k in np.flatnonzero(np.ptp(x, axis=0) > 0):
        rho = covariance[:, k] / covariance[0, k]
        pairs = rho[: n // 2 * 2].reshape(-1, 2).sum(axis=1)
        stop = int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)
        found[k] = n / max(2 * np.minimum.accumulate(pairs[:stop]).sum() - 1, 1e-9)
    return np.minimum(found, n)
