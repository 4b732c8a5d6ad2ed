"""One fit and its score, in a run folder of its own; as a module, a process that does one and ends.

python -m trainer.benchmarking.job DATASET FOLDER     with the fit as JSON in FOLDER/fit.json
"""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import torch
from pydantic import BaseModel

from shared.errors import EstimatorError, ZeroshotError
from shared.reading import M, read_json, validated
from shared.store import DatasetFolder, sha256_of, write_atomically
from trainer.benchmarking.conditions import Fit
from trainer.evaluating.evaluation import evaluate
from trainer.evaluating.report import ANSWERS, EVALUATION
from trainer.reading.data import fingerprint
from trainer.runs.checkpoint import CARD, load_run, make_folder
from trainer.training.fitting import fit as run_fit

SPEC, DONE, FAILED = "fit.json", "done.json", "failed.txt"
TABULATED = (CARD, EVALUATION, ANSWERS)
"""Files of a run folder that the tables are made of. `trainer evaluate` by hand writes over some of them."""


class Done(BaseModel, extra="forbid"):
    """``done.json``: the fit is finished and scored."""

    fit: Fit
    data: str = ""
    """fingerprint of the dataset; earlier versions did not note it, nor the files"""
    files: dict[str, str] = {}
    """sha256 of what the tables are made of, as this fit left it"""
    seconds: float
    """all of it: reading, training and scoring, of the process that finished it"""
    warning: str = ""


def is_done(folder: Path, fit: Fit, data: str) -> bool:
    """Whether a run folder holds this fit to the dataset of a fingerprint, finished, and its own scores."""
    try:
        done = read_done(folder)
    except EstimatorError:
        return False
    return (done.fit, done.data) == (fit, data) and done.files == _hashes(folder)


def _hashes(folder: Path) -> dict[str, str]:
    return {name: sha256_of(folder / name) for name in TABULATED if (folder / name).exists()}


def read_done(folder: Path) -> Done:
    """``done.json`` of a run folder; an EstimatorError if there is none."""
    return _read(Done, folder / DONE)


def _read(kind: type[M], path: Path) -> M:
    expected = "a file of `trainer benchmark`"
    return validated(kind, read_json(path, EstimatorError, expected), f"{path}", EstimatorError, expected)


def do(dataset: Path, folder: Path, fit: Fit, ceiling: Path | None) -> None:
    """Fit and score, going on where an interrupted one stopped.

    A loss that stops being a number leaves the last good estimator, which is scored, with a warning. Raises
    ZeroshotError if it cannot be done; the sentence is also in the folder.
    """
    begin = time.monotonic()
    make_folder(folder)
    (folder / FAILED).unlink(missing_ok=True)
    one, warning = fit.condition, ""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        data = fingerprint(DatasetFolder(dataset))
        try:
            run = run_fit(
                dataset,
                folder,
                model=one.model,
                context_hours=one.context_hours,
                channels=list(one.channels),
                noise=one.noise,
                patch=one.patch,
                systems=one.systems,
                seed=fit.seed,
                threads=1,
                resume=True,
                **fit.budget.of(one.model),
            )
        except EstimatorError as error:
            if not (folder / CARD).exists() or load_run(folder).card.training.stopped != "not a number":
                raise
            run, warning = load_run(folder), str(error)
        # the same windows and noise whatever the seed of the fit: seeds are then compared on equal terms
        evaluate(run, dataset, windows=fit.windows, seed=0, ceiling=ceiling)
    except ZeroshotError as error:
        write_atomically(folder / FAILED, f"{error}\n".encode())
        raise
    finally:
        torch.set_num_threads(before)
    seconds = round(time.monotonic() - begin, 2)
    done = Done(fit=fit, data=data, files=_hashes(folder), seconds=seconds, warning=warning)
    write_atomically(folder / DONE, (done.model_dump_json(indent=1) + "\n").encode())


def _end_with_parent() -> None:
    """Standard input is a pipe that nobody writes to: it ends when the process that started this one does."""
    os.read(0, 1)  # not sys.stdin: Python's own lock on it would be held when this process ends first
    os._exit(1)


def main(arguments: list[str]) -> int:
    """Do the fit that a folder describes; returns the exit code."""
    dataset, folder = Path(arguments[0]), Path(arguments[1])
    ceiling = Path(arguments[2]) if len(arguments) > 2 else None
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        do(dataset, folder, _read(Fit, folder / SPEC), ceiling)
    except ZeroshotError:
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
