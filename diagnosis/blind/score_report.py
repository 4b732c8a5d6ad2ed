"""A score for people: one self-contained page, and the tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.blind import score_pictures as pictures
from diagnosis.blind.rates import FEW, Figure, LeftOutScore, Named, Names, Share
from diagnosis.blind.score_schema import Score
from diagnosis.blind.shrinking import Shrinkage
from diagnosis.pages import page_environment

Lines = list[tuple[str, str, str]]
LEAST = "the same, with nothing removed where there is no figure"
UNKNOWN = "named, but no share on the scored part (no gap above the noise there, or too few readings)"
NAMED = ("effects that an answer names", "a true cause is among them", "if as many were drawn at random")
WITHOUT = (
    "A recording without a verdict counts as a wrong answer, but has no part in what is said of the most probable"
    " answer, nor in effects that the diagnosis declared it would see; in the Brier score of all answers it is one that"
    " says nothing"
)
BRACKETS = (
    "Brackets of counted hits are Wilson's. All others come from drawing the recordings anew: of one recording there"
    f" are none, of fewer than {FEW} they are too narrow, and where all are alike they have no width."
)
OWN_FORM = "as the candidate has it; declared after parameters have compensated"


def percent(one: Share) -> str:
    """A share with its interval."""
    if one.value is None:
        return "–"
    return f"{one.value:.0%} ({one.low:.0%} to {one.high:.0%}; {one.hits} of {one.n})"


def either(one: Share | Figure) -> str:
    """Whichever of both it is."""
    return percent(one) if isinstance(one, Share) else number(one)


def number(one: Figure) -> str:
    """A figure with its interval."""
    if one.value is None:
        return "–"
    between = "" if one.low is None else f"{one.low:.3g} to {one.high:.3g}; "
    return f"{one.value:.3g} ({between}n = {one.n})"


def against_oracle(one: Shrinkage) -> str:
    """The ratio to what an oracle removes, with how many recordings it is of, and why of no more."""
    if one.share.n == one.asked:
        return number(one.ratio)
    unseen = f", {one.unseen} with a gap that no channel shows" if one.unseen else ""
    return (
        f"{number(one.ratio)}; {one.share.n} of {one.asked} have a figure, {one.unknown} named effects but gave no"
        f" share on the scored part{unseen}"
    )


def bound(one: Shrinkage) -> str:
    """The ratio if nothing was removed where no share is known."""
    return "–" if one.least is None else number(one.least)


def lengths(one: Names) -> str:
    """How many effects answers name."""
    largest = "–" if one.largest is None else f"{one.largest}"
    return (
        f"Of answers that name effects: names in the median {number(one.median)}, in nine of ten at most"
        f" {number(one.nine_in_ten)}, in the longest {largest}."
    )


def by_size(one: Names) -> Lines:
    """How often answers of so many names hold a true cause, and how often as many drawn at random would."""
    return [(_so_many(named), percent(named.held), by_chance(named.chance)) for named in one.by_size]


def _so_many(one: Named) -> str:
    if one.most is None:
        return "any number" if one.least == 1 else f"{one.least} or more"
    return f"{one.least}" if one.least == one.most else f"{one.least} to {one.most}"


def by_chance(one: Figure) -> str:
    """An expected share with its interval, and how many that are."""
    if one.value is None:
        return "–"
    between = "" if one.low is None else f"{one.low:.0%} to {one.high:.0%}; "
    return f"{one.value:.0%} ({between}{one.value * one.n:.1f} of {one.n})"


def headline(done: Score) -> Lines:
    """What there are targets for: what, figure, target."""
    plain, form, both, apart, kind = done.detectable
    seen, _, other, _, _, _ = done.effects
    return [
        ("top-1, library effects at a detectable amplitude", percent(plain.top), "at least 90 %"),
        ("set coverage, the same", percent(plain.covered), "at least 95 %"),
        ("top-1, the same effects in another form", percent(form.top), "–"),
        ("set coverage, the same", percent(form.covered), "–"),
        ("top-1, another form of its candidate's kind", percent(kind.top), "–"),
        ("set coverage, the same", percent(kind.covered), "–"),
        ("top-1, both together", percent(both.top), "at least 90 %"),
        ("set coverage, both together", percent(both.covered), "at least 95 %"),
        ("top-1, both together, unlike all other candidates", percent(apart.top), "–"),
        ("false alarms without any effect", percent(done.false_alarms), "at most 5 %"),
        (
            "recall of none of these, causes outside the library, unlike all candidates",
            percent(done.none_of_these_unlike),
            "at least 80 %",
        ),
        (
            "leave-one-out, unlike all other candidates: none of these",
            percent(done.left_out_unlike.none),
            "at least 80 %",
        ),
        ("the same, or only effects declared confusable with it", percent(done.left_out_unlike.none_or_alike), "–"),
        ("shrinkage against the oracle's, detectable gaps", against_oracle(done.shrinkage_detectable), "at least 0.9"),
        (LEAST, bound(done.shrinkage_detectable), "–"),
        ("visible library effects, detectable or not: top-1", percent(seen.top), "–"),
        ("set coverage, the same", percent(seen.covered), "–"),
        ("visible effects in another form: top-1", percent(other.top), "–"),
        ("set coverage, the same", percent(other.covered), "–"),
        ("visible causes outside the library: none of these", percent(done.none_of_these_visible), "–"),
        ("leave-one-out, visible: none of these", percent(done.left_out_visible.none), "–"),
        ("the same, or only effects declared confusable with it", percent(done.left_out_visible.none_or_alike), "–"),
        ("shrinkage against the oracle's, visible gaps", against_oracle(done.shrinkage[-1]), "–"),
        (LEAST, bound(done.shrinkage[-1]), "–"),
    ]


def further(done: Score) -> Lines:
    """Other figures: what, figure, and what it says."""
    return [
        ("right of all", percent(done.right), "first effect, none of these, or no gap"),
        ("named an effect where there is none", percent(done.named_without_cause), "of recordings without any effect"),
        ("of answers that name effects, a true cause is among them", percent(done.named_rightly), "all strata"),
        ("the same, if as many were drawn at random", by_chance(done.names.by_size[0].chance), "what chance gives"),
        ("library effects that the diagnosis declared it would see: top-1", percent(done.declared.top), OWN_FORM),
        ("set coverage, the same", percent(done.declared.covered), ""),
        ("two effects: a gap found", percent(done.two.found), ""),
        ("two effects: one of them named first", percent(done.two.first), ""),
        ("two effects: one of them named", percent(done.two.one), ""),
        ("two effects: both named", percent(done.two.both), ""),
        ("two effects, detectable: one of them named", percent(done.two_detectable.one), ""),
        ("the same: both named", percent(done.two_detectable.both), ""),
        ("causes outside the library, all amplitudes: none of these", percent(done.none_of_these), ""),
        ("leave-one-out, all amplitudes: none of these", percent(done.left_out.none), _again(done.left_out)),
        ("the same, or only effects confusable with it", percent(done.left_out.none_or_alike), ""),
        ("the same: no gap", percent(done.left_out.quiet), ""),
        ("first place named lies in the right channel", percent(done.where.channel), "visible gaps; silence counts"),
        ("some place named lies in the right channel", percent(done.where.any_channel), "the same"),
        ("gap larger than average in the first cell named", percent(done.where.cell), "where a cell was named"),
        ("the same cells at other times", number(done.where.chance), "what chance gives"),
        ("gap's mean square within over its average", number(done.where.lift), "median"),
        ("Brier score of all answers", number(done.brier), "0 is perfect, 1 says nothing, 2 is worst"),
        ("Brier score of the most probable answer", number(done.first_statement.brier), _reference(done)),
        ("calibration error of the most probable answer", number(done.first_statement.error), ""),
        ("seconds for one recording, median", number(done.seconds), "wall clock, all candidates"),
        ("the same, of the processor", number(done.cpu_seconds), ""),
    ]


def held(done: Score) -> Lines:
    """Whether stated intervals hold the truth: of what, the share of them, and how far off they are."""
    return [(one.what, either(one.held), number(one.error)) for one in done.held]


def _again(one: LeftOutScore) -> str:
    failed = f"; {one.failed} of {one.n} failed, at first or again, and count as wrong" if one.failed else ""
    return f"{one.again} of {one.n} diagnosed again; the others had given it no chance{failed}"


def _reference(done: Score) -> str:
    found = done.first_statement.reference
    return "" if found is None else f"{found:.3g} by always saying how often it is right"


def of_the_set(done: Score) -> str:
    """How many recordings were scored."""
    some = done.recordings < done.planned
    return f"the first {done.recordings} of {done.planned} recordings" if some else f"{done.recordings} recordings"


def partly_withheld(done: Score) -> str:
    """That only some recordings were diagnosed again without single candidates, which no command can say."""
    if done.withheld in (0, done.recordings):
        return ""
    return (
        f"{done.withheld} of the {done.recordings} recordings were also diagnosed with effects withheld: by the second"
        " command with --leave-one-out, and nothing else in it changed."
    )


def markdown(done: Score) -> str:
    """The tables, with what it takes to make them again."""
    parts = [
        f"{of_the_set(done)} of {done.hours:g} h, seed {done.seed}, {len(done.library)} candidates"
        f"{' without ' + ', '.join(done.without) if done.without else ''}; {len(done.failures)} failed."
        " Intervals are 95 %.",
        _table(("figure", "value", "target"), headline(done)),
        _table(("further", "value", ""), further(done)),
        _table(("stratum", *done.strata.columns), _matrix(done)),
        lengths(done.names),
        _table(NAMED, by_size(done.names)),
        _table(
            ("channel", "share removed", "oracle", "ratio", "median ratio", UNKNOWN, "ratio if they removed nothing"),
            [
                (c.channel, *map(number, (c.share, c.oracle, c.ratio, c.median)), str(c.unknown), bound(c))
                for c in done.shrinkage
            ],
        ),
        f"Shares removed are cut off at -1 and 1. {WITHOUT}.",
        _table(
            ("parameter", "error before", "error after", "change"),
            [(p.parameter, number(p.before), number(p.after), number(p.change)) for p in done.parameters],
        ),
        _table(("90 % intervals of", "that hold the truth", "error in standard deviations, rms"), held(done)),
        BRACKETS,
        done.detectable_definition + " " + done.visible_definition,
        "```sh\n" + "\n".join(done.commands) + "\n```",
        partly_withheld(done),
        f"Answers sha256 `{done.answers_sha256}`, verdicts sha256 `{done.verdicts_sha256}`.",
    ]
    return "\n\n".join(part for part in parts if part)


def _matrix(done: Score) -> list[tuple[str, ...]]:
    return [(row, *map(str, counts)) for row, counts in zip(done.strata.rows, done.strata.counts, strict=True)]


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def page(done: Score) -> str:
    """The page, pictures and all."""
    environment = page_environment()
    environment.filters["percent"] = percent
    environment.filters["number"] = number
    environment.filters["bound"] = bound
    return environment.get_template("blind_score.html.j2").render(
        of_the_set=of_the_set(done),
        partly_withheld=partly_withheld(done),
        score=done,
        headline=headline(done),
        further=further(done),
        held=held(done),
        brackets=BRACKETS,
        lengths=lengths(done.names),
        named=NAMED,
        without=WITHOUT,
        by_size=by_size(done.names),
        unknown=UNKNOWN,
        strata_picture=pictures.confusion(done.strata, "stratum", "verdict", of=done.recordings),
        confusion_picture=pictures.confusion(
            done.confusion, "true effect", "named first", of=done.recordings, missing="those of two causes"
        ),
        power_picture=pictures.power(done.power_by_size, done.power_by_gap, done.power_by_length),
        reliability_picture=pictures.reliability(done.first_statement, done.all_statements),
        shrinkage_picture=pictures.shrinkage(done.shrinkage),
        parameter_picture=pictures.parameters(done.parameters),
    )
