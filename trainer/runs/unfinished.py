"""What is to be said wherever a run is used whose training did not come to its end, or is at work in its folder."""

from __future__ import annotations

from pathlib import Path

from shared.errors import EstimatorError
from shared.lock import at_work
from trainer.runs.checkpoint import CARD, Card, Run, read_card

_CAUSES = {
    "interrupted": "it was interrupted",
    "running": "it is under way, or was killed,",
    "not a number": "its loss stopped being a number",
}


def unfinished(card: Card, folder: Path | None = None) -> str | None:
    """A sentence on a training that was cut short, with how far it came; None where it came to its end.

    Where another run is at work in ``folder``, which the card was read from, this is said, too.
    """
    done = card.training
    busy = None if folder is None else at_work(folder)
    if done.stopped not in _CAUSES:
        if busy is None:
            return None
        return (
            f"Another run is at work in {folder} ({busy}), and may replace what it holds: all figures are of what was"
            " there when this was read."
        )
    if done.minutes is not None:
        far = f"step {done.steps}, {done.seconds / 60:.3g} of {done.minutes:g} min"
    else:
        far = f"step {done.steps}" + ("" if done.planned is None else f" of {done.planned}")
    on = "" if done.stopped == "not a number" else "; the same `trainer fit` with --resume goes on with it"
    if busy is not None:
        on = f". Another run is at work in {folder} now ({busy})"
    return (
        f"The run's training was not finished: {_CAUSES[done.stopped]} after {far}. All figures are of its weights at"
        f" step {done.best_step}, not of the estimator that it was to become{on}."
    )


def is_of(run: Run, folder: Path) -> bool:
    """Whether a folder is the run's own, however its path is written."""
    return run.folder is not None and folder.resolve() == run.folder.resolve()


def check_findings_place(run: Run, folder: Path) -> None:
    """Refuse a folder that is not the run's own and holds another estimator: what was found of that would be gone.

    Raises EstimatorError if it is one.
    """
    if is_of(run, folder) or not (folder / CARD).exists():
        return
    try:
        same = read_card(folder).weights_sha256 == run.card.weights_sha256
    except EstimatorError:  # damaged, or of a newer version: nobody knows whose
        same = False
    if not same:
        raise EstimatorError(
            f"out: {folder} holds another estimator ({CARD}), and what was found of it would be overwritten;"
            " expected another folder"
        )


def check_not_replaced(run: Run) -> None:
    """Refuse a run in whose folder there is another estimator by now: what is found of it must not stand beside that.

    Raises EstimatorError if it is so, or the folder holds none any more.
    """
    if run.folder is not None and read_card(run.folder).weights_sha256 != run.card.weights_sha256:
        raise EstimatorError(f"{run.folder}: its estimator was replaced while it was at work with; run this again")
