"""The run folder of a training while it is written: one training at a time, and no estimator is lost for another."""

from __future__ import annotations

from pathlib import Path

from shared.errors import EstimatorError
from shared.lock import FILE_NAME, FolderLock
from shared.places import check_folder
from shared.store import MANIFEST
from trainer.runs.checkpoint import CALIBRATION, CARD
from trainer.runs.pair import remove_pair

FINDINGS = (
    *("curve.csv", "curve.png"),
    *("evaluation.json", "evaluation.md", "evaluation.csv", "answers.csv", "scatter.png"),
    *CALIBRATION,
)
"""Files of a run folder that say something of one state of its weights, beside its posterior."""
POSTERIOR = ("posterior.safetensors", "posterior.json")


def check_place(folder: Path, *, replacing: bool) -> None:
    """Refuse a folder that cannot be written to, is a dataset's, or holds an estimator that is not to be replaced.

    Nor is one taken where another training is at work. Raises EstimatorError if it is one.
    """
    check_folder(folder, EstimatorError)
    if (folder / MANIFEST).exists():
        raise EstimatorError(f"{folder}: is a dataset (it has a {MANIFEST}); expected a folder for the run alone")
    if (folder / CARD).exists() and not replacing:
        raise EstimatorError(f"{folder}: already holds an estimator; choose another folder, resume it, or overwrite it")
    if (folder / FILE_NAME).exists():
        with FolderLock(folder, kind=EstimatorError):
            pass


def remove_findings(folder: Path) -> None:
    """Remove what was said of weights that are about to be replaced: it must not stand beside others."""
    for name in FINDINGS:
        (folder / name).unlink(missing_ok=True)
    weights, card = POSTERIOR
    remove_pair(folder / weights, folder / card)
