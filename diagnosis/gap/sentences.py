"""The answer in three sentences."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping
from types import MappingProxyType

from diagnosis.fitting.failures import NO_TIME
from diagnosis.gap.schema import FEWEST, HOW_FAR, VERDICTS, NamedEffect, Report, ShrinkageOf
from diagnosis.gap.stages import LEVEL, PLAIN
from diagnosis.gap.verdict import LIKELY
from diagnosis.pages import long_named, percent, within_sentence
from shared.numbers import chance, counted, number
from shared.variables import spaced

NEEDED = 0.05
"""Up to this p-value a source is reported as missing."""
LISTED = 6
"""So many names of a set are said; a larger one is told as groups."""
FOREMOST = 3
"""And so many names of a larger one."""
GROUPS = {
    "parameter": ("thing in the room", "things in the room"),
    "shaped": ("thing in the room", "things in the room"),
    "input": ("input that was not as recorded", "inputs that were not as recorded"),
    "sensor": ("error of a sensor", "errors of sensors"),
}
"""What kinds of candidates are, one and several of them."""


def headline(report: Report) -> str:
    """The answer in one line: the cause, its size, its probability, and what it removes of the gap."""
    named = [one for one in report.effects if one.named]
    if report.verdict not in ("effect", "ambiguous") or not named:
        return f"{VERDICTS[report.verdict]}."
    if report.verdict == "ambiguous" and len(report.sets) > 1:
        return f"{len(report.sets)} causes: {'; and '.join(_one_of(report, names) for names in report.sets)}."
    if len(named) > LISTED:
        foremost = sorted(named, key=lambda one: -one.probability)[:FOREMOST]
        said = ", ".join(f"{one.name} ({chance(one.probability)})" for one in foremost)
        return f"One of {len(named)} causes that cannot be told apart: {_groups(named)}. Foremost: {said}."
    causes = []
    for one in named:
        size = "" if one.amplitude is None else f", {number(one.amplitude, 3)}{spaced(one.unit)}"
        if one.low is not None and one.high is not None:
            size += f" ({number(one.low, 3)} to {number(one.high, 3)})"
        causes.append(f"{long_named(one.name, one.description)}{size}, probability {chance(one.probability)}")
    shares = [(one.label or one.channel, one.told[0]) for one in report.shrinkage]
    removed = ", ".join(f"{share:.0%} of the gap in {what}" for what, share in shares if share is not None)
    which = "Cause" if len(causes) == 1 else "One of these causes" if report.verdict == "ambiguous" else "Causes"
    return f"{which}: {'; '.join(causes)}.{f' Removes {removed}.' if removed else ''}"


def summary(
    report: Report, sensors: Collection[str] = (), names: Mapping[str, str] = MappingProxyType({})
) -> list[str]:
    """Where, which, and how far; how sure is said with each.

    ``sensors``: names of the candidates that are errors of a sensor. ``names``: what outputs are, by name.
    """
    return [_where(report, sensors, names), _which(report), _how_far(report, names)]


def _where(report: Report, sensors: Collection[str], names: Mapping[str, str]) -> str:
    if report.verdict == "no_gap":
        return _nowhere(report)
    if not report.where:
        return (
            "Where: no single place, hour or state stands out, though the recording as a whole differs from the model."
        )
    best, *others = report.where
    measured = [one.channel for one in others if one.kind != "source"]  # a source may have the name of an output
    channels = list(dict.fromkeys(one for one in measured if one != best.channel or best.kind == "source"))
    more = f"; {counted(len(others), 'more finding')}" if others else ""
    also = f", also in {', '.join(long_named(one, names) for one in channels)}" if channels else ""
    return f"Where: {best.text}{more}{also}.{_kind(report, sensors)}"


def _nowhere(report: Report) -> str:
    """That there is no gap, and what seemed to be one."""
    if report.gap:
        return (
            "Where: tests find a difference beyond noise, but rooms without a cause look like this too often to call it"
            " a gap."
        )
    first = report.stages[0]
    where_p = 1.0 if first.where_p is None else first.where_p
    chances = f"(p = {first.p_value:.2g} over all candidates, {where_p:.2g} over all places)"
    seemed = []
    if first.p_value <= LEVEL or first.evidence >= PLAIN:
        seemed.append(
            "a candidate stands out in the linearised model, but fitted with the parameters none is strong evidence"
        )
    if report.dropped:
        seemed.append(
            f"from the base model's start point, {' with '.join(report.dropped)} fits the recording much better than"
            " the base model, but what the base model leaves is no larger than noise in any test"
        )
    if where_p <= LEVEL / 2:
        what = f" ({report.where[0].text})" if report.where else ""
        seemed.append(f"a place{what} stands out, but the residual as a whole is no larger than noise")
    if first.episode_p is not None and first.episode_p <= LEVEL / 2:
        why = "as errors of replayed actuators' meters make them" if report.replay else "but not by clear evidence"
        seemed.append(f"a stretch of one output stands out, {why}")
    if seemed:
        return f"Where: no difference is certain beyond noise {chances}: {'; and '.join(seemed)}."
    return (
        "Where: no difference beyond noise; the calibrated model explains the recording as well as recordings that it"
        f" simulated itself {chances}."
    )


def _kind(report: Report, sensors: Collection[str]) -> str:
    """Whether a balance lacks something or a sensor errs, as far as that can be told.

    That is of the base model alone, whose parameters have made up for some of it: an effect of the other sort that is
    named was fitted with them, and is not contradicted.
    """
    if report.unlike:  # a model of another room says nothing of the sensors in this one
        return ""
    named = {one.name in sensors for one in report.effects if one.named}
    if report.balance == "sensor":
        return "" if False in named else " It looks like the error of a sensor rather than of a balance."
    if report.balance != "balance" or True in named:
        return ""
    lacking = [one for one in report.sources if one.verdict == "balance" and one.p_value <= NEEDED]
    # without its mean: parameters have made up for what is constant of it, and may have turned its sign
    said = " and ".join(one.description for one in lacking)
    return f" It looks like {said or 'a source'} in the balance rather than like the error of a sensor."


def _which(report: Report) -> str:
    named = [one for one in report.effects if one.named]
    if report.verdict == "no_gap" and report.gap:
        return f"Which: no effect is named. That none acts is {chance(report.no_gap)} sure."
    if report.verdict == "no_gap" and report.no_gap < LIKELY:
        return (
            f"Which: no test finds a gap, so no effect is named. That none acts is only {chance(report.no_gap)} sure."
        )
    if report.verdict == "no_gap":
        return (
            f"Which: no effect is needed. That none acts is {chance(report.no_gap)} sure, because small ones go unseen"
            " (the report has the smallest that would be seen)."
        )
    if report.verdict == "none_of_these":
        chosen = " with ".join(report.stages[-1].effects)
        tried = sum(one.name not in {*report.excluded, *report.failed} for one in report.effects)
        otherwise = ": one of them may act by another law than described" if tried else ""
        rejected = ", which is rejected on its own bootstrap replicates" if report.rejected else ""
        if report.unlike:
            rejected = ", which leaves more unexplained than it explains"
        nearest = f"; the nearest is {chosen}{rejected}" if chosen else ""
        said = f"Which: none of the {tried} candidates explains it{nearest}."
        if report.unlike:
            wider = f", or try {report.wider}, which has wider ranges" if report.wider else ""
            return f"{said} With parameters on their bounds the model is hardly that of this room: correct it{wider}."
        if report.uncalibrated:
            return f"{said} How sure that is cannot be told before `diagnosis farm` has calibrated this system."
        possible = f" Not ruled out: {_listed(report, report.possible)}." if report.possible else ""
        return f"{said} That the cause is none of them is {chance(report.none_of_these)} sure{otherwise}.{possible}"
    if report.verdict == "unfinished":
        foremost = [_sure(report, one.name) for one in report.foremost[:LISTED]]
        by_lines = f" In the linearised model the foremost are {', '.join(foremost)}." if foremost else ""
        return f"Which: the search was not finished ({_why(report)}), so no candidate is named.{by_lines}"
    rest = _left(report) if report.rejected else ""
    if report.or_none:
        rest = f" The cause may also be none of the candidates ({chance(report.none_of_these)}).{rest}"
    at_least = (
        "of these causes at least is among them" if report.verdict == "ambiguous" else "of them at least is a cause"
    )
    if len(report.sets) > 1:
        rest = f" That one {at_least} is {chance(1 - report.mistaken)} sure.{rest}"
    if report.verdict == "ambiguous":
        sure = {one[0] for one in report.sets if len(one) == 1}
        alone = [_named(one) for one in named if one.name in sure]
        sets = " and ".join(_one_of(report, one) for one in report.sets if len(one) > 1)
        if alone:
            return f"Which: {'; and '.join([*alone, sets])}, which the recording cannot tell apart.{rest}"
        return f"Which: {sets}; the recording cannot tell these apart.{rest}"
    said = "; and ".join(_named(one) for one in named)
    return f"Which: {said}.{rest}"


def _why(report: Report) -> str:
    """Why a step of the search is lacking: the first that is."""
    return next(iter(report.unfinished.values()), NO_TIME)


def _left(report: Report) -> str:
    """What is left of the gap, and which candidate would be next: of two causes the first found may be neither."""
    last = report.stages[-1]
    named = {name for one in report.sets for name in one}
    if last.strongest is None or last.strongest in named or last.evidence < PLAIN:
        return " Something more is left that these do not explain."
    return (
        f" Something more is left that these do not explain: of the other candidates {last.strongest} would explain"
        " more of it than any other, and may be the cause in place of one of these."
    )


def _named(one: NamedEffect) -> str:
    what = long_named(one.name, within_sentence(one.description))
    return f"{what}, by {_amount(one)}, with probability {chance(one.probability)}"


def _one_of(report: Report, names: list[str]) -> str:
    """A set that cannot be told apart; a large one by its groups and the foremost."""
    said = _listed(report, names)
    return said if len(names) == 1 else f"one of {said}"


def _listed(report: Report, names: list[str]) -> str:
    """Candidates with their probabilities; of many, the groups and the foremost."""
    if len(names) <= LISTED:
        return ", ".join(_sure(report, name) for name in names)
    some = [one for one in report.effects if one.name in names]
    said = ", ".join(_sure(report, name) for name in names[:FOREMOST])
    return f"{len(names)} ({_groups(some)}), foremost {said}"


def _groups(some: Collection[NamedEffect]) -> str:
    """How many candidates are of which sort, the largest group first."""
    words = Counter(GROUPS.get(one.kind, ("other", "others")) for one in some)
    return ", ".join(f"{count} {one if count == 1 else several}" for (one, several), count in words.most_common())


def _sure(report: Report, name: str) -> str:
    one = next(one for one in report.effects if one.name == name)
    return f"{name} ({chance(one.probability)})"


def _amount(one: NamedEffect) -> str:
    if one.amplitude is None or one.low is None or one.high is None:
        return "an unknown amount"
    return f"{number(one.amplitude, 3)}{spaced(one.unit)} ({number(one.low, 3)} to {number(one.high, 3)})"


def _how_far(report: Report, long: Mapping[str, str]) -> str:
    if report.verdict == "no_gap":
        return "How far: there is no gap to shrink."
    if report.verdict == "unfinished" or HOW_FAR in report.unfinished:
        return f"How far: that is not known, because {report.unfinished.get(HOW_FAR) or _why(report)}."
    chosen = report.stages[-1].effects
    if not chosen:
        return (
            "How far: no candidate explains enough of the gap to be fitted, so nothing is known that would shrink it."
        )
    if not report.shrinkage:
        return (
            "How far: this is measured on held-out days, and they or the other days have no readings. A longer"
            " recording would help."
        )
    shares = [one for one in report.shrinkage if one.share is not None]
    few = [long_named(one.channel, long) for one in report.shrinkage if one.few]
    if len(few) == len(report.shrinkage):
        return (
            f"How far: the held-out days have fewer than {FEWEST} readings of any channel, too few to say how far the"
            " gap shrinks. A longer recording would help."
        )
    untold = f" There are too few readings of {', '.join(few)} on these days." if few else ""
    if not shares:
        return (
            "How far: on the held-out days, no channel's gap stands out from the noise, so no share of it can be given."
            f"{untold}"
        )
    said = ", ".join(_removed(one, long_named(one.channel, long)) for one in shares)
    placebo = max((one.placebo or 0.0) for one in shares)
    days = (
        "held-out days"
        if report.chosen_apart
        else "held-out days (which took part in the choice: the other days alone put another candidate first)"
    )
    names = " with ".join(chosen)  # the share is theirs, whatever else may be the cause
    what = {"none_of_these": f"even the nearest ({names})", "ambiguous": names}.get(report.verdict, "this")
    return (
        f"How far: on {days}, {what} removes {said} of the gap above noise;"
        f" a placebo of equal freedom removes {_share(placebo)} on average in the channel where it removes most."
        f"{untold}"
    )


def _removed(one: ShrinkageOf, channel: str) -> str:
    """Share and interval of a channel; where even the lower end is all of the gap, what is left, beside the noise."""
    share, low, high = one.told
    if not one.all_gone:  # an interval of no width would be told
        return f"{_share(share)} in {channel} (90 % interval {_share(low)} to {_share(high)})"
    after, floor = one.after or 0.0, one.floor or 0.0  # there is a share, so there are readings
    rest = after / floor if floor > 0 else math.inf
    left = "less than 1%" if rest < 0.01 else percent(rest, 0)
    return f"all in {channel} (the rest is {left} of the assumed noise, {number(floor, 3)}{spaced(one.unit)})"


def _share(value: float | None) -> str:
    """A share as text."""
    return "?" if value is None else percent(value, 0)
