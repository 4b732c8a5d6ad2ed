"""The simulation linearised around a fit: by parameters, by every effect's amplitude, and by the nuisance.

All later steps work on these series; the simulator is asked again only to refit the few candidates that remain.

What a fit may leave out and a test may not: how wide the nuisances really are.

- Replayed actuators are read by meters, and what the meters get wrong drives the model: each replayed input gets pulses
  whose prior is what is not known of it once its noise is cleared (:mod:`diagnosis.fitting.inputs`). So does weather
  that an import computed: the sun on a facade from that on the horizontal, and the temperature of the sky.
- When within a step people came and went has heavier tails than the normal prior of
  :mod:`diagnosis.fitting.inputs`, and a quickly ventilated room remembers the end of a step better than its mean:
  the prior is widened, and the second half of a step gets halves of its own, lest a short absence pass for a gap.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.effects import Effect, clash, moved_in_time
from diagnosis.fitting.gaussian import root
from diagnosis.fitting.inputs import Cleared, Computed, Drive
from diagnosis.fitting.linear import Linearisation, one_sided, principal, responses
from diagnosis.fitting.nuisance import SPACING, Nuisance, joined, pulses_between, pulses_on
from diagnosis.fitting.problem import STEP, Problem
from diagnosis.fitting.simulations import Outcome
from diagnosis.recording import DAY, Recording
from shared.errors import SimulationError

KNOWN = 0.01
"""Of the largest standard error, below which a value counts as known."""
FOLLOWED = 3 * DAY
WITHIN = 2.0
"""By how much the prior of changes within a step is widened."""


def widened(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """A problem and its linearisation with nuisances as wide as they are."""
    nuisance = problem.nuisance
    wider = np.where(nuisance.turns, WITHIN, 1.0)[:, None]
    problem = problem.with_nuisance(replace(nuisance, factor=nuisance.factor * wider))
    columns = np.abs(nuisance.factor[nuisance.turns]).any(axis=0)  # they share none with other pulses
    around = replace(around, nuisance=np.where(columns, around.nuisance / WITHIN, around.nuisance))
    for place, one in enumerate(problem.system.inputs):
        if one.source == "occupancy" and (problem.nuisance.turns & (problem.nuisance.column == place)).any():
            problem, around = _joined(problem, around, late(problem.nuisance, place))
    return metered(problem, around)


def metered(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """A problem and its linearisation where what meters and computed weather get wrong is a nuisance, too."""
    driven = problem.drive
    for place, one in enumerate(problem.system.inputs):
        if one.name in driven.doubted:
            pulses = _doubted(place, driven, driven.doubted[one.name], problem.recording)
            problem, around = _joined(problem, around, pulses)
    return problem, around


def late(nuisance: Nuisance, place: int) -> Nuisance:
    """For each change within a step one more within the step's second half."""
    some = nuisance.turns & (nuisance.column == place)
    begin, end = nuisance.begin[some], nuisance.end[some]
    factor, followed = np.diag(nuisance.sd[some]), nuisance.followed[some]
    return pulses_on(place, 0.5 * (begin + end), end, factor, turns=True, followed=followed)


def _doubted(place: int, driven: Drive, doubted: Cleared | Computed, recording: Recording) -> Nuisance:
    """Means over pulses of what is not known of an input's values; none where they are known, as the sun at night."""
    edges = np.append(np.arange(driven.start, driven.stop - 1.0, max(doubted.pulse, recording.step)), driven.stop)
    count = len(edges) - 1
    within = np.searchsorted(edges, recording.time - 0.5 * recording.step) - 1
    weights = (within == np.arange(count)[:, None]).astype(float)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1.0)
    covariance = doubted.covariance(weights)
    pulses = pulses_between(edges, place, root(covariance + 1e-9 * covariance.max() * np.eye(count)), FOLLOWED)
    return pulses.only(pulses.sd > KNOWN * pulses.sd.max())


def felt(problem: Problem, z: np.ndarray, heights: np.ndarray, pulses: Nuisance) -> np.ndarray:
    """Response of the outputs to further pulses, shape (outputs, steps, pulses)."""
    other = problem.with_nuisance(joined(problem.nuisance, pulses))
    base = other.simulate(z, np.concatenate([heights, pulses.mean]))
    return responses(
        pulses,
        lambda runs: other.simulate_all([(z, np.concatenate([heights, run])) for run in runs]),
        base,
        problem.time,
    )


def _joined(problem: Problem, around: Linearisation, pulses: Nuisance) -> tuple[Problem, Linearisation]:
    """A problem with further pulses, and what they do to the outputs around a linearisation."""
    response = felt(problem, around.z, around.heights, pulses)
    # where the line is drawn again a day is enough: a hundredth of the square of what they do comes later
    pulses = replace(pulses, followed=np.minimum(pulses.followed, SPACING))
    other = problem.with_nuisance(joined(problem.nuisance, pulses))
    return other, replace(
        around,
        heights=np.concatenate([around.heights, pulses.mean]),
        nuisance=np.concatenate([around.nuisance, np.zeros(pulses.factor.shape[1])]),
        response=np.concatenate([around.response, response], axis=2),
    )


UNFELT = 0.1
"""A direction of the nuisance that moves all readings together by less than this, in units of noise, is left out."""
ALIKE = 0.9
"""Cosine of an amplitude's two sides from which they count as one direction."""
WIDTH = 0.3
"""Half-width of the difference in an amplitude [scale of the effect]: a secant over what is expected."""


@dataclass(frozen=True)
class Linearised:
    """Series around a fit.

    ``residual`` (outputs, steps) [unit of each]: measured minus simulated with the nuisance at its prior mean, NaN
    where nothing was measured; ``outputs`` (outputs, steps): simulated with the most likely nuisance. Derivatives
    of the outputs: ``by_nuisance`` (outputs, steps, nuisance unknowns), standard normal; ``by_unknown`` (outputs,
    steps, unknowns): parameters, amplitudes that were fitted, levels, at ``z`` (unknowns,); ``by_effect`` (outputs,
    steps, effects) by amplitudes in units of scales, from zero. ``effects`` are the candidates, ``chosen`` what was
    fitted. ``turn`` (nuisance unknowns of the problem, of ``by_nuisance``): what the latter are made of. ``failed``:
    candidates that cannot be simulated on either side, by name, and why. ``slope``: by an unknown's name, what it
    costs in log density that the nuisance is the better known there, and where: see :mod:`diagnosis.fitting.freedom`.
    """

    problem: Problem
    around: Linearisation
    z: np.ndarray
    residual: np.ndarray
    outputs: np.ndarray
    by_nuisance: np.ndarray
    turn: np.ndarray
    by_unknown: np.ndarray
    by_effect: np.ndarray
    effects: tuple[Effect, ...]
    failed: dict[str, str]
    slope: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """What the unknowns cost, and where, each (unknowns,); zero for those without a slope."""
        if not self.slope:
            return np.zeros(len(self.z)), np.zeros(len(self.z))
        slopes, where = np.array([self.slope.get(name, (0.0, 0.0)) for name in self.problem.names]).T
        return slopes, where

    @property
    def chosen(self) -> tuple[Effect, ...]:
        """Effects whose amplitudes are among the unknowns."""
        return self.problem.effects

    @property
    def amplitudes(self) -> np.ndarray:
        """Fitted amplitudes [scales], shape (chosen,)."""
        count = len(self.problem.system.parameters)
        return self.z[count : count + len(self.chosen)]


def applicable(problem: Problem, effects: Sequence[Effect]) -> tuple[list[Effect], dict[str, str]]:
    """Effects that can be tried on a recording beside those that a problem has, and why the others cannot."""
    usable, why = [], {}
    names = {one.name for one in problem.effects}
    uncounted = {problem.system.input_names[level.column] for level in problem.nuisance.levels}
    for effect in effects:
        if effect.name in names:
            continue
        reason = effect.obstacle(problem.recording, replay=problem.replay) or clash([*problem.effects, effect])
        # pulses are followed from where they begin on, and may come at any time anyway
        if uncounted & moved_in_time(effect):
            reason = reason or "it moves persons in time, and nobody counted when they were there"
        if reason:
            why[effect.name] = reason
        else:
            usable.append(effect)
    return usable, why


def linearised(
    problem: Problem,
    z: np.ndarray,
    around: Linearisation,
    effects: Sequence[Effect] = (),
    by_unknown: np.ndarray | None = None,
    like: Linearised | None = None,
) -> Linearised:
    """Simulate on both sides of everything unknown, once.

    Parameters
    ----------
    z
        Unknowns of the problem, shape (unknowns,).
    around
        Its linearisation by the nuisance; the response is kept, the outputs are simulated at ``z``.
    effects
        Candidates whose amplitudes are zero at ``z``.
    by_unknown
        Derivatives that are known already; they are not simulated again.
    like
        Another one with the same response to the nuisance, and its slope.
    """
    library = problem.with_effects([*problem.effects, *effects])
    first = len(problem.system.parameters) + len(problem.effects)

    def full(z: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
        return np.concatenate([z[:first], amplitudes, z[first:]])

    low, high = problem.bounds
    none = np.zeros(len(effects))
    cases, widths, aheads = [full(z, none)], [], []
    for k in range(0 if by_unknown is not None else problem.size):
        up, down = z.copy(), z.copy()
        up[k], down[k] = min(z[k] + STEP, high[k]), max(z[k] - STEP, low[k])
        if k in problem.unknown.places_of_constants:  # smooth, and only to be made up for: one side is enough
            (up if z[k] > 0 else down)[k] = z[k]
        cases += [full(up, none), full(down, none)]
        widths.append(up[k] - down[k])
    for k, effect in enumerate(effects):
        up, down = none.copy(), none.copy()
        up[k], down[k] = min(WIDTH, effect.upper / effect.scale), max(-WIDTH, effect.lower / effect.scale)
        cases += [full(z, up), full(z, down)]
        widths.append(up[k] - down[k])
        aheads.append(up[k])
    base, *made = _simulated(library, cases, around.heights)
    if isinstance(base, SimulationError):
        raise base
    columns: list[np.ndarray] = []
    failed: dict[str, str] = {}
    count = len(widths) - len(effects)
    for k, width in enumerate(widths):
        up_, down_ = made[2 * k], made[2 * k + 1]
        if not isinstance(up_, SimulationError) and not isinstance(down_, SimulationError):
            both = k >= count and not (up_ is base or down_ is base)
            columns.append(
                _secant(problem, base, up_, down_, aheads[k - count], width) if both else (up_ - down_) / width
            )
            continue
        place = first + k - count if k >= count else k if k < first else k + len(effects)
        whole = full(z, none)
        one = one_sided(
            lambda there: library.simulate(there, around.heights), whole, place, library.bounds, 0.5 * width
        )
        columns.append(np.zeros_like(base) if one is None else one)
        if one is None and k >= count:
            failed[effects[k - count].name] = str(up_ if isinstance(up_, SimulationError) else down_)
    stacked = np.stack(columns, axis=-1) if columns else np.empty((*base.shape, 0))
    by_nuisance, turn = felt_nuisance(problem, around) if like is None else (like.by_nuisance, like.turn)
    at_mean = base + around.response @ (problem.nuisance.mean - around.heights)
    return Linearised(
        problem=problem,
        around=replace(around, z=z, outputs=base),
        z=np.asarray(z, dtype=float),
        residual=np.where(np.isfinite(problem.measured), problem.measured - at_mean, np.nan),
        outputs=base,
        by_nuisance=by_nuisance,
        turn=turn,
        by_unknown=stacked[..., :count] if by_unknown is None else by_unknown,
        by_effect=stacked[..., count:],
        effects=tuple(effects),
        failed=failed,
        slope={} if like is None else like.slope,
    )


def _secant(
    problem: Problem, base: np.ndarray, up: np.ndarray, down: np.ndarray, forward: float, width: float
) -> np.ndarray:
    """Derivative by an amplitude of either sign, shape (outputs, steps) [unit of each].

    ``forward``: how far ``up`` is from ``base`` [scales]; ``width``: from ``down``.

    What is late and what is early can move different readings (a timetable that switches on the hour). Where the two
    sides differ, the side whose signature the residual resembles more is the one that counts.
    """
    seen = problem.observed & np.isfinite(problem.measured)
    scale = np.broadcast_to(problem.floor[:, None], seen.shape)[seen]
    ahead, behind, left = ((one[seen] / scale) for one in (up - base, base - down, problem.measured - base))
    sizes = np.array([ahead @ ahead, behind @ behind])
    if ahead @ behind > ALIKE * np.sqrt(sizes.prod()):
        return np.asarray((up - down) / width)
    gains = np.array([max(left @ ahead, 0.0), max(-(left @ behind), 0.0)]) ** 2 / np.maximum(sizes, 1e-12)
    return np.asarray((up - base) / forward if gains[0] >= gains[1] else (base - down) / (width - forward))


def felt_nuisance(problem: Problem, around: Linearisation) -> tuple[np.ndarray, np.ndarray]:
    """Response to independent standard normal unknowns (outputs, steps, unknowns) [unit of each], and their turn.

    The nuisance's unknowns are turned to principal directions, and those that all readings together hardly feel are
    left out: of a thousand pulses a few hundred directions remain. Outputs without readings do not respond.
    """
    used = problem.observed.any(axis=1)
    response = problem.nuisance.by_unknown(around.response, used)
    rows = response[used] / problem.floor[used, None, None]
    rows = rows.reshape(rows.shape[0] * rows.shape[1], rows.shape[2])  # also where there is no nuisance
    _, turn, _ = principal(rows, UNFELT**2)
    felt = np.zeros((*response.shape[:-1], turn.shape[1]))
    felt[used] = response[used] @ turn
    return felt, turn


def _simulated(problem: Problem, cases: list[np.ndarray], heights: np.ndarray) -> list[Outcome]:
    """Outputs of each case, or why a simulation did not reach its end."""
    first = cases[0]
    different = [case for case in cases[1:] if not np.array_equal(case, first)]
    made = problem.simulate_each([(case, heights) for case in [first, *different]])
    rest = iter(made[1:])
    return [made[0], *(made[0] if np.array_equal(case, first) else next(rest) for case in cases[1:])]


def fewer(lin: Linearised, effects: Sequence[Effect], excluded: Collection[str] = ()) -> Linearised:
    """A linearisation with some of its candidates, in the order of ``effects``.

    Every candidate's derivative is that of simulations with this candidate alone, so that the result is what
    :func:`diagnosis.fitting.lines.linearised` would have made of fewer.

    Parameters
    ----------
    excluded
        Names of candidates that could not be tried, and are not missed.

    Raises
    ------
    ValueError
        If a candidate is neither excluded nor in the linearisation.
    """
    place = {one.name: j for j, one in enumerate(lin.effects)}
    gone = {*excluded, *(one.name for one in lin.chosen)}
    for one in effects:
        if one.name not in place and one.name not in gone:
            raise ValueError(f"effects: {one.name!r} took no part in the linearisation; expected one of {[*place]}")
    kept = [place[one.name] for one in effects if one.name in place]
    return replace(
        lin,
        by_effect=lin.by_effect[..., kept],
        effects=tuple(lin.effects[j] for j in kept),
        failed={name: why for name, why in lin.failed.items() if name in {lin.effects[j].name for j in kept}},
    )
