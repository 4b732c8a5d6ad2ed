"""A score for people: one self-contained page, and the same tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.blind.scored import DETECTABLE, Line, Score
from diagnosis.curves import BLUE, GREY, embedded, figure
from diagnosis.pages import page_environment

Rows = list[tuple[str, ...]]
HEAD = ("figure", "value", "wanted")
STRATA = {
    "none": "no cause",
    "library": "an effect of the library",
    "form": "the same by another law",
    "two": "two effects",
    "outside": "a cause that no candidate describes",
    "withheld": "an effect that was withheld",
}
NOTES = (
    "Intervals are 95 %. A recording without a verdict counts as a wrong answer.",
    "The oracle knows cause and amplitude, and removes all of the gap but what the truth's finer walls leave. Left"
    " out are recordings whose diagnosis named an effect and gave no share, and gaps no larger than the walls'.",
    DETECTABLE,
)


def value(one: Line) -> str:
    """A figure with its interval."""
    if one.value is None:
        return "–"
    if not one.share:
        between = "" if one.low is None else f", {one.low:.3g} to {one.high:.3g}"
        return f"{one.value:.3g} ({one.n}{between})"
    between = "" if one.low is None or one.high is None else f", {one.low:.0%} to {one.high:.0%}"
    return f"{one.value:.0%} ({f'{one.hits} of {one.n}' if one.hits is not None else one.n}{between})"


def figures(done: Score) -> Rows:
    """Every figure: what, value, what is wanted."""
    wanted = (
        "" if one.wanted is None else f"{'at most' if one.most else 'at least'} {one.wanted:.0%}" for one in done.lines
    )
    return [(one.what, value(one), want) for one, want in zip(done.lines, wanted, strict=True)]


def answers(done: Score) -> Rows:
    """How recordings were answered, by what was true; the first row is the head."""
    head = ("recordings with", *next(iter(done.answers.values()), {}))
    return [head, *((STRATA.get(name, name), *map(str, counts.values())) for name, counts in done.answers.items())]


def reliability(done: Score) -> Rows:
    """What was said with a probability, and how often it was so."""
    return [
        (one.what, f"{one.low:.0%} to {one.high:.0%}", f"{one.said:.0%}", value(one.true)) for one in done.reliability
    ]


def about(done: Score) -> str:
    """What was scored."""
    some = f"the first {done.recordings} of {done.planned}" if done.recordings < done.planned else f"{done.recordings}"
    without = f" without {', '.join(done.without)}" if done.without else ""
    return (
        f"{some} recordings of {done.hours:g} h, seed {done.seed}, {len(done.library)} candidates{without};"
        f" {len(done.failures)} failed."
    )


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
        about(done),
        _table(HEAD, figures(done)),
        _table(answers(done)[0], answers(done)[1:]),
        _table(("what", "said", "mean", "true"), reliability(done)),
        "\n".join(NOTES),
        "```sh\n" + "\n".join(done.commands) + "\n```",
        partly_withheld(done),
        f"Answers sha256 `{done.answers_sha256}`, verdicts sha256 `{done.verdicts_sha256}`.",
    ]
    return "\n\n".join(part for part in parts if part)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def page(done: Score) -> str:
    """The page, its picture included."""
    return (
        page_environment()
        .get_template("blind_score.html.j2")
        .render(
            score=done,
            about=about(done),
            figures=figures(done),
            answers=answers(done),
            reliability=reliability(done),
            notes=NOTES,
            partly_withheld=partly_withheld(done),
            picture=_picture([one for one in done.lines if one.share and one.value is not None]),
        )
    )


def _picture(lines: Sequence[Line]) -> str:
    """Every share with its interval, and a stroke where it is wanted to be."""
    made, (panel,) = figure(height=0.9 + 0.34 * len(lines))
    for row, one in enumerate(lines):
        if one.low is not None:
            panel.plot([one.low, one.high], [row, row], color=BLUE, lw=2.5, alpha=0.45)
        panel.plot([one.value], [row], "o", color=BLUE, ms=6)
        if one.wanted is not None:
            panel.plot([one.wanted] * 2, [row - 0.35, row + 0.35], color=GREY, lw=2)
    panel.set_yticks(range(len(lines)), [f"{one.what} ({one.n})" for one in lines], fontsize=8)
    panel.set_xlim(min(0.0, *(one.low or 0.0 for one in lines)) - 0.02, 1.02)
    panel.set_xlabel("share with its 95 % interval; grey stroke: wanted")
    panel.invert_yaxis()
    return embedded(made)
