"""What is to be said wherever a run is used whose training did not come to its end."""

from __future__ import annotations

from trainer.runs.checkpoint import Card

_CAUSES = {
    "interrupted": "it was interrupted",
    "running": "it is under way, or was killed,",
    "not a number": "its loss stopped being a number",
}


def unfinished(card: Card) -> str | None:
    """A sentence on a training that was cut short, with how far it came; None where it came to its end."""
    done = card.training
    if done.stopped not in _CAUSES:
        return None
    if done.minutes is not None:
        far = f"step {done.steps}, {done.seconds / 60:.3g} of {done.minutes:g} min"
    else:
        far = f"step {done.steps}" + ("" if done.planned is None else f" of {done.planned}")
    on = "" if done.stopped == "not a number" else "; the same `trainer fit` with --resume goes on with it"
    return (
        f"The run's training was not finished: {_CAUSES[done.stopped]} after {far}. All figures are of its weights at"
        f" step {done.best_step}, not of the estimator that it was to become{on}."
    )
