"""Open the sealed answers and hold the verdicts against them: what answers are worth, one line for each figure.

Nothing of the diagnosis itself is looked at here. Which gaps can be seen is told by the sealed answers alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import bootstrap, norm

from diagnosis.blind.scored import Bin, Line, Score, binned
from diagnosis.blind.sealed import MANIFEST, commands, open_answers, read_manifest
from diagnosis.blind.verdicts import (
    ANSWERS,
    FAILED,
    RUN,
    WITHOUT,
    Moved,
    Outcome,
    Run,
    Verdict,
    check_program,
    digest,
    name_of,
    read_outcome,
    read_run,
    read_withheld,
)
from shared.errors import RecordingError
from shared.metrics import wilson
from shared.places import check_folder
from shared.store import sha256_of, write_atomically

LEVEL = 0.95
"""Of all intervals."""
DRAWS = 2000
ALARMS, POWER = 0.05, 0.9
"""Of the observer who decides whether a gap is detectable: false alarms in all, and how often he is to see it."""
SAME = 0.5
"""A channel is right when its sealed gap over noise is at least this share of the largest channel's."""
WITHHELD = "withheld"
"""Stratum of recordings whose only cause was withheld from the library."""


@dataclass(frozen=True)
class Row:
    """One recording: ``answer`` is what was sealed, ``truth`` the right verdict, ``effects`` the right candidates.

    ``again``: the outcome without the only cause, where that was asked for.
    """

    answer: dict[str, Any]
    outcome: Outcome
    stratum: str
    truth: str
    effects: tuple[str, ...]
    detectable: bool = False
    again: Outcome | None = None

    @property
    def named(self) -> tuple[str, ...]:
        """All effects of the answer."""
        verdict = self.outcome.verdict
        return tuple(verdict.named) if verdict is not None and verdict.verdict in ("effect", "ambiguous") else ()

    @property
    def held(self) -> bool:
        """Whether a true cause is in the answer."""
        return bool(set(self.effects) & set(self.named))

    @property
    def single(self) -> bool:
        """Whether the right answer is one effect."""
        return self.truth == "effect" and len(self.effects) == len(self.answer["causes"]) == 1

    @property
    def gap(self) -> dict[str, float]:
        """Sealed gap over noise by channel."""
        return dict(self.answer["gap_over_noise"])

    @property
    def channel(self) -> str:
        """The channel where the sealed gap over noise is largest."""
        return max(self.gap, key=lambda name: self.gap[name])


def score(
    folder: Path | str,
    answers: Path | str,
    results: Path | str,
    *,
    out: Path | str | None = None,
    first: int | None = None,
    seed: int = 0,
) -> Score:
    """Score the verdicts of a run.

    Parameters
    ----------
    folder
        What ``blind make`` published.
    answers
        The sealed file.
    results
        What ``blind run`` wrote; of it only ``run.json`` and the verdict files are read.
    out
        The page (HTML); JSON and Markdown are written beside it.
    first
        How many recordings are scored, from the beginning of the set; all if not given. For a run that was stopped:
        how far it comes has nothing to do with how right it is, and the score says that it is of so many. What can be
        seen at all is worked out from all sealed answers of the set, however many are scored.
    seed
        Of the bootstraps.

    Raises
    ------
    RecordingError
        If the answers are not those that were sealed, the verdicts are incomplete or those of another set, or the page
        cannot be written or would take the place of what is read.
    """
    folder, answers, results = Path(folder), Path(answers), Path(results)
    out = None if out is None else _page(Path(out), (answers, folder / MANIFEST, results / RUN))
    run = read_run(results)
    published = read_manifest(folder)
    if run.answers_sha256 != published["answers_sha256"]:
        raise RecordingError(f"{results}: is a run of another set; expected one of {folder}")
    planned = len(published["recordings"])
    count = planned if first is None else first
    if not 1 <= count <= planned:
        raise RecordingError(f"first is {count}; {folder} holds {planned} recordings; expected 1 to {planned}")
    files = [one["file"] for one in published["recordings"][:count]]
    said = digest(results, files)  # before anything is opened
    withheld = sum((results / WITHOUT / name_of(file)).exists() for file in files)
    opened = open_answers(folder, answers)
    rows = side_by_side(opened, results, run, count)
    for row in rows:
        if row.outcome.sha256 != sha256_of(folder / row.answer["file"]):
            raise RecordingError(f"verdict on {row.answer['file']}: sha256 is not that of the recording in {folder}")
    scored = ["--out", out or "score.html", "--seed", seed, *(["--first", count] if count < planned else [])]
    made = Score(
        commands=commands(opened, run, folder, answers, results, scored, leave_one_out=withheld == count),
        seed=opened["seed"],
        bootstrap_seed=seed,
        answers_sha256=sha256_of(answers),
        verdicts_sha256=said,
        program=run.program,
        version=run.version,
        system=run.system_name,
        recordings=len(rows),
        planned=planned,
        withheld=withheld,
        hours=opened["hours"],
        library=run.library,
        without=run.without,
        failures={row.answer["file"]: row.outcome.failure for row in rows if row.outcome.verdict is None},
        left_out_failures={
            row.answer["file"]: row.again.failure for row in rows if row.again is not None and row.again.verdict is None
        },
        lines=_lines(rows, opened["recordings"], seed),
        answers=_answers(rows),
        reliability=_reliability(rows),
    )
    if out is not None:
        from diagnosis.blind.score_report import markdown, page

        out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(out.with_suffix(".json"), (made.model_dump_json(indent=1) + "\n").encode())
        write_atomically(out.with_suffix(".md"), (markdown(made) + "\n").encode())
        write_atomically(out, page(made).encode())
    return made


def _page(out: Path, read: Sequence[Path]) -> Path:
    """Where the page goes, unless it or the JSON beside it would be written over what else there is."""
    if out.suffix in (".json", ".md"):
        raise RecordingError(f"{out}: ending is {out.suffix!r}; expected .html, beside which .json and .md are written")
    for path in read:
        if out.with_suffix(".json").resolve() == path.resolve():
            raise RecordingError(f"{out}: its JSON would be written over {path}; expected another name")
    if out.is_dir():
        raise RecordingError(f"{out}: is a folder; expected a name for the page, such as {out / 'score.html'}")
    check_folder(out.parent, RecordingError)
    return out


def side_by_side(opened: dict[str, Any], results: Path, run: Run, first: int | None = None) -> list[Row]:
    """Answers and verdicts of the first recordings, or of all; what can be seen is that of the whole set.

    Raises
    ------
    RecordingError
        If the verdict on a recording is missing, or on another one.
    """
    longest = _longest(opened["recordings"], len(run.library))
    rows = []
    for answer in opened["recordings"][:first]:
        outcome = read_outcome(results, answer["file"])
        if outcome.file != answer["file"]:
            raise RecordingError(f"{results}: found the verdict on {outcome.file}; expected that on {answer['file']}")
        check_program(results, outcome, run)
        effects = tuple(name for name in answer["effects"] if name not in run.without)
        stratum, truth = answer["stratum"], answer["verdict"]
        if truth == "effect" and not effects:
            stratum, truth = WITHHELD, "none_of_these"
        sealed = answer.get("detectability")
        detectable = truth != "no_gap" and sealed is not None and sealed["length"] >= longest[answer["replay"]]
        row = Row(answer, outcome, stratum, truth, effects, detectable)
        rows.append(replace(row, again=_again(row, results)) if row.single else row)
    return rows


def _longest(answers: Sequence[dict[str, Any]], candidates: int) -> dict[bool, float]:
    """The length from which a gap is detectable, in replay and not; see :data:`diagnosis.blind.scored.DETECTABLE`."""
    needed = float(norm.isf(ALARMS / max(candidates, 1)) + norm.ppf(POWER))
    nothing = [one for one in answers if one["verdict"] == "no_gap" and one.get("detectability") is not None]
    found = {}
    for replay in (False, True):
        like = [one for one in nothing if one["replay"] == replay] or nothing
        lengths = [one["detectability"]["length"] for one in like]
        found[replay] = needed + (float(np.quantile(lengths, LEVEL, method="higher")) if lengths else 0.0)
    return found


def _again(row: Row, results: Path) -> Outcome | None:
    """The outcome without the only cause: the first one where that had given it no chance."""
    withheld = read_withheld(results, row.answer["file"])
    if withheld is None:
        return None
    for one in withheld.outcomes.values():
        if one.program != row.outcome.program and "" not in (one.program, row.outcome.program):
            raise RecordingError(
                f"{results}: found a verdict of program {one.program[:12]} on {one.file} with effects withheld;"
                f" expected {row.outcome.program[:12]}, that of the verdict with all"
            )
        if (one.file, one.sha256) != (row.outcome.file, row.outcome.sha256):
            raise RecordingError(
                f"{results}: found a verdict on {one.file} ({one.sha256}) among those on {row.answer['file']} with"
                f" effects withheld; expected {row.outcome.sha256}"
            )
    return withheld.outcomes.get(row.effects[0], row.outcome)


def counted(what: str, hits: Sequence[bool], wanted: float | None = None, *, most: bool = False) -> Line:
    """The share of hits, with Wilson's interval."""
    n, k = len(hits), int(sum(hits))
    if not n:
        return Line(what=what, n=0, hits=0, wanted=wanted, most=most)
    low, high = wilson(k / n, n, float(norm.ppf((1 + LEVEL) / 2)))
    return Line(what=what, n=n, value=k / n, low=float(low), high=float(high), hits=k, wanted=wanted, most=most)


def _drawn(
    what: str,
    *samples: Sequence[float],
    seed: int,
    statistic: Callable[..., Any] = np.mean,
    share: bool = False,
    wanted: float | None = None,
) -> Line:
    """A statistic of recordings, with its bootstrap interval; one recording says nothing of others."""
    values, n = tuple(np.asarray(one, dtype=float) for one in samples), len(samples[0])
    line = Line(what=what, n=n, share=share, wanted=wanted)
    if not n:
        return line
    line = line.model_copy(update={"value": float(statistic(*values, axis=0))})
    if n == 1:
        return line
    ends = bootstrap(
        values,
        statistic,
        n_resamples=DRAWS,
        confidence_level=LEVEL,
        method="percentile",
        paired=len(values) > 1,
        vectorized=True,
        random_state=np.random.default_rng(seed),
    ).confidence_interval
    return line.model_copy(update={"low": float(ends.low), "high": float(ends.high)})


def _ratio(over: np.ndarray, under: np.ndarray, axis: int) -> Any:
    return over.mean(axis=axis) / under.mean(axis=axis)


def _lines(rows: Sequence[Row], answers: Sequence[dict[str, Any]], seed: int) -> list[Line]:
    """All figures, those that are wanted first."""
    none = [row for row in rows if row.truth == "no_gap"]
    seen = [row for row in rows if row.detectable]
    library, form = ([row for row in seen if row.single and row.stratum == name] for name in ("library", "form"))
    outside = [row for row in seen if row.truth == "none_of_these"]
    again = [row for row in seen if row.again is not None]
    named = [row for row in rows if row.named]
    right = [row for row in named if row.held]
    by_answer = {name: [row for row in rows if row.outcome.answer == name] for name in ANSWERS}
    lost, had = _removed([row for row in seen if row.truth == "effect"], answers)
    used = [row.outcome.cpu_seconds for row in rows if row.outcome.cpu_seconds is not None]

    def intervals(what: str, some: Sequence[Row], *, after: bool = False, wanted: float | None = None) -> Line:
        held = [share for row in some if (share := _covered(row, after)) is not None]
        return _drawn(f"90 % intervals of parameters that cover, {what}", held, seed=seed, share=True, wanted=wanted)

    return [
        counted(
            "gaps answered where there is no cause", [row.outcome.answer != "no_gap" for row in none], 0.04, most=True
        ),
        counted("detectable effect of the library: in the answer", [row.held for row in library], 0.95),
        counted("the same, named first", [_first(row) for row in library], 0.9),
        counted("detectable, the same effects by another law: in the answer", [row.held for row in form], 0.75),
        *(
            counted(
                f"answers with a name that hold a true cause, {what}",
                [row.held for row in named if row.answer["replay"] == replay],
                wanted,
            )
            for what, replay, wanted in (("controllers simulated", False, 0.88), ("in replay", True, 0.78))
        ),
        counted(
            "detectable cause that no candidate describes: none of these",
            [row.outcome.answer == "none_of_these" for row in outside],
            0.7,
        ),
        counted(
            "detectable effect, withheld from the candidates: none of these",
            [row.again is not None and row.again.answer == "none_of_these" for row in again],
            0.6,
        ),
        _drawn(
            "share of a detectable gap that is removed, of what an oracle removes",
            lost,
            had,
            seed=seed,
            statistic=_ratio,
            share=True,
            wanted=0.8,
        ),
        counted("90 % intervals of a rightly named effect's size that cover", _sizes(rows), 0.87),
        intervals("a true cause named and added", right, after=True, wanted=0.87),
        intervals("none of these answered", by_answer["none_of_these"], wanted=0.8),
        intervals("no gap answered", by_answer["no_gap"]),
        intervals("only wrong causes named and added", [row for row in named if not row.held], after=True),
        counted(
            "detectable gap of two effects: one of them named",
            [row.held for row in seen if row.truth == "effect" and len(row.answer["causes"]) > 1],
        ),
        counted(
            "detectable gap: the first place told is a channel where it is large", [_in_place(row) for row in seen]
        ),
        _drawn(
            "names in an answer with names, median", [len(row.named) for row in named], seed=seed, statistic=np.median
        ),
        _drawn("processor time of a recording, median [s]", used, seed=seed, statistic=np.median),
        Line(
            what="processor time of a recording, largest [s]", n=len(used), value=max(used, default=None), share=False
        ),
    ]


def _first(row: Row) -> bool:
    return row.outcome.verdict is not None and row.outcome.verdict.best in row.effects


def _in_place(row: Row) -> bool:
    places = row.outcome.verdict.where if row.outcome.verdict is not None and row.outcome.answer != "no_gap" else []
    # a missing source has a name that a channel may have too
    told = places[0].channel if places and places[0].kind != "source" else None
    return told is not None and row.gap.get(told, 0.0) >= SAME * row.gap[row.channel]


def _removed(rows: Sequence[Row], answers: Sequence[dict[str, Any]]) -> tuple[list[float], list[float]]:
    """Shares of the gap that were removed, and that an oracle removes, in the channel where the gap is largest.

    The oracle knows cause and amplitude, and leaves what recordings without an effect have as well: the truth's finer
    walls (the median of those with the same actuators). Nothing is removed where no effect was named; a recording is
    left out whose diagnosis gave no share, since it saw no gap above the noise on the scored part.
    """
    none = [one for one in answers if one["verdict"] == "no_gap"]
    lost, had = [], []
    for row in rows:
        like = [one for one in none if one["replay"] == row.answer["replay"]] or none
        walls = float(np.median([one["gap_over_noise"][row.channel] for one in like])) if like else 0.0
        share = _share(row.outcome.verdict, row.channel) if row.named else 0.0
        if share is not None and row.gap[row.channel] > walls:
            lost.append(min(max(share, -1.0), 1.0))
            had.append(1.0 - (walls / row.gap[row.channel]) ** 2)
    return lost, had


def _share(verdict: Verdict | None, channel: str) -> float | None:
    one = verdict.shrinkage.get(channel) if verdict is not None else None
    return None if one is None else one.share


def _sizes(rows: Sequence[Row]) -> list[bool]:
    """Whether intervals of effects that act by their candidates' own laws hold the true size: others have another."""
    found = []
    for row in rows:
        true = {one["effect"]: float(one["amplitude"]) for one in row.answer["causes"] if not one["form"]}
        sizes = row.outcome.verdict.sizes if row.outcome.verdict is not None else {}
        found += [one.low <= true[name] <= one.high for name, one in sizes.items() if name in true]
    return found


def _covered(row: Row, after: bool) -> float | None:
    """Share of a recording's intervals that hold the true parameter, with what was named added or without."""
    moved = row.outcome.verdict.parameters if row.outcome.verdict is not None else {}
    ends = [(name, _ends(one, after)) for name, one in moved.items()]
    held = [pair[0] <= row.answer["parameters"][name] <= pair[1] for name, pair in ends if pair is not None]
    return float(np.mean(held)) if held else None


def _ends(one: Moved, after: bool) -> tuple[float, float] | None:
    low, high = (one.after_low, one.after_high) if after else (one.before_low, one.before_high)
    return None if low is None or high is None else (low, high)


def _answers(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    found: dict[str, dict[str, int]] = {}
    for stratum in dict.fromkeys(sorted(row.stratum for row in rows)):
        counts = Counter(row.outcome.answer for row in rows if row.stratum == stratum)
        found[stratum] = {name: counts[name] for name in (*ANSWERS, FAILED)}
    return found


def _reliability(rows: Sequence[Row]) -> list[Bin]:
    """What was said and what was true, by bins of what was said."""
    said: dict[str, list[tuple[float, bool]]] = {"no gap": [], "none of these": [], "the foremost candidate": []}
    for row in rows:
        verdict = row.outcome.verdict
        if verdict is None:
            continue
        if verdict.nothing is not None:
            said["no gap"].append((verdict.nothing, row.truth == "no_gap"))
        if verdict.none is not None:
            said["none of these"].append((verdict.none, row.truth == "none_of_these"))
        if verdict.probabilities:
            name = max(verdict.probabilities, key=lambda one: verdict.probabilities[one])
            said["the foremost candidate"].append((verdict.probabilities[name], name in row.effects))
    return [
        Bin(what=what, low=low, high=high, said=float(np.mean(some)), true=counted(what, true))
        for what, low, high, some, true in binned(said)
    ]
