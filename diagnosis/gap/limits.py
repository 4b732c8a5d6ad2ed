"""What limits the answer: what was not known, and what could not be seen.

How much of an answer unknown occupancy or replayed actuators cost: what could be seen if it were otherwise.

Both comparisons ask the linearised problem for the log-likelihood ratio that a candidate of one scale would be expected
to reach. If persons had been counted: the same problem where of who was there is unknown when within a step they came,
if anything, as of counts that are means over long steps. If the control loops had been simulated: the same recording
linearised anew with them, the actuators' own readings being evidence then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
from scipy.stats import norm

from datagen.driving.tables import Piecewise
from diagnosis.calibrating.report import far_outside
from diagnosis.effects import Effect
from diagnosis.effects.base import foreseen
from diagnosis.fitting.failures import FAILURES, NO_TIME
from diagnosis.fitting.fit import pruned
from diagnosis.fitting.inputs import counted as persons_within
from diagnosis.fitting.noise import HOUR
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import Colour, Grams, projected
from diagnosis.gap.linear import WITHIN, Linearised, applicable, both, felt, felt_nuisance, late, linearised, widened
from diagnosis.gap.scan import NEGLIGIBLE, SEEN
from diagnosis.gap.schema import ConditionOf, Detectability, Report
from diagnosis.gap.stages import Stage
from diagnosis.gap.verdict import Verdict
from shared.errors import RecordingError
from shared.numbers import counted, number
from shared.variables import spaced


@dataclass(frozen=True)
class Otherwise:
    """What would be known under another condition.

    ``condition``: ``counted`` or ``controlled``; ``lin`` and ``observed`` (outputs, steps) what the ratios are of.
    """

    condition: str
    lin: Linearised
    observed: np.ndarray


def otherwise(stage: Stage, whole: Problem, candidates: Sequence[Effect]) -> list[Otherwise]:
    """Better conditions than the recording's; none where persons were counted and the control loops simulated.

    Parameters
    ----------
    stage
        The first, without effects.
    whole
        The recording's problem as it was before the fit.
    """
    found = []
    if whole.occupancy == "unknown":
        found.append(Otherwise("counted", _counted(stage.lin), stage.grams.observed))
    if whole.replay:
        # what the control loops need may not have been recorded, or they cannot follow: nothing to compare with
        with suppress(RecordingError, *FAILURES):
            problem, lin = _controlled(whole, stage.lin.z, candidates)
            found.append(Otherwise("controlled", lin, problem.observed))
    return found


def expected(one: Otherwise, colours: dict[int, Colour], size: np.ndarray) -> dict[str, float]:
    """Log-likelihood ratio that each candidate of one scale would reach, by name.

    Parameters
    ----------
    colours
        Of the channels of the recording's own condition; others have white noise.
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    grams = Grams(one.lin, one.observed)
    used = {k: colours.get(k, (float(size[k]), 0.0, HOUR)) for k in grams.channels}
    left = projected(grams.total(used), grams.inner.size)
    values = 0.5 * np.diag(left.information)
    return dict(zip([effect.name for effect in one.lin.effects], values.tolist(), strict=True))


def _counted(lin: Linearised) -> Linearised:
    """The same with the most likely persons taken for counted, without their level.

    Derivatives by effects stay as they are: they were simulated with the persons who are most likely, which an effect
    that follows or changes persons sees (:mod:`diagnosis.fitting.runs`).
    """
    nuisance, around = lin.problem.nuisance, lin.around
    keep = ~np.isin(nuisance.column, [level.column for level in nuisance.levels])
    problem, response = lin.problem.with_nuisance(nuisance.only(keep)), around.response[..., keep]
    for level, factor in zip(nuisance.levels, lin.problem.unknown.level_values(lin.z).tolist(), strict=True):
        pulses = _within_steps(lin, level.column, factor)
        if pulses.size:
            answers = felt(lin.problem, lin.z, around.heights, pulses)
            problem = problem.with_nuisance(both(problem.nuisance, pulses))
            response = np.concatenate([response, answers], axis=2)
    by_nuisance, turn = felt_nuisance(problem, replace(around, response=response))
    count = len(lin.z) - len(nuisance.levels)
    return replace(lin, by_nuisance=by_nuisance, turn=turn, by_unknown=lin.by_unknown[..., :count], z=lin.z[:count])


def _within_steps(lin: Linearised, column: int, factor: float) -> Nuisance:
    """What would not be known of the likely persons had their means over steps been counted, before their level."""
    problem, recording = lin.problem, lin.problem.recording
    assert problem.system.occupancy is not None
    begins, nuisance = recording.time - recording.step, problem.nuisance
    some = nuisance.guessed & (nuisance.column == column)
    last = np.minimum(recording.time[:, None], nuisance.end[some])
    shared = np.maximum(last - np.maximum(begins[:, None], nuisance.begin[some]), 0.0)
    means = factor * (shared @ lin.around.heights[some]) / recording.step
    pulses, _ = persons_within(problem.system.occupancy, column, recording, Piecewise(begins, means, "previous"))
    if not pulses.size:
        return pulses
    pulses = both(wider := replace(pulses, factor=WITHIN * pulses.factor), late(wider, column))
    return replace(pulses, factor=pulses.factor / factor)


def _controlled(whole: Problem, z: np.ndarray, candidates: Sequence[Effect]) -> tuple[Problem, Linearised]:
    """The same recording with the control loops simulated, linearised at the same unknowns."""
    problem = Problem(
        whole.simulator,
        whole.recording,
        noise=whole.noise,
        occupancy=None if whole.occupancy == "none" else whole.occupancy,
        warm_up=whole.drive.start - whole.drive.begin,
        runner=whole.runner,
    )
    usable, _ = applicable(problem, candidates)
    problem = problem.with_observed(foreseen(usable, whole.recording))  # as the recording's own readings count
    plain, around = pruned(problem, problem.linearise(z))
    problem, around = widened(plain, around)  # as wide as the recording's own
    return problem, linearised(problem, z, around, usable)


OFTEN = 0.9
"""Share of the cases in which an effect of the size from which it is said to be seen is seen."""
TYPICAL = 2.0
"""Size, in scales, at which it is said what a candidate would be mistaken for."""


def detectability(first: Stage) -> list[Detectability]:
    """The table of all candidates of the first stage."""
    found, scan = [], first.scan
    for j, effect in enumerate(scan.effects):
        found.append(
            Detectability(
                name=effect.name,
                share=float(scan.share[j]),
                expected=float(scan.expected[j]),
                smallest=smallest(effect, float(scan.expected[j]), float(scan.threshold[j])),
                confusable=[scan.effects[i].name for i in scan.alike(j, TYPICAL)],
                ratio=float(scan.ratio[j]),
                p_value=float(scan.adjusted[j]),
            )
        )
    return found


def smallest(effect: Effect, reached: float, threshold: float) -> float | None:
    """The amplitude [unit] from which an effect is seen in OFTEN of the cases; None if none allowed is.

    What the best amplitude that does not matter explains is no evidence (:mod:`diagnosis.gap.scan`): an effect is seen
    whose estimate is beyond that one by what makes up the threshold. Estimates scatter by 1 / sqrt(F) [scales] about
    the truth, so that at that size itself half of the effects would be seen.

    Parameters
    ----------
    reached
        Log-likelihood ratio F / 2 at one scale.
    """
    if 2 * reached <= SEEN:  # such a candidate takes no part, whatever its size
        return None
    scatter = float(norm.ppf(OFTEN) / np.sqrt(2 * reached))
    needed = (NEGLIGIBLE + float(np.sqrt(threshold / reached)) + scatter) * effect.scale
    return needed if needed <= max(effect.upper, -effect.lower) else None


def otherwise_seen(one: Otherwise, first: Stage, size: np.ndarray) -> ConditionOf:
    """What would be seen under another condition, held against the same marks.

    ``size``: standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    reached = expected(one, first.colours.best, size)
    seen = zip(first.lin.effects, first.scan.threshold.tolist(), strict=True)
    return ConditionOf(
        condition=one.condition,
        smallest={one.name: smallest(one, reached[one.name], least) for one, least in seen if one.name in reached},
    )


UNEXPLAINED = (
    "A gap that is not explained sits in the parameters as well, and their intervals do not allow for it. Do not take"
    " the parameters from this answer."
)
GOING_ON = " The same command goes on from there, and with more minutes it comes further."
WITHHELD = (
    "An answer is of the candidates that there are. Where the true cause is none of them, another that resembles it may"
    " be named."
)


def added(verdict: Verdict) -> str:
    """What the fit "after" has that the base model has not, goes on in a sentence."""
    return "with the nearest candidate" if verdict == "none_of_these" else "with the effects found"


def calibration(report: Report) -> str:
    """What the probabilities come from, and what answers to such recordings held."""
    by = report.calibrated
    alarms, named = by.answers.alarms, by.answers.named
    said = (
        f"Probabilities come from {counted(sum(by.strata.values()), 'recording')} of {by.hours:g} h that were made with"
        f" {by.system} ({by.made}, seed {by.seed}), {by.strata.get('none', 0)} of them without a cause. There a gap was"
        f" answered in {round(alarms.true * alarms.count)} of {alarms.count} without a cause, and of"
        f" {counted(named.count, 'answer')} with a name {round(named.true * named.count)} held a true cause"
        " in the first set."
    )
    if report.uncalibrated:
        said += (
            f" They are not calibrated for this system ({report.uncalibrated}): run `diagnosis farm` for it, and until"
            " then take them as a rough guide."
        )
    return said


def _cost(report: Report, condition: str, begin: str) -> str:
    """How much less would have to be there to be seen under a better condition, as a sentence."""
    other = next((one.smallest for one in report.otherwise if one.condition == condition), None)
    if not other:
        return ""
    now = {one.name: one.smallest for one in report.detectability}
    units = {one.name: one.unit for one in report.effects}
    ratio = {name: size / least for name, size in other.items() if size is not None and (least := now[name])}
    only = [name for name, size in other.items() if size is not None and now[name] is None]
    said = ""
    if ratio:
        some = counted(len(ratio), "candidate")
        said = (
            f" {begin}, {some} would be seen from {median(ratio.values()):.0%} of the size needed here, at the median"
        )
    most = [name for name in sorted(ratio, key=lambda name: ratio[name])[:3] if ratio[name] < 0.8]
    if most:
        each = [
            f"{name} from {number(other[name], 2)} instead of {number(now[name], 2)}{spaced(units[name])}"
            for name in most
        ]
        said += f"; most for {', '.join(each)}"
    if only:
        said += f"{';' if said else ' ' + begin + ','} seen only then: {', '.join(only)}"
    return said + "." if said else ""


def limits(report: Report) -> list[str]:
    """What was not known and how that limits the answer."""
    found = [calibration(report)]
    if report.unfinished:
        lacking = "; ".join(f"{step} ({why})" for step, why in report.unfinished.items())
        found.insert(0, f"The answer lacks: {lacking}.{GOING_ON if NO_TIME in report.unfinished.values() else ''}")
    if report.failed:
        found.append("Failed: " + "; ".join(f"{name} ({why})" for name, why in report.failed.items()) + ".")
    if report.verdict == "none_of_these":
        found.append(UNEXPLAINED)
    if report.verdict in ("effect", "ambiguous"):
        found.append(WITHHELD)
    if report.occupancy == "unknown":
        found.append(
            "Persons were not counted: whatever looks like people coming and going at other times than usual is taken"
            " for them. Effects that act when people are there are hard to see, and so is how large a leak or an"
            " opening is: a room that leaks much looks like one with fewer people."
            + _cost(report, "counted", "Had they been counted")
        )
    if report.replay:
        found.append(
            f"The recorded actuators ({', '.join(report.replayed)}) drive the model: their own readings are no"
            " evidence, and errors of their meters act on the other outputs."
            + _cost(report, "controlled", "With the control loops simulated, had they been those of the model")
        )
    named = {name for one in report.sets for name in one}
    blind = [
        one.name
        for one in report.detectability
        if one.smallest is None and one.name not in {*report.excluded, *report.failed} and one.name not in named
    ]
    if blind:
        found.append(f"At no size that is allowed would nine of ten recordings like this one show: {', '.join(blind)}.")
    if report.sources_unknown:
        why = "; ".join(f"{name} ({reason})" for name, reason in report.sources_unknown.items())
        found.append(f"Missing sources that could not be worked out: {why}.")
    if report.excluded:
        found.append("Not tried: " + "; ".join(f"{name} ({why})" for name, why in report.excluded.items()) + ".")
    found += [
        f"A gap by {one.name} of twice the usual size would be hard to tell from {', '.join(one.confusable)} here."
        for one in report.detectability
        if one.name in named and one.confusable
    ]
    found += [
        f"The size of {one.name} lies at the end of what its description allows ({number(one.amplitude, 3)}"
        f"{spaced(one.unit)}). If that is as far as such an effect can go, it may be there in full; else the bound is"
        " too narrow for this building and more would fit better, or the cause is another."
        for one in report.effects
        if one.named and one.at_bound and one.amplitude is not None
    ]
    bound = [one.name for one in report.parameters if one.at_bound]
    if bound:
        found.append(f"On the bounds of their ranges in the base model: {', '.join(bound)}.")
        if report.wider:
            found.append(f"{report.wider} has wider ranges: diagnosis run {report.wider} {report.recording}")
    if not report.converged:
        found.append("The fit of the base model had not come to rest when it stopped.")
    if report.converged_after is False:
        found.append(
            f"The fit {added(report.verdict)} had not come to rest when it stopped: sizes and parameters after are of"
            " where it then was, and their intervals those of an optimum."
        )
    if report.assumed:
        found.append("Not measured: " + "; ".join(f"{name}: {what}" for name, what in report.assumed.items()) + ".")
    return found


def strained(report: Report, relative: Mapping[str, float]) -> list[str]:
    """That uncertain constants are far from what the description allows, in the base model and with the effects.

    ``relative`` by name: the standard deviation of the logarithm of a constant's factor in the prior.
    """
    before = {one.name: (one.before, relative[one.name]) for one in report.constants}
    after = {one.name: (one.after, relative[one.name]) for one in report.constants if one.after is not None}
    return far_outside(before, "In the base model ") + far_outside(after, f"{added(report.verdict).capitalize()} ")


def ends_left_out(observed: np.ndarray, read: np.ndarray, hours: float) -> list[str]:
    """That steps at the ends count for none; nothing if all that was read counts.

    Parameters
    ----------
    observed, read
        What counts and what was read, shapes (outputs, steps).
    hours
        Length of a step [h].
    """
    lost = read & ~observed & observed.any(axis=1, keepdims=True)  # actuators in replay count nowhere, which is told
    if not lost.any():
        return []
    middle = lost.shape[1] // 2
    first = int(np.flatnonzero(lost[:, :middle].any(axis=0)).max(initial=-1)) + 1
    last = int(np.flatnonzero(lost[:, middle:][:, ::-1].any(axis=0)).max(initial=-1)) + 1
    ends = [f"the {name} {count * hours:.3g} h" for name, count in (("first", first), ("last", last)) if count]
    return [
        f"Readings of {' and '.join(ends)} count for none, where a candidate would need inputs or readings from beyond"
        " the recording: a residual there is no finding."
    ]


def noiseless(undeclared: Mapping[str, str]) -> list[str]:
    """That outputs, by name, were taken to be as exact as the model's numbers [unit of each]; nothing of none."""
    if not undeclared:
        return []
    taken = ", ".join(f"{name} (to {size})" for name, size in undeclared.items())
    return [
        f"No noise is declared for the sensor of {taken}: readings were taken to be as exact as the model's numbers, so"
        " that what real sensors get wrong passes for a gap. Declare it in the description's [[outputs]] as"
        " noise.sensor, or under the preset that --noise names, and diagnose again."
    ]
