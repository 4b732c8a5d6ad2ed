"""The command ``diagnosis blind``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from shared.console import OK, PARTLY, NotNegative, Place, Positive, new_console, resumable
from shared.logs import USUAL, Reporting, logger
from shared.progress import progress_bar

app = App(name="blind", help="Recordings whose effect is sealed, to find out what a diagnosis is worth.")
console = new_console()
_log = logger(__name__)


@app.command
@resumable()
def make(
    out: Place,
    *,
    system: Path = Path("MixedAirCO2"),
    recordings: Positive = 200,
    seed: NotNegative | None = None,
    answers: Path | None = None,
    truth: Path | None = None,
    hours: float = 672.0,
    workers: Positive = 1,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    report: Reporting = USUAL,
) -> int:
    """Write recordings whose effect is sealed: a folder to publish, and beside it the answers.

    Parameters
    ----------
    out
        Folder for the recordings and their manifest, which holds the answers' sha256.
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    recordings
        How many.
    seed
        Decides all; drawn and sealed if not given.
    answers
        The sealed file; OUT.answers.json if not given.
    truth
        What is true beyond the model (TOML); truth/truth.toml beside the system's folder if not given.
    hours
        Length of each recording [h], at least a day.
    workers
        Processes.
    as_json
        Print the manifest as JSON.
    """
    from diagnosis.blind.make import make as make_

    with progress_bar("recordings", recordings, shown=not report.quiet) as bar:
        manifest = make_(
            system,
            out,
            recordings=recordings,
            seed=seed,
            answers=answers,
            truth=truth,
            hours=hours,
            workers=workers,
            progress=lambda done, _: bar.update(done),
        )
    if as_json:
        sys.stdout.write(json.dumps(manifest, indent=1, allow_nan=False) + "\n")
        return OK
    console.print(f"{len(manifest['recordings'])} recordings in {out}", markup=False)
    console.print(f"answers sealed with sha256 {manifest['answers_sha256']}", markup=False, soft_wrap=True)
    return OK


@app.command
@resumable()
def run(
    system: Path,
    set_: Annotated[Path, Parameter(name="SET")],
    *,
    out: Place,
    workers: Positive = 1,
    without: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    leave_one_out: Annotated[bool, Parameter(negative=())] = False,
    estimator: Annotated[Path | None, Parameter(name="--run")] = None,
    seed: NotNegative = 0,
    limit: float = 3600.0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    report: Reporting = USUAL,
) -> int:
    """Diagnose every recording of a blind set, and write one verdict each. It reads the recordings only.

    The same command goes on from where it stopped. A recording that fails counts as a wrong answer, as does one
    that fails with its effect withheld; the exit code is then 3.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    set_
        Folder that `blind make` wrote.
    out
        Folder for the verdicts.
    workers
        Recordings diagnosed side by side, each in a process of its own.
    without
        Effects that are withheld from the library.
    leave_one_out
        Diagnose each recording again without each effect that had a chance.
    estimator
        Folder of an estimator, or the name of a system that comes with one: its estimate is the first start.
    seed
        Of the diagnoses' own random numbers.
    limit
        A recording that takes longer, with all that is withheld from it, is stopped: what was not reached counts as a
        failure [s].
    as_json
        Print how many verdicts of which kind there are, and their hash, as JSON.
    """
    from diagnosis.blind.running import run as run_
    from diagnosis.blind.sealed import read_manifest
    from diagnosis.blind.verdicts import FAILED, digest, read_outcome, read_withheld

    with progress_bar("recordings", shown=not report.quiet) as bar:
        run_(
            system,
            set_,
            out,
            workers=workers,
            without=without or (),
            leave_one_out=leave_one_out,
            estimator=estimator,
            seed=seed,
            limit=limit,
            progress=lambda done, total: bar.update(done, total=total),
        )
    files = [one["file"] for one in read_manifest(set_)["recordings"]]
    outcomes = [read_outcome(out, file) for file in files]
    verdicts = Counter(one.answer for one in outcomes)
    seconds = sum(one.seconds for one in outcomes) / len(outcomes)
    sha256 = digest(out, files)
    withheld = [(name, one) for file in files if (w := read_withheld(out, file)) for name, one in w.outcomes.items()]
    again = [(name, one) for name, one in withheld if one.verdict is None]
    code = PARTLY if verdicts[FAILED] or again else OK
    failed = [one for one in outcomes if one.verdict is None]
    if failed:
        _log.warning("%s failed, the first of %d: %s", failed[0].file, len(failed), failed[0].failure)
    if again:
        name, one = again[0]
        _log.warning("%s failed without %s, the first of %d: %s", one.file, name, len(again), one.failure)
    if as_json:
        said = {
            "recordings": len(files),
            "verdicts": verdicts,
            "withheld": len(withheld),
            "withheld_failed": len(again),
            "seconds": seconds,
            "verdicts_sha256": sha256,
        }
        sys.stdout.write(json.dumps(said, indent=1, allow_nan=False) + "\n")
        return code
    counts = ", ".join(f"{count} {answer.replace('_', ' ')}" for answer, count in sorted(verdicts.items()))
    console.print(f"{len(files)} recordings, {seconds:.0f} s each: {counts}", markup=False, soft_wrap=True)
    if withheld:
        console.print(f"{len(withheld)} diagnosed again without a candidate, {len(again)} failed", markup=False)
    console.print(f"verdicts in {out}, sha256 {sha256}", markup=False, soft_wrap=True)
    return code


@app.command
def score(
    set_: Annotated[Path, Parameter(name="SET")],
    answers: Path,
    results: Path,
    *,
    out: Place,
    first: int | None = None,
    seed: NotNegative = 0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Open the answers and compare the verdicts with them. Writes OUT (HTML), and beside it .json and .md.

    Parameters
    ----------
    set_
        Folder that `blind make` wrote.
    answers
        The sealed file.
    results
        Folder that `blind run` wrote.
    out
        The page.
    first
        Only so many recordings, from the beginning of the set: of a run that was stopped.
    seed
        Of the bootstraps.
    as_json
        Print the score as JSON.
    """
    from diagnosis.blind.score_report import markdown
    from diagnosis.blind.scoring import score as score_

    done = score_(set_, answers, results, out=out, first=first, seed=seed)
    if as_json:
        sys.stdout.write(done.model_dump_json(indent=1) + "\n")
        return OK
    console.print(markdown(done), markup=False, soft_wrap=True)
    console.print(f"{out}", markup=False)
    return OK
