"""The answer in three sentences, and what limits it."""

from __future__ import annotations

from diagnosis.gap.schema import NamedEffect, Report

UNCHECKED = (
    "Too few blind recordings have been scored yet to say how often such verdicts and probabilities are right: take"
    " them for an order in which to look, not for odds."
)


def summary(report: Report) -> list[str]:
    """Where, which, and how far; how sure is said with each."""
    return [_where(report), _which(report), _how_far(report)]


def _where(report: Report) -> str:
    first = report.stages[0]
    if report.verdict == "no_gap":
        return (
            "Where: nowhere that can be told from noise; the calibrated model explains the recording as well as it"
            f" explains recordings of its own making (p = {first.p_value:.2g} over all candidates,"
            f" {first.where_p:.2g} over all places)."
        )
    if not report.where:
        return (
            "Where: no single place, hour or state stands out, though the recording as a whole differs from the model."
        )
    best, *others = report.where
    channels = list(dict.fromkeys(one.channel for one in others if one.channel != best.channel))
    more = f"; {len(others)} more findings" if others else ""
    also = f", also in {', '.join(channels)}" if channels else ""
    kind = {
        "balance": " It looks like a source that the balance lacks.",
        "sensor": " It looks like the error of a sensor rather than of a balance.",
    }.get(report.balance, "")
    return f"Where: {best.text}{more}{also}.{kind}"


def _which(report: Report) -> str:
    named = [one for one in report.effects if one.named]
    if report.verdict == "no_gap":
        return f"Which: no effect is needed; the probability that there is no gap is {report.no_gap:.0%}."
    if report.verdict == "none_of_these":
        best = report.effects[0] if report.effects and report.effects[0].probability > 0 else None
        nearest = f"; the nearest is {best.name}, which leaves too much" if best else ""
        return (
            f"Which: none of the {len(report.effects)} candidates explains it (probability {report.none_of_these:.0%})"
            f"{nearest}."
        )
    if report.verdict == "ambiguous":
        sets = " and ".join("one of " + ", ".join(_sure(report, name) for name in one) for one in report.sets)
        return f"Which: {sets}; the recording cannot tell these apart."
    said = " and ".join(f"{one.name}, {_amount(one)} (probability {one.probability:.0%})" for one in named)
    rest = " Something more is left that these do not explain." if report.rejected else ""
    return f"Which: {said}.{rest}"


def _sure(report: Report, name: str) -> str:
    one = next(one for one in report.effects if one.name == name)
    return f"{name} ({one.probability:.0%})"


def _amount(one: NamedEffect) -> str:
    if one.amplitude is None or one.low is None or one.high is None:
        return one.description
    return f"{one.amplitude:.3g} {one.unit} ({one.low:.3g} to {one.high:.3g})"


def _how_far(report: Report) -> str:
    if report.verdict == "no_gap":
        return "How far: there is no gap to shrink."
    shares = [one for one in report.shrinkage if one.share is not None]
    if not shares:
        return (
            "How far: on the part of the recording that took no part in fitting, no channel's gap stands out from the"
            " noise, so no share of it can be given."
        )
    said = ", ".join(
        f"{_share(one.share)} in {one.channel} ({_share(one.low)} to {_share(one.high)})" for one in shares
    )
    placebo = max((one.placebo or 0.0) for one in shares)
    return (
        f"How far: on the part that took no part in fitting or choosing, this removes of the gap above noise {said};"
        f" a placebo of equal freedom removes {placebo:.0%} at most on average."
    )


def _share(value: float | None) -> str:
    """A share as text; above one, what is left is below the noise that was assumed: all of the gap, and no more."""
    return "?" if value is None else f"{min(value, 1.0):.0%}"


def limits(report: Report) -> list[str]:
    """What was not known and how that limits the answer."""
    found = [UNCHECKED]
    if report.occupancy == "unknown":
        found.append(
            "Persons were not counted: whatever looks like people coming and going at other times than usual is taken"
            " for them. Effects that act when people are there are hard to see; compare the shares in the table of"
            " detectability, which say how much of each is left to see."
        )
    if report.replay:
        found.append(
            f"The recorded actuators ({', '.join(report.replayed)}) drive the model: their own readings are no"
            " evidence, and errors of their meters act on the other outputs."
        )
    blind = [one.name for one in report.detectability if one.smallest is None]
    if blind:
        found.append(f"Could not be seen in this recording at any size that is allowed: {', '.join(blind)}.")
    if report.excluded:
        found.append("Not tried: " + "; ".join(f"{name} ({why})" for name, why in report.excluded.items()) + ".")
    named = [one for one in report.detectability if one.name in {n for s in report.sets for n in s} and one.confusable]
    found += [
        f"A gap by {one.name} of twice the usual size would be hard to tell from {', '.join(one.confusable)} here."
        for one in named
    ]
    bound = [one.name for one in report.parameters if one.at_bound]
    if bound:
        found.append(f"On the bounds of their ranges in the base model: {', '.join(bound)}.")
    if not report.converged:
        found.append("The fit of the base model had not come to rest when it stopped.")
    if report.assumed:
        found.append("Not measured: " + "; ".join(f"{name}: {what}" for name, what in report.assumed.items()) + ".")
    return found
