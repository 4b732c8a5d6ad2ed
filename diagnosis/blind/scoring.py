"""Open the sealed answers and hold the verdicts against them. Nothing of the diagnosis itself is looked at here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.blind import rates
from diagnosis.blind.expected import DETECTABLE, Expected
from diagnosis.blind.opened import Hit, LeftOut, Row, hit, inputs_of, left_out, side_by_side, structural
from diagnosis.blind.rates import Figure, figure, median, share
from diagnosis.blind.score_schema import Both, Rates, Score, Where
from diagnosis.blind.sealed import MANIFEST, commands, open_answers, read_manifest
from diagnosis.blind.shrinking import by_channel, errors, removed, where_largest
from diagnosis.blind.verdicts import RUN, WITHOUT, Run, digest, name_of, read_run
from shared.errors import RecordingError
from shared.places import check_folder
from shared.store import sha256_of, write_atomically


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
    _same_recordings(rows, folder)
    made = _scored(rows, left_out(rows, results), run, opened, _places(rows, folder, opened["step"]), seed)
    made = made.model_copy(
        update={
            "answers_sha256": sha256_of(answers),
            "verdicts_sha256": said,
            "planned": planned,
            "withheld": withheld,
            "commands": commands(
                *(opened, run, folder, answers, results, out), seed=seed, count=count, leave_one_out=withheld == count
            ),
        }
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


VISIBLE = (
    "A gap can be seen in a channel when the root mean square of the sealed difference (noise-free record less the"
    " base model with the true parameters) is at least the noise of one reading, and larger than in 95 % of this"
    " set's recordings without any effect and with the same actuators (of twenty or fewer, in all). An effect is"
    " visible when its gap can be seen in some channel, whether or not other parameters would make the same gap."
)


def _scored(
    rows: list[Row], ones: list[LeftOut], run: Run, opened: dict[str, Any], places: list[Hit], seed: int
) -> Score:
    none = [row for row in rows if row.truth == "no_gap"]
    outside = [row for row in rows if row.truth == "none_of_these"]
    seen = [one for one in ones if one.row.visible]
    expected = Expected(opened["recordings"], run.library)
    beyond = [row for row in rows if expected.detectable(row)]
    found, lost, unseen = removed(rows, structural(opened["recordings"], 0.5))
    clear = [[one for one in some if expected.detectable(one.row)] for some in (found, lost, unseen)]
    named = [row for row in rows if row.named and row.truth == "effect"]
    lifts = [(one.lift, one.chance) for one in places if one.lift is not None and one.chance is not None]
    return Score(
        commands=[],
        seed=opened["seed"],
        bootstrap_seed=seed,
        answers_sha256="",
        verdicts_sha256="",
        program=run.program,
        version=run.version,
        system=run.system_name,
        recordings=len(rows),
        hours=opened["hours"],
        library=run.library,
        without=run.without,
        failures={row.answer["file"]: row.outcome.failure for row in rows if row.outcome.verdict is None},
        left_out_failures={
            one.row.answer["file"]: one.outcome.failure for one in ones if one.again and one.outcome.verdict is None
        },
        seconds=_median([row.outcome.seconds for row in rows], seed),
        cpu_seconds=_median([used for row in rows if (used := row.outcome.cpu_seconds) is not None], seed),
        right=share([row.right for row in rows]),
        visible_definition=VISIBLE,
        detectable_definition=DETECTABLE,
        strata=rates.strata_by_verdict(rows),
        confusion=rates.effects_by_name(rows, run.library),
        false_alarms=share([row.outcome.answer != "no_gap" for row in none]),
        named_without_cause=share([bool(row.named) for row in none]),
        named_rightly=share([bool(set(row.effects) & set(row.named)) for row in rows if row.named]),
        effects=_effects(rows),
        detectable=_detectable(beyond, expected),
        declared=_rates("at an amplitude that the diagnosis declared it would see", [r for r in rows if r.declared]),
        two=_two([row for row in rows if len(row.effects) > 1]),
        two_detectable=_two([row for row in beyond if len(row.effects) > 1]),
        none_of_these=share([row.right for row in outside]),
        none_of_these_visible=share([row.right for row in outside if row.visible]),
        none_of_these_unlike=share([row.right for row in outside if expected.unlike(row)]),
        left_out=rates.leave_one_out(ones),
        left_out_visible=rates.leave_one_out(seen),
        left_out_unlike=rates.leave_one_out([one for one in ones if expected.left_out_unlike(one)]),
        power_by_size=rates.power_by_size(rows),
        power_by_gap=rates.power_by_gap(rows),
        power_by_length=rates.power_by_length(rows),
        first_statement=rates.reliability_of_first(rows, seed),
        all_statements=rates.reliability_of_all(rows, seed),
        brier=rates.brier_of_answers(rows, seed),
        where=Where(
            channel=share([one.channel for one in places]),
            any_channel=share([one.any_channel for one in places]),
            cell=share([lift >= 1.0 for lift, _ in lifts]),
            chance=figure(np.array([chance for _, chance in lifts]), seed=seed),
            lift=_median([lift for lift, _ in lifts], seed),
        ),
        shrinkage=[*by_channel(found, lost, seed), where_largest(found, lost, seed=seed)],
        shrinkage_detectable=where_largest(*clear, seed=seed),
        parameters=errors(named, run.parameters, seed),
        parameters_right=errors([row for row in named if row.covered], run.parameters, seed),
        held=[rates.sizes(rows, seed), *rates.parameters(rows, run.parameters, seed)],
        names=rates.names(rows, seed),
    )


def _median(values: Sequence[float], seed: int) -> Figure:
    return figure(np.array(values), median, seed=seed)


def _effects(rows: Sequence[Row]) -> list[Rates]:
    """The library's effects as candidates have them, in other forms, and both; all, and those visible."""
    found = []
    kinds = {"as the candidate has it": ("library",), "in another form": ("form",), "both": ("library", "form")}
    for what, strata in kinds.items():
        for only in (True, False):
            ones = [row for row in rows if row.single and row.stratum in strata and (row.visible or not only)]
            found.append(_rates(f"{what}, {'visible' if only else 'all amplitudes'}", ones))
    return found


def _detectable(rows: Sequence[Row], expected: Expected) -> list[Rates]:
    """Of detectable gaps: the library's effects, other forms, both, where no other is like it, and of their kind."""
    single = [row for row in rows if row.single]
    library, form = ([row for row in single if row.stratum == name] for name in ("library", "form"))
    apart = [row for row in [*library, *form] if expected.unlike(row, row.effects)]
    return [
        _rates("as the candidate has it, detectable", library),
        _rates("in another form, detectable", form),
        _rates("both, detectable", [*library, *form]),
        _rates("both, and unlike all other candidates", apart),
        _rates("in another form, of its candidate's kind", [row for row in form if expected.of_its_kind(row)]),
    ]


def _rates(what: str, ones: Sequence[Row]) -> Rates:
    return Rates(
        what=what,
        found=share([row.found for row in ones]),
        top=share([row.top for row in ones]),
        covered=share([row.covered for row in ones]),
    )


def _two(rows: Sequence[Row]) -> Both:
    return Both(
        found=share([row.found for row in rows]),
        first=share([row.top for row in rows]),
        one=share([bool(set(row.effects) & set(row.named)) for row in rows]),
        both=share([row.covered for row in rows]),
    )


def _same_recordings(rows: Sequence[Row], folder: Path) -> None:
    """Every verdict is on the recording that was published."""
    for row in rows:
        if row.outcome.sha256 != sha256_of(folder / row.answer["file"]):
            raise RecordingError(f"verdict on {row.answer['file']}: sha256 is not that of the recording in {folder}")


def _places(rows: Sequence[Row], folder: Path, step: float) -> list[Hit]:
    """Where-hits of recordings whose gap can be seen; regimes are looked up in the recording's own inputs."""
    found = []
    for row in rows:
        if not row.visible:
            continue
        found.append(hit(row, inputs_of(folder / row.answer["file"]), step))
    return found
