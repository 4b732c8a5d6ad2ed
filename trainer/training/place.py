"""The run folder of a training while it is written: one training at a time, and no estimator is lost for another."""

from __future__ import annotations

from pathlib import Path

from shared.errors import EstimatorError
from shared.lock import FILE_NAME, FolderLock
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
    """Refuse a folder where another training is at work, or whose estimator is not to be replaced.

    Raises
    ------
    EstimatorError
        If it is one.
    """
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
