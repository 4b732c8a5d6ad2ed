"""The command ``trainer benchmark``: a thin shell over :func:`trainer.benchmarking.running.benchmark`."""

from __future__ import annotations

import json as json_text
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from shared.console import new_console, resumable
from shared.errors import EstimatorError
from shared.logs import USUAL, Reporting, logger

if TYPE_CHECKING:
    from trainer.benchmarking.planning import Plan

_log = logger(__name__)
WIDTH = 80
"""Columns of the printed plan: it has to fit into a terminal of the usual width."""


@resumable()
def benchmark(
    dataset: Path,
    /,
    *,
    out: Path,
    minutes: float | None = None,
    steps: int | None = None,
    seeds: int = 3,
    parts: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    ours: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    windows: int = 1000,
    workers: int = 1,
    ceiling: Path | None = None,
    published: Path | None = None,
    plan: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    report: Reporting = USUAL,
) -> None:
    """The paper's tables and figures, and past them: many fits, scored side by side under both protocols.

    Writes results.md and, for every part, CSV, Markdown and PNG. Each fit is a run folder under OUT/fits: the same
    command goes on where it was stopped, and uses again what is finished. Exit code 3 if a fit has failed: the rest is
    done and written.

    Parts: table3 (patch size), table4 (estimators at 1, 3, 7 days), figure4 (scatter at 48 h), figure5 (relative
    accuracy from 1 to 30 days), systems (R2 against the number of training systems), channels (what each added sensor
    buys), noise (sensor presets).

    Examples: `trainer benchmark DATASET --out RESULTS --plan` says what it would take;
    `trainer benchmark DATASET --out RESULTS --minutes 10 --workers 2` does it.

    Parameters
    ----------
    dataset
        Folder made by `datagen run`.
    out
        Folder of the results.
    minutes
        Wall-clock budget of each fit [min]; 3 by default.
    steps
        Optimiser steps of each fit in place of minutes.
    seeds
        Fits of each condition.
    parts
        Which parts; all by default.
    ours
        Estimators that stand beside the paper's; multiscale-transformer by default.
    windows
        Disjoint windows drawn for each protocol; fewer where there are fewer.
    workers
        Fits at a time, each a process with one thread; with 1 they run in this process.
    ceiling
        File of `datagen identifiability`; DATASET/identifiability.json by default.
    published
        JSON of another work's figures, to stand beside ours.
    plan
        Say which fits are left and how long they will take, and do nothing.
    json
        Print the plan as JSON, and nothing else, on stdout; only with --plan.
    """
    asked: dict[str, Any] = {
        "minutes": minutes,
        "steps": steps,
        "seeds": seeds,
        "parts": parts,
        "ours": ours,
        "windows": windows,
        "workers": workers,
        "ceiling": ceiling,
    }
    if plan:
        from trainer.benchmarking.planning import make_plan

        _print_plan(make_plan(dataset, out, **asked), json)
        return
    if json:
        raise EstimatorError("json: prints a plan, and there is none; expected --plan, too")
    from trainer.benchmarking.running import benchmark as run_benchmark

    page = run_benchmark(
        dataset,
        out,
        **asked,
        published=published,
        command=shlex.join(["trainer", *sys.argv[1:]]),
        progress=not report.quiet,
    )
    _log.info("written: %s", page)


def _print_plan(made: Plan, json: bool) -> None:
    left = made.left()
    waiting = {fit.condition for fit in left}
    expected, whole = made.minutes_left()
    if json:
        parts_found = {part.name: {"lines": len(part.rows), "skipped": part.notes} for part in made.parts}
        facts = {"fits": len(made.fits), "left": len(left), "minutes": expected, "with_overheads": whole}
        sys.stdout.write(json_text.dumps(facts | {"parts": parts_found}, indent=1, allow_nan=False) + "\n")
        return
    table = Table(title=f"{made.training} training systems, {made.budget.text()} a fit, {made.seeds} seeds", box=None)
    for column in ("part", "line", "context", "noise", ""):
        table.add_column(column, no_wrap=column != "line")
    for part in made.parts:
        for row in part.rows:
            one = row.condition
            line = list(dict.fromkeys([*([] if one.model in row.labels else [one.model]), *row.labels]))
            hours = f"{one.context_hours:g} h"
            table.add_row(part.name, " ".join(line), hours, one.noise, "" if one in waiting else "done")
    console = new_console()
    console.print(table, width=min(console.width, WIDTH))
    lines = [f"{part.name}: {note}" for part in made.parts for note in part.notes]
    lines.append(f"{len(made.fits)} fits (a condition that several parts share is fitted once), {len(left)} left")
    if expected is None:
        lines.append("how long they take is known when the first one is finished: the budget is in steps")
    else:
        rest = "with reading and scoring" if whole else "and reading and scoring, which is known when one is finished"
        lines.append(f"{expected:.0f} min with {made.workers} at a time, {rest}")
    console.print("\n".join(lines), markup=False, soft_wrap=True)
