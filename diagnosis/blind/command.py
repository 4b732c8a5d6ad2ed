"""The command ``diagnosis blind``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from shared.console import OK, new_console

app = App(name="blind", help="Recordings whose effect is sealed, to find out what a diagnosis is worth.")
console = new_console()


@app.command
def make(
    out: Path,
    *,
    system: Path = Path("fmus/MixedAirCO2"),
    recordings: int = 200,
    seed: int | None = None,
    answers: Path | None = None,
    truth: Path | None = None,
    hours: float = 672.0,
    workers: int = 1,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Write recordings whose effect is sealed: a folder to publish, and beside it the answers.

    Parameters
    ----------
    out
        Folder for the recordings and their manifest, which holds the answers' sha256.
    system
        System description (TOML), or its folder.
    recordings
        How many.
    seed
        Decides all; drawn and sealed if not given.
    answers
        The sealed file; OUT.answers.json if not given.
    truth
        What is true beyond the model (TOML); truth/truth.toml beside the system's folder if not given.
    hours
        Length of each recording [h].
    workers
        Processes.
    as_json
        Print the manifest as JSON.
    """
    from diagnosis.blind.make import make as make_

    columns = (TextColumn("recordings"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=as_json) as bar:
        task = bar.add_task("make", total=recordings)
        manifest = make_(
            system,
            out,
            recordings=recordings,
            seed=seed,
            answers=answers,
            truth=truth,
            hours=hours,
            workers=workers,
            progress=lambda done, _: bar.update(task, completed=done),
        )
    if as_json:
        sys.stdout.write(json.dumps(manifest, indent=1) + "\n")
        return OK
    console.print(f"{len(manifest['recordings'])} recordings in {out}", markup=False)
    console.print(f"answers sealed with sha256 {manifest['answers_sha256']}", markup=False, soft_wrap=True)
    return OK
