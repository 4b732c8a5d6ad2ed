"""What limits the answer: what was not known, and what could not be seen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtri

from diagnosis.calibrating.report import far_outside
from diagnosis.effects import Effect
from diagnosis.fitting.failures import NO_TIME
from diagnosis.gap.scan import NEGLIGIBLE, SEEN
from diagnosis.gap.schema import Detectability, Report
from diagnosis.gap.stages import Stage
from diagnosis.gap.verdict import Verdict
from shared.numbers import counted, number
from shared.variables import spaced

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
    scatter = float(ndtri(OFTEN) / np.sqrt(2 * reached))
    needed = (NEGLIGIBLE + float(np.sqrt(threshold / reached)) + scatter) * effect.scale
    return needed if needed <= max(effect.upper, -effect.lower) else None


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
    elif report.unlike:
        said += " This room is hardly the described one: take them as a rough guide."
    return said


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
        )
    if report.replay:
        found.append(
            f"The recorded actuators ({', '.join(report.replayed)}) drive the model: their own readings are no"
            " evidence, and errors of their meters act on the other outputs."
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
        found.append("The fit of the base model had not converged when it stopped.")
    if report.converged_after is False:
        found.append(
            f"The fit {added(report.verdict)} had not converged when it stopped: sizes and parameters after are of"
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
