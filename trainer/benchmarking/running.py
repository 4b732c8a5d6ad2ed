"""All fits of a benchmark: done side by side, gone on with after an interruption, and written up."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import xarray as xr

from shared import children
from shared.errors import EstimatorError, IncompleteError, ZeroshotError
from shared.interrupts import interrupts_held
from shared.lock import FolderLock
from shared.logs import fields, logger
from shared.progress import progress_bar
from shared.store import write_atomically
from trainer.benchmarking.conditions import Fit
from trainer.benchmarking.gathering import read_evaluation
from trainer.benchmarking.job import FAILED, SPEC, do
from trainer.benchmarking.page import write_results
from trainer.benchmarking.planning import IDENTITY, Plan, make_plan
from trainer.benchmarking.published import read_published
from trainer.runs.checkpoint import make_folder, read_card

_log = logger(__name__)
POLL_SECONDS = 0.2


def benchmark(
    dataset_dir: Path | str | xr.Dataset,
    out: Path | str,
    *,
    minutes: float | None = None,
    steps: int | None = None,
    seeds: int = 3,
    parts: list[str] | None = None,
    ours: list[str] | None = None,
    windows: int = 1000,
    workers: int = 1,
    ceiling: Path | None = None,
    published: Path | None = None,
    command: str = "",
    progress: bool = False,
) -> Path:
    """Fit and score estimators under many conditions, and write the tables, the figures and ``results.md``.

    Each fit is a run folder under ``out``; a finished one is used again, an interrupted one goes on.

    Parameters
    ----------
    dataset_dir
        A dataset made by ``datagen run``.
    out
        Folder of the results.
    minutes, steps
        Budget of each fit: wall-clock time [min] or optimiser steps; three minutes by default.
    seeds
        Fits of each condition, with seeds from 0.
    parts
        Which of ``trainer.benchmarking.parts.PARTS``; all by default.
    ours
        Estimators that stand beside the paper's.
    windows
        Disjoint windows drawn for each protocol.
    workers
        Fits at a time, each a process with one thread; with 1 they run in this one.
    ceiling
        A file of ``datagen identifiability``; by default the one in the dataset folder, if there.
    published
        A JSON file of another work's figures, to stand beside ours.
    command
        What the results page says was run.
    progress
        Show progress on stderr.

    Returns
    -------
    pathlib.Path
        ``results.md``.

    Raises
    ------
    EstimatorError
        If an argument is wrong, or another benchmark is at work in ``out``.
    IncompleteError
        When all else is done and written, if a fit failed.
    DatasetError
        If the dataset cannot be used.
    ZeroshotError
        If the file of ceilings cannot be.
    """
    theirs = read_published(published)  # before hours of work, not after
    plan = make_plan(
        dataset_dir,
        out,
        minutes=minutes,
        steps=steps,
        seeds=seeds,
        parts=parts,
        ours=ours,
        windows=windows,
        workers=workers,
        ceiling=ceiling,
    )
    make_folder(plan.out)
    with FolderLock(plan.out, kind=EstimatorError):
        write_atomically(plan.out / IDENTITY, (json.dumps(plan.identity, indent=1) + "\n").encode())
        try:
            failed = run_fits(plan, progress)
        except KeyboardInterrupt:
            write_results(plan, theirs, command)
            raise
        page = write_results(plan, theirs, command)
    if failed:
        first, why = next(iter(failed.items()))
        raise IncompleteError(f"{len(failed)} of {len(plan.fits)} fits failed; the first: {first}: {why}")
    return page


def run_fits(plan: Plan, progress: bool) -> dict[str, str]:
    """Do what is left; returns the sentences of the fits that failed, by their titles."""
    left = plan.left()
    work = _in_processes if plan.workers > 1 else _in_turn
    failed: dict[str, str] = {}
    done = len(plan.fits) - len(left)
    with progress_bar("fits", len(plan.fits), done=done, shown=progress) as bar:
        for count, (fit, why) in enumerate(work(plan, left, lambda text: bar.update(title=text)), start=done + 1):
            bar.update(count)
            if why:
                failed[fit.title()] = why
            line = f"[{count}/{len(plan.fits)}] {fit.title()}: {why or summary(plan, fit)}"
            _log.log(
                logging.WARNING if why else logging.INFO,
                "%s",
                line,
                extra=fields(run=str(plan.folder(fit)), failed=why),
            )
    return failed


def summary(plan: Plan, fit: Fit) -> str:
    """One line on a finished fit."""
    folder = plan.folder(fit)
    protocols, card = read_evaluation(folder).protocols, read_card(folder)
    scores = ", ".join(f"R2 {name} {one.r2_mean:.3f}" for name, one in protocols.items() if one.r2_mean is not None)
    return f"{scores}; {card.training.steps} steps, {card.training.seconds:.0f} s"


def _in_turn(plan: Plan, fits: list[Fit], say: Callable[[str], None]) -> Iterator[tuple[Fit, str]]:
    for fit in fits:
        say(fit.title())
        try:
            do(plan.dataset, plan.folder(fit), fit, plan.ceiling)
            yield fit, ""
        except ZeroshotError as error:
            yield fit, str(error)


def _in_processes(plan: Plan, fits: list[Fit], say: Callable[[str], None]) -> Iterator[tuple[Fit, str]]:
    waiting, running = list(fits), dict[str, tuple[Fit, subprocess.Popen[bytes]]]()
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    try:
        while waiting or running:
            while waiting and len(running) < plan.workers:
                fit = waiting.pop(0)
                running[fit.key()] = fit, _start(plan, fit, os.environ | threads)
                say(" | ".join(one.title() for one, _ in running.values()))
            for key, (fit, child) in list(running.items()):
                code = child.poll()
                if code is None:
                    continue
                del running[key]
                yield fit, "" if code == 0 else _why(plan.folder(fit), code)
            time.sleep(POLL_SECONDS)
    finally:
        for _, child in running.values():
            child.kill()
            child.wait()


def _start(plan: Plan, fit: Fit, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    folder = plan.folder(fit)
    make_folder(folder)
    (folder / FAILED).unlink(missing_ok=True)  # of an earlier time; a child may die before it can say anything
    write_atomically(folder / SPEC, (fit.model_dump_json(indent=1) + "\n").encode())
    paths = [plan.dataset, folder] + ([plan.ceiling] if plan.ceiling else [])
    words = children.command("trainer.benchmarking.job", *(str(path.resolve()) for path in paths))
    alone = children.environment(environment)
    # the pipe is what tells the child when this process is gone, however it went
    with open(folder / "log.txt", "wb") as log, interrupts_held():
        return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=log, stderr=log, env=alone)


def _why(folder: Path, code: int) -> str:
    """Why a fit's process ended; where it could not say so itself it is written for the page, too."""
    if not (folder / FAILED).exists():
        said = f"its process ended with code {code}; {folder / 'log.txt'} holds what it said"
        write_atomically(folder / FAILED, f"{said}\n".encode())
    return (folder / FAILED).read_text(encoding="utf-8", errors="replace").strip()
