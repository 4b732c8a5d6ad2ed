"""Fitting: the most plausible unknowns of a problem, and how sure they are.

A round linearises the simulation by the nuisance (:mod:`.nuisance`), which gives the residual its covariance
S, and solves

    minimise |S^(-1/2) (measured - simulated(z))|^2 + |z|^2

with scipy's bounded trust-region least squares. S and the most likely nuisance are then renewed at the new optimum,
until it stays. Alone, that would be the mode over unknowns and nuisance together, which is far from the truth where
there are many nuisances that unknowns multiply (Neyman and Scott 1948). Integrated out, the nuisance adds log|S| to
what is minimised (Laplace), as a parabola from :mod:`diagnosis.fitting.fit`.

How the covariance of a residual depends on the unknowns: the part of a marginal likelihood that a mode lacks.

With the nuisance integrated out the residual's covariance is S = I + B B', and B, the answer of the outputs to it,
depends on the unknowns. Of the likelihood's log|S| / 2 this gives the gradient tr(M_k), with M_k = B' S^-1 dB/dz_k,
and tr(M_k M_l), by which the expected information exceeds that of the residual's mean alone (Fisher information of a
Gaussian with mean and covariance: Mardia and Marshall 1984, Biometrika 71, 135-146). Without it an air volume comes out
too small: a smaller room follows persons faster, and can make more of what is not known of when they came.

How sure a fit is, beyond the curvature at its mode.

- **Doubt**: parameters also make up for what the model is not, and a fit's own covariance knows no such. What a model
  takes for granted is among the unknowns (:mod:`diagnosis.fitting.runs`), but not all of it: weather that was read
  with an error, noise that is slower than it looks. Rooms of an opened blind check without an effect, whose walls are
  finer than the model's, told what that takes: the fit's own standard deviations were too small by 1.6 where persons
  were counted, by 1.2 in replay.
- **Swings**: where nobody counted the persons, each round draws its straight lines about other histories of the room,
  and a fit may swing for ever: small room and many persons, large room and few. From some round on lines are drawn
  about the mean of the last optima (averaged fixed-point iteration: Krasnoselskii, Uspekhi Mat. Nauk 10, 1955); what
  still moves in the end is not known better than by how much it moves.
- **Stretches**: a posterior that is no parabola has its spread by simulations, not by curvature at the mode alone.

Leaps of the nuisance, where a straight line does not say which way is up.

A controller that saturates hides who is in the room: above some number of persons the ventilation holds the CO2, one
more or less leaves no trace, and a line through such a point never leads back to an empty room. Where readings of an
hour are far from the simulation, a few other histories of the hours before are simulated as they are, and kept where
they make the readings more plausible. Without this, fits in rooms whose persons nobody counted end in local optima,
whose misfit looks like a gap.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import least_squares

from datagen.driving.tables import SNAP
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import factor
from diagnosis.fitting.linear import Linearisation, responses
from diagnosis.fitting.noise import NoiseModel, estimated
from diagnosis.fitting.nuisance import SPACING, Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.recording import HOUR
from shared.errors import SimulationError, TimeUp
from shared.logs import logger

_log = logger(__name__)

_HOPELESS = 1e3
"""Standardised residual of a simulation that failed."""


def solved(
    problem: Problem, z: np.ndarray, around: Linearisation, bent: Determinant | None, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """The optimum with a given covariance, and the Jacobian of the residual there.

    Parameters
    ----------
    z
        Where to begin, shape (unknowns,).
    around
        What gives the residual its covariance.
    bent
        The log determinant as a parabola; without, it is taken for constant.
    most
        Evaluations at most.

    Returns
    -------
    tuple
        Unknowns (unknowns,) and the Jacobian (readings, unknowns).
    """
    low, high = problem.bounds
    inner = np.clip(z, low + 1e-6 * (high - low), high - 1e-6 * (high - low)) if np.isfinite(high - low).all() else z
    inner = np.where(np.isfinite(inner), inner, z)
    size = problem.size
    readings = int(problem.observed.sum())

    centre = np.zeros(size) if bent is None else -bent.slope
    rows = np.eye(size) if bent is None else np.vstack([np.eye(size), bent.root])

    def rest(z: np.ndarray) -> list[np.ndarray]:
        """Of the prior and the determinant: squares that add up to |z|^2 + log|S|, but for a constant."""
        return [z - centre] if bent is None else [z - centre, bent.root @ (z - bent.z)]

    def residual(z: np.ndarray) -> np.ndarray:
        try:
            found = problem.residuals(z, around)
        except FAILURES:
            found = np.full(readings, _HOPELESS)
        return np.concatenate([found, *rest(z)])

    places = list(problem.unknown.places_of_constants)
    held: list[np.ndarray] = []

    def jacobian(z: np.ndarray) -> np.ndarray:
        made = problem.jacobian(z, around, without=places if held else ())
        if not held:  # what constants do hardly changes on the way: once is enough
            held.append(made[:, places])
        made[:, places] = held[0]
        return np.vstack([made, rows])

    found = least_squares(residual, inner, jacobian, bounds=(low, high), max_nfev=most, ftol=1e-4, xtol=1e-4, gtol=1e-4)
    return found.x, found.jac[:readings]


WIDTH = 0.2
"""Of the difference in an unknown [prior standard deviations]."""


@dataclass(frozen=True)
class Determinant:
    """What log|S| / 2 is near a point.

    At ``z`` (unknowns,): its ``slope`` (unknowns,), and a ``root`` R (unknowns, unknowns) of what the information gains
    by it, which is R' R.
    """

    z: np.ndarray
    slope: np.ndarray
    root: np.ndarray


def determinant(problem: Problem, around: Linearisation) -> Determinant:
    """Simulate the answers to the nuisance beside ``around``, for each unknown.

    Only pulses within the recording count: how the answer to what came before it depends on unknowns does not matter.
    An unknown whose simulations fail on both sides is taken to change nothing.
    """
    size = problem.size
    within = problem.nuisance.recorded
    if not within.any():
        return Determinant(around.z, np.zeros(size), np.zeros((size, size)))
    some = problem.nuisance.only(within).shortened(around.lasting)  # as long as those they are compared with
    weight = around.marginal.inverse(around.marginal.by_unknown).T
    wide = weight.shape[0] > weight.shape[1]
    low, high = problem.bounds

    def answer(z: np.ndarray) -> np.ndarray:
        def simulate(pulses: list[np.ndarray]) -> list[np.ndarray]:
            cases = []
            for one in pulses:
                heights = around.heights.copy()
                heights[within] += one
                cases.append((z, heights))
            return problem.simulate_all(cases)

        return responses(some, simulate, problem.simulate(z, around.heights), problem.time)

    products = []
    for k in range(size):
        change = np.zeros_like(around.response)
        for way in (WIDTH, -WIDTH):
            z = around.z.copy()
            z[k] += way
            if not low[k] <= z[k] <= high[k]:
                continue
            with suppress(*FAILURES):
                change[:, :, within] = (answer(z) - around.response[:, :, within]) / way
                break
        derivative = problem.standardised(problem.nuisance.by_unknown(change))
        # traces of products are the same whichever factor comes first: of two, the smaller matrix
        products.append(derivative @ weight if wide else weight @ derivative)
    flat = np.stack([one.ravel() for one in products])
    gained = flat @ np.stack([one.T.ravel() for one in products]).T
    values, vectors = eigh(0.5 * (gained + gained.T))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return Determinant(around.z, np.array([np.trace(one) for one in products]), root)


DOUBT = 1.5
"""A recording's information on the unknowns counts for 1 / DOUBT^2: its standard deviations are so much larger."""


def doubted(covariance: np.ndarray) -> np.ndarray:
    """Covariance (unknowns, unknowns) of a posterior whose prior is standard normal, its recording doubted.

    Correlations are those of the doubted posterior as a whole, standard deviations those of :func:`doubted_sd`: as a
    whole the prior holds together what the recording hardly tells apart, and intervals came out too narrow.
    """
    prior = np.eye(len(covariance))
    whole = np.linalg.inv(prior + (np.linalg.inv(covariance) - prior) / DOUBT**2)
    scale = doubted_sd(np.sqrt(np.diag(covariance))) / np.sqrt(np.diag(whole))
    return np.asarray(whole * np.outer(scale, scale))


def doubted_sd(sd: np.ndarray) -> np.ndarray:
    """Standard deviations (unknowns,) of such a posterior, each by itself: the prior keeps its say."""
    told = np.maximum(np.asarray(sd) ** -2.0 - 1.0, 0.0)
    return np.asarray(1.0 / np.sqrt(1.0 + told / DOUBT**2))


SWINGING = 6
"""Rounds after which a fit that has not come to rest is taken to swing."""
LAST = 4
"""Optima that are averaged."""


def between(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Where to draw the next lines (unknowns,): at the last optimum ``z``, or between those of a fit that swings."""
    return np.asarray(np.mean(path[-LAST:], axis=0)) if round_ >= SWINGING and path else z


def swung(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Covariance (unknowns, unknowns) about ``z`` of the last optima of a fit that still swings; zero before that."""
    if round_ < SWINGING or len(path) < 2:
        return np.zeros((len(z), len(z)))
    off = np.array(path[-LAST:]) - z
    return np.asarray(off.T @ off / len(off))


ASIDE = 1.5
"""How far from the mode the posterior is looked at [standard deviations by curvature]."""
FLAT = 0.05
"""A loss that rises less than this counts as having risen so much: what is flat is stretched to 4.7 times at most."""


def stretched(
    problem: Problem, z: np.ndarray, around: Linearisation, information: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Covariance around a mode, shape (unknowns, unknowns), with the information by curvature given.

    ``slope`` (unknowns,) is that of log|S| / 2 (:func:`determinant`), which the loss of a round lacks: without
    it the mode would not be where the loss is least.

    Along each of its principal axes the loss is simulated on both sides. Where it rises less than the parabola, the
    axis is as long as the flatter side says; where it rises more, it stays: errors are not to be understated.
    """
    values, vectors = eigh(information)
    values = np.maximum(values, 1.0)  # the prior's, of which rounding may have left less
    low, high = problem.bounds
    mode = z

    def loss(z: np.ndarray) -> float:
        residual = problem.residuals(z, around)
        return 0.5 * float(residual @ residual + z @ z) + float(slope @ (z - mode))

    base, lengths = loss(z), values**-0.5
    for k, axis in enumerate(vectors.T):
        for side in (ASIDE, -ASIDE):
            step = np.clip(z + side * values[k] ** -0.5 * axis, low, high) - z
            size = float(np.linalg.norm(step))
            if size * values[k] ** 0.5 < 0.2 * ASIDE:  # at a bound
                continue
            try:
                rise = max(loss(z + step) - base, FLAT)
            except FAILURES:
                continue
            lengths[k] = max(lengths[k], size / np.sqrt(2 * rise))
    # nothing is less sure than before the recording
    return np.asarray((vectors * np.minimum(lengths, 1.0) ** 2) @ vectors.T)


FAR = 4.0
"""A reading this far from the simulation [standard deviations of its noise] is worth a leap."""
BEFORE = 2 * HOUR
"""Persons so long before a step may have caused what is seen in it."""
AFTER = 12 * HOUR
"""So long after it a history is judged."""
WORTH = 10.0
"""What it must gain in squared standardised residuals: a few, for having been chosen among some twenty."""
TIMES = 2
"""How often: a second leap mends what the first one moved into the next hours."""
LOOSE = 0.05
"""Share of its prior spread by which a height may be off when it is expressed in standard normal unknowns."""


def leapt(problem: Problem, z: np.ndarray, nuisance: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """A nuisance (nuisance unknowns,) that is at least as plausible at ``z``, given its simulated ``outputs``."""
    guessed = problem.nuisance.guessed
    if not guessed.any():
        return nuisance
    cost = joint_cost(problem, nuisance, outputs)
    for _ in range(TIMES):
        heights = _other(problem, z, problem.nuisance.heights(nuisance), outputs, guessed)
        if heights is None:
            break
        other = unknowns_of(problem.nuisance, heights)
        try:
            found = problem.simulate(z, problem.nuisance.heights(other))
        except FAILURES:
            break
        if joint_cost(problem, other, found) >= cost:
            break
        nuisance, outputs, cost = other, found, joint_cost(problem, other, found)
    return nuisance


def unknowns_of(nuisance: Nuisance, heights: np.ndarray) -> np.ndarray:
    """Standard normal unknowns that give about these heights (pulses,): the most plausible within :data:`LOOSE`."""
    weight = 1 / (LOOSE * np.maximum(nuisance.sd, 1e-9 * max(nuisance.sd.max(), 1e-300))) ** 2
    weighted = nuisance.factor.T * weight
    system = weighted @ nuisance.factor + np.eye(nuisance.factor.shape[1])
    return np.asarray(np.linalg.solve(system, weighted @ (heights - nuisance.mean)))


def joint_cost(problem: Problem, nuisance: np.ndarray, outputs: np.ndarray) -> float:
    """Squares of standardised residuals and nuisance: minus twice their log density, but for a constant."""
    left = problem.standardised(problem.measured - outputs)
    return float(left @ left + nuisance @ nuisance)


def _squares(problem: Problem, outputs: np.ndarray) -> np.ndarray:
    """Squared standardised residuals by output and step, shape (outputs, steps); zero where nothing was observed."""
    left = (problem.measured - outputs) / problem.noise.sd[:, None]
    return np.asarray(np.where(problem.observed, left, 0.0) ** 2)


def _other(
    problem: Problem, z: np.ndarray, heights: np.ndarray, outputs: np.ndarray, guessed: np.ndarray
) -> np.ndarray | None:
    """Heights that fit better around the worst steps, at most one a day; None where there are none."""
    squares = _squares(problem, outputs)
    total, time, step = squares.sum(axis=0), problem.time, problem.recording.step
    worst = _worst(np.where((squares > FAR**2).any(axis=0), total, 0.0), time)
    if not worst:
        return None
    pulses = problem.nuisance
    near = [guessed & (pulses.end > time[k] - step - BEFORE + SNAP) & (pulses.begin < time[k] - SNAP) for k in worst]
    cases = list(_histories(pulses, heights, near, [guessed & (pulses.end > time[k] - step + SNAP) for k in worst]))
    outcomes = problem.simulate_each([(z, case) for case in cases])
    begins = [time[k] - step - BEFORE for k in worst]
    found = heights.copy()
    for one, begin, end in zip(near, begins, [*begins[1:], np.inf], strict=True):
        rows = (time > begin + SNAP) & (time <= min(end, begin + BEFORE + step + AFTER) + SNAP)
        best = total[rows].sum() - WORTH
        for case, outcome in zip(cases, outcomes, strict=True):
            if isinstance(outcome, SimulationError):
                continue
            value = _squares(problem, outcome)[:, rows].sum()
            if value < best:
                best = value
                found[one] = case[one]
    return None if np.array_equal(found, heights) else found


def _worst(squares: np.ndarray, time: np.ndarray) -> list[int]:
    """The steps with the largest squares that are not zero, at least a day apart, in their order."""
    found: list[int] = []
    for k in np.argsort(-squares, kind="stable"):
        if squares[k] <= 0:
            break
        if all(abs(time[k] - time[other]) >= SPACING - SNAP for other in found):
            found.append(int(k))
    return sorted(found)


def _histories(
    pulses: Nuisance, heights: np.ndarray, near: list[np.ndarray], late: list[np.ndarray]
) -> Iterator[np.ndarray]:
    """Other heights (pulses,), in all spans at once: of all pulses, of the last ones, of each one alone."""
    mean, sd = pulses.mean, pulses.sd
    nobody, usual, more, many = (np.maximum(one, 0.0) for one in (0 * mean, mean, mean + sd, mean + 2 * sd))
    for level in (nobody, usual, more, many):
        for some in (near, [one & other for one, other in zip(near, late, strict=True)]):
            yield np.where(np.any(some, axis=0), level, heights)
    members = [np.flatnonzero(one) for one in near]
    for place in range(max(len(one) for one in members)):
        for level in (nobody, 0.3 * heights, 0.6 * heights, more, many):
            case = heights.copy()
            some = [one[place] for one in members if place < len(one)]
            case[some] = level[some]
            yield case


LEAST_FELT = 0.1
"""What moves no reading by more than this share of its noise, with its whole prior spread, is no longer followed."""


def pruned(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """The same problem without history and changes within steps that no reading feels, and its linearisation."""
    nuisance = problem.nuisance
    moved = np.abs(around.response) * nuisance.sd / problem.noise.sd[:, None, None]
    keep = nuisance.guessed | (moved.max(axis=(0, 1), initial=0.0) > LEAST_FELT)
    other = problem.with_nuisance(nuisance.only(keep))
    used = np.abs(nuisance.factor[keep]).any(axis=0)
    response = around.response[:, :, keep]
    return other, Linearisation(
        around.z,
        around.nuisance[used],
        around.heights[keep],
        around.outputs,
        response,
        other.marginal(response),
        around.lasting,
    )


SHARES = (1.0, 0.5, 0.2)
STAYS = 0.03
"""Outputs stay where they move by less than this share of their noise [standard deviations]: no score shows it."""


def renewed(problem: Problem, z: np.ndarray, around: Linearisation, *, leaps: bool = False) -> Linearisation:
    """Linearise a problem at ``z`` and at the nuisance that is most likely there.

    Of the way from the old nuisance to the new one only as much is gone as makes the measurements more plausible: a
    controller that saturates bends the straight line. With ``leaps`` what the line cannot see is tried as well.
    """
    target = problem.likely_nuisance(z, around)
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for share in SHARES:
        nuisance = around.nuisance + share * (target - around.nuisance)
        try:
            outputs = problem.simulate(z, problem.nuisance.heights(nuisance))
        except FAILURES:
            continue
        cost = joint_cost(problem, nuisance, outputs)
        if best is not None and cost > best[0]:
            break
        best = cost, nuisance, outputs
    if best is None:
        return problem.linearise(z, around.nuisance)
    _, nuisance, outputs = best
    return problem.linearise(z, leapt(problem, z, nuisance, outputs) if leaps else nuisance)


def most_likely(problem: Problem, z: np.ndarray, rounds: int = 1) -> tuple[Linearisation, np.ndarray]:
    """A problem linearised at ``z`` and its most likely nuisance, and its outputs there (outputs, steps).

    Parameters
    ----------
    rounds
        How often it is linearised anew at most; fewer, once the outputs stay as they are (:data:`STAYS`).
    """
    around = problem.linearise(z)
    outputs = around.outputs
    for k in range(rounds):
        around = renewed(problem, z, around, leaps=k > 0)
        before, outputs = outputs, problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
        if k and np.sqrt(np.mean(problem.standardised(outputs - before) ** 2)) < STAYS:
            break
    return around, outputs


ROUNDS = 16
MOVED = 0.25
"""An optimum that moves less than this between rounds [posterior standard deviations] stays."""
NEAR = 3.0
"""One that moves less than this is near enough for the log determinant to matter."""
LEAPING = 15.0
"""After a round that moved less than this the nuisance may leap: before, the unknowns are what is wrong."""
REUSED = 1.0
"""The parabola of the log determinant is kept for moves up to this [posterior standard deviations]."""


@dataclass(frozen=True)
class Fit:
    """What a fit found.

    Attributes
    ----------
    z
        Unknowns at the optimum, shape (unknowns,).
    covariance
        Of the posterior there, shape (unknowns, unknowns): see :mod:`diagnosis.fitting.fit`.
    cost
        Half the sum of squares of the marginal standardised residual and of ``z``.
    log_likelihood
        Of the measurements at the optimum, the nuisance integrated out.
    log_evidence
        The unknowns integrated out as well (Laplace).
    residual
        Marginal standardised residual, shape (readings,).
    around
        The linearisation by the nuisance at the optimum.
    problem
        The problem as it was fitted in the end: with estimated noise, without history that nobody feels.
    at_bound
        Names of unknowns that lie on their bounds.
    converged
        Whether the last round left the optimum where it was.
    simulations, seconds
        What it took.
    """

    z: np.ndarray
    covariance: np.ndarray
    cost: float
    log_likelihood: float
    log_evidence: float
    residual: np.ndarray
    around: Linearisation
    problem: Problem
    at_bound: tuple[str, ...]
    converged: bool
    simulations: int
    seconds: float

    @property
    def sd(self) -> np.ndarray:
        """Posterior standard deviations of the unknowns, shape (unknowns,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def fit(
    problem: Problem,
    starts: Sequence[np.ndarray] | None = None,
    *,
    rounds: int = ROUNDS,
    estimate_noise: bool = False,
) -> Fit:
    """Fit a problem from one or several starts.

    Parameters
    ----------
    starts
        Each (unknowns,); the middle of the prior if none is given. All are fitted with the covariance at the first;
        the best of them goes on.
    rounds
        How often the nuisance's part of the covariance is renewed at most.
    estimate_noise
        Estimate a slow error of each output and by how much its noise exceeds the given one.

    Raises
    ------
    SimulationError
        If the simulation fails at every start.
    TimeUp
        If the time was up before the first round had ended; after that, a fit ends with the round before.
    """
    began, counted = time.perf_counter(), problem.simulations
    starts = [np.zeros(problem.size)] if starts is None or not len(starts) else [np.asarray(s, float) for s in starts]
    problem, around = pruned(problem, _first(problem, starts))
    z = _best_start(problem, starts, around)
    moved, converged, near, done = np.inf, False, False, 0
    path: list[np.ndarray] = []
    bent, information = None, np.eye(problem.size)
    round_ = 0
    try:
        for round_ in range(rounds):
            problem.runner.reached(round_ / rounds)
            z = between(path, z, round_)
            around = renewed(problem, z, around, leaps=moved < LEAPING)
            before = z
            if near and (bent is None or _far(z, bent.z, information) > REUSED):
                bent = determinant(problem, around)
            z, jacobian = solved(problem, z, around, bent, 4 if near else 8)
            information = np.eye(problem.size) + jacobian.T @ jacobian
            moved = _far(z, before, information)
            done += 1
            path += [z] if near else []
            stays, near = near and moved < MOVED, near or moved < NEAR
            if estimate_noise and (near or round_ == 1):
                noise = _noise(problem, z, around)
                same = _same(noise, problem.noise)
                stays, bent = stays and same, bent if same else None
                problem = problem.with_noise(noise)
                around = replace(around, marginal=problem.marginal(around.response))
            if stays:
                converged, path = True, []
                break
    except (TimeUp, *FAILURES) as error:  # what the rounds before came to is a fit, if one that has not come to rest
        if not done and len(starts) == 1:
            raise
        _log.info("the fit ends after round %d: %s", done, error)
    swing, z = swung(path, between(path, z, round_), round_), between(path, z, round_)
    slope = np.zeros(problem.size) if bent is None else bent.slope + bent.root.T @ (bent.root @ (z - bent.z))
    with problem.runner.lifted():
        found = _finish(problem, z, around, slope, converged, began, counted)
    return replace(found, covariance=found.covariance + swing)


def _first(problem: Problem, starts: list[np.ndarray]) -> Linearisation:
    """A linearisation at the first start that can be simulated."""
    for k, start in enumerate(starts):
        try:
            return problem.linearise(start)
        except FAILURES:
            if k == len(starts) - 1:
                raise
    raise AssertionError("no start")


def _best_start(problem: Problem, starts: list[np.ndarray], around: Linearisation) -> np.ndarray:
    """Where the best of several starts leads with one covariance for all."""
    if len(starts) == 1:
        return starts[0]
    best: tuple[float, np.ndarray] | None = None
    for start in starts:
        try:
            z, _ = solved(problem, start, around, None, most=5)
            residual = problem.residuals(z, around)
        except FAILURES:
            continue
        except TimeUp:
            if best is None:
                raise
            break
        cost = float(residual @ residual + z @ z)
        if best is None or cost < best[0]:
            best = (cost, z)
    if best is None:
        raise SimulationError(f"none of {len(starts)} starts could be simulated")
    return best[1]


def _far(z: np.ndarray, other: np.ndarray, information: np.ndarray) -> float:
    """Root mean square distance of two points [posterior standard deviations]."""
    return float(np.sqrt((z - other) @ information @ (z - other) / len(z)))


def _noise(problem: Problem, z: np.ndarray, around: Linearisation) -> NoiseModel:
    """Noise of the residual that is left with the most likely nuisance."""
    left = problem.measured - problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
    base = NoiseModel.white_only(problem.floor)
    return estimated(base, np.where(problem.observed, left, 0.0), problem.observed, problem.time)


def _same(a: NoiseModel, b: NoiseModel) -> bool:
    return bool(np.allclose(np.log(a.sd), np.log(b.sd), atol=0.2))


def _finish(
    problem: Problem,
    z: np.ndarray,
    around: Linearisation,
    slope: np.ndarray,
    converged: bool,
    began: float,
    counted: int,
) -> Fit:
    jacobian = problem.jacobian(z, around, central=True)
    residual = problem.residuals(z, around)
    information = np.eye(problem.size) + jacobian.T @ jacobian
    lower = factor(jacobian.T @ jacobian)
    logdet = problem.noise.logdet(problem.observed, problem.time) + around.marginal.logdet
    likelihood = -0.5 * (float(residual @ residual) + logdet + len(residual) * np.log(2 * np.pi))
    evidence = likelihood - 0.5 * float(z @ z) - float(np.sum(np.log(np.diag(lower))))
    nuisance = problem.likely_nuisance(z, around)
    heights = problem.nuisance.heights(nuisance)
    try:
        outputs = problem.simulate(z, heights)
    except FAILURES:  # the likeliest nuisance cannot be simulated: the one before it could
        nuisance, heights = around.nuisance, around.heights
        outputs = problem.simulate(z, heights)
    final = replace(around, z=z, nuisance=nuisance, heights=heights, outputs=outputs)
    return Fit(
        z=z,
        covariance=stretched(problem, z, around, information, slope),
        cost=0.5 * float(residual @ residual + z @ z),
        log_likelihood=likelihood,
        log_evidence=evidence,
        residual=residual,
        around=final,
        problem=problem,
        at_bound=problem.unknown.at_bound(z),
        converged=converged,
        simulations=problem.simulations - counted,
        seconds=time.perf_counter() - began,
    )
