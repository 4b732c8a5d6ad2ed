"""The training loop: steps, validations, the best weights so far, the loss curve."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from shared.errors import EstimatorError, OptionsError
from shared.logs import fields, logger
from shared.progress import progress_bar
from shared.reading import why
from shared.store import write_atomically
from trainer.figures import draw_loss_curve
from trainer.models.base import Estimator, Recipe
from trainer.reading.windows import Batch, Sampler
from trainer.runs.checkpoint import CARD, Card, Stop, forward_in_chunks, save_run
from trainer.runs.pair import digest
from trainer.runs.scatter import Errors
from trainer.runs.state import (
    STATE,
    Tensors,
    check_settings,
    generator_states,
    optimiser_tensors,
    read_state,
    restore_generators,
    restore_optimiser,
    write_state,
)
from trainer.runs.versions import other_version, versions_here
from trainer.runs.weights import weights_data
from trainer.tables import csv_text
from trainer.training.optimisers import make_optimisers, scale_rates
from trainer.training.place import remove_findings

_log = logger(__name__)
CHECKS = 40
"""How often a training of the recipe's length is validated."""
SAVE_SECONDS = 30.0
"""How often the state is written, and at most an improved estimator, so that a killed run loses little."""
WARM_UP = 100
"""Steps over which a cosine schedule rises to its learning rate."""
CLIP = 1.0
"""Largest norm of the gradient, but for the paper's Adamax."""
Advance = Callable[[int, float, float], None]
"""Takes the step, the share of the budget spent, and the loss."""


@dataclass
class Curve:
    """Loss on standardised log10 targets against steps; rows of (step, seconds, training, validation)."""

    rows: list[tuple[int, float, float, float]] = field(default_factory=list)

    def csv(self) -> str:
        """The rows as CSV."""
        figures = [(step, f"{seconds:.2f}", f"{fit:.6g}", f"{held:.6g}") for step, seconds, fit, held in self.rows]
        return csv_text([("step", "seconds", "training_loss", "validation_loss"), *figures])


class Loop:
    """The training itself: steps, validations, the best weights so far.

    ``settings`` say which training it is: a state written by another one is refused. ``measure`` gives the errors of
    the weights that are kept, when all is done.
    """

    def __init__(
        self,
        folder: Path,
        card: Card,
        network: Estimator,
        sampler: Sampler,
        held_out: Batch,
        recipe: Recipe,
        minutes: float | None,
        settings: dict[str, Any],
        measure: Callable[[Estimator], list[Errors]],
    ) -> None:
        self.folder, self.card, self.network, self.settings = folder, card, network, settings
        self.sampler, self.held_out, self.recipe, self.minutes = sampler, held_out, recipe, minutes
        self.measure, self.curve = measure, Curve()
        self.best: dict[str, torch.Tensor] | None = None
        self.optimisers = make_optimisers(network, recipe) if network.iterates else []
        self.step, self.total, self.counted = 0, 0.0, 0
        self.begin = self.saved = self.kept = time.monotonic()
        self.written = card.weights_sha256  # what stands in the folder is said of these weights

    @property
    def seconds(self) -> float:
        """Wall-clock time since the training began [s]."""
        return time.monotonic() - self.begin

    def run(self, progress: bool) -> None:
        """Train, and write the run folder.

        Raises
        ------
        OptionsError
            If the loss stops being a finite number; the best estimator until then is written all the same.
        """
        recipe, network = self.recipe, self.network
        goes_on = self._restore()
        if not goes_on and self.card.begun_with is None:  # what was begun with is prepared already
            network.prepare(self.sampler.draw, self.held_out, recipe.steps * recipe.batch_size)
        if not goes_on and network.iterates and (self.folder / CARD).exists():
            self._keep()  # what is resumed shall be this training, not the one whose estimator is still there
        stopped: Stop = "steps"
        step = recipe.steps
        if network.iterates:
            try:
                with _bar(progress, f"{self.card.model}", recipe.steps, self.minutes) as advance:
                    step, stopped = self._steps(advance)
            except KeyboardInterrupt:
                self._finish("interrupted")
                raise
        elif not self._validate(step, math.nan):
            stopped = "not a number"
        self._finish(stopped)
        (self.folder / STATE).unlink(missing_ok=True)
        if stopped == "not a number":
            kept = self.card.training
            where = f"the estimator of step {kept.best_step} is kept in {self.folder}" if self.best else "none is kept"
            if not self.best and (self.folder / CARD).exists():
                where += f", and {self.folder} still holds the one that was there before"
            raise OptionsError(
                f"the loss is not a finite number at step {step}; {where};"
                f" try a learning rate below {recipe.lr:g}, or another seed"
            )

    def _steps(self, advance: Advance) -> tuple[int, Stop]:
        recipe, network = self.recipe, self.network
        every = max(1, min(200, recipe.steps // CHECKS))
        while True:
            share = self.seconds / (60 * self.minutes) if self.minutes else self.step / recipe.steps
            if share >= 1:
                due = self.counted or self.best is None  # preparing may have taken the whole budget
                fine = not due or self._validate(self.step, self.total / self.counted if self.counted else math.nan)
                return self.step, ("minutes" if self.minutes else "steps") if fine else "not a number"
            if time.monotonic() - self.kept > SAVE_SECONDS:
                self._keep()
            if recipe.schedule == "cosine":
                rise = min(1.0, (self.step + 1) / WARM_UP)
                scale_rates(self.optimisers, rise * (0.5 + 0.5 * math.cos(math.pi * share)))
            network.train()
            batch = self.sampler.draw(recipe.batch_size)
            try:
                answers = network.with_known(network(batch.windows, batch.time), batch.windows)
                loss = torch.nn.functional.mse_loss(answers, batch.targets)
            except torch.linalg.LinAlgError:  # equations of numbers that are none have no solution
                return self.step + 1, "not a number"
            value = loss.item()
            if not math.isfinite(value):
                return self.step + 1, "not a number"
            network.zero_grad()
            loss.backward()
            if recipe.optimiser != "adamax":
                norm = torch.nn.utils.clip_grad_norm_(network.parameters(), CLIP)
                if not math.isfinite(norm.item()):
                    return self.step + 1, "not a number"
            for one in self.optimisers:
                one.step()
            self.step += 1
            self.total, self.counted = self.total + value, self.counted + 1
            advance(self.step, share, value)
            if self.step % every == 0:
                if not self._validate(self.step, self.total / self.counted):
                    return self.step, "not a number"
                self.total, self.counted = 0.0, 0

    def _generators(self) -> dict[str, torch.Generator]:
        return {"windows": self.sampler.generator, "noise": self.sampler.source.generator}

    def _keep(self) -> None:
        """Write the state between two steps."""
        parts = {
            "network": self.network.state_dict(),
            "best": self.best or {},
            **{f"optimiser {k}": optimiser_tensors(one) for k, one in enumerate(self.optimisers)},
            "generators": generator_states(self._generators()),
        }
        facts = {
            "settings": self.settings,
            "versions": versions_here(),
            "step": self.step,
            "total": self.total,
            "counted": self.counted,
            "seconds": self.seconds,
            "curve": self.curve.rows,
            "best_step": self.card.training.best_step,
            "validation_loss": self.card.training.validation_loss,
            "validation_rmse": self.card.validation_rmse,
        }
        write_state(self.folder / STATE, parts, facts)
        self.kept = time.monotonic()

    def _restore(self) -> bool:
        """Go back to the state in the run folder; False where there is none."""
        path = self.folder / STATE
        if not path.exists():
            return False
        parts, facts = read_state(path)
        try:
            self._take(path, parts, facts)
        except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
            raise EstimatorError(f"{path}: damaged ({why(error)}); remove it to train from the beginning") from None
        return True

    def _take(self, path: Path, parts: dict[str, Tensors], facts: dict[str, Any]) -> None:
        check_settings(path, facts["settings"], self.settings)
        if other := other_version(facts.get("versions", {})):
            _log.warning(
                "%s: written with %s %s, and this is %s: the weights will not be those of a training that was not"
                " interrupted, and the estimator's card names the versions of here",
                *(path, *other),
            )
        self.network.load_state_dict(parts["network"])
        self.best = parts.get("best")
        for k, one in enumerate(self.optimisers):
            restore_optimiser(one, parts.get(f"optimiser {k}", {}))
        restore_generators(self._generators(), parts["generators"])
        self.step, self.total, self.counted = facts["step"], facts["total"], facts["counted"]
        self.curve.rows = [(row[0], row[1], row[2], row[3]) for row in facts["curve"]]
        summary = self.card.training
        summary.best_step, summary.validation_loss = facts["best_step"], facts["validation_loss"]
        if self.curve.rows:
            summary.steps, summary.seconds = self.curve.rows[-1][0], round(self.curve.rows[-1][1], 2)
        self.card.validation_rmse = facts["validation_rmse"]
        self.begin = time.monotonic() - facts["seconds"]

    def _validate(self, step: int, training_loss: float) -> bool:
        """Validate, remember the weights if they are the best so far; False if the loss is not finite."""
        try:
            answers = forward_in_chunks(self.network, self.held_out.windows, self.held_out.time)
        except torch.linalg.LinAlgError:
            answers = torch.full(self.held_out.targets.shape, math.nan)
        loss = torch.nn.functional.mse_loss(answers, self.held_out.targets.cpu()).item()
        self.curve.rows.append((step, self.seconds, training_loss, loss))
        figures = fields(step=step, training_loss=training_loss, validation_loss=loss, run=str(self.folder))
        _log.debug("step %d: validation loss %.4f", step, loss, extra=figures)
        summary = self.card.training
        summary.steps, summary.seconds = step, round(self.seconds, 2)
        if not math.isfinite(loss):
            return False
        if loss < summary.validation_loss or summary.keep == "last":
            summary.validation_loss, summary.best_step = loss, step
            self.best = {name: tensor.detach().clone() for name, tensor in self.network.state_dict().items()}
            error = self.card.encoding.estimates(answers) - self.card.encoding.estimates(self.held_out.targets)
            rmse = np.sqrt(np.mean(error**2, axis=0))
            self.card.validation_rmse = dict(zip(self.card.encoding.parameters, rmse.tolist(), strict=True))
            if time.monotonic() - self.saved > SAVE_SECONDS:
                self._save()
        return True

    def _save(self) -> None:
        """Write the estimator; what was said of other weights in its place goes as it takes that."""
        same = digest(weights_data(self.network)) == self.written
        save_run(self.folder, self.card, self.network, None if same else lambda: remove_findings(self.folder))
        self.written = self.card.weights_sha256
        self.saved = time.monotonic()

    def _finish(self, stopped: Stop) -> None:
        if self.best is None:
            return
        self.network.load_state_dict(self.best)
        self.network.eval()
        measured = stopped != "interrupted"  # who stops a training does not want to wait for its errors
        self.card.training.stopped = "running" if measured else stopped  # a run without its errors is not finished
        self._save()
        write_atomically(self.folder / "curve.csv", self.curve.csv().encode())
        if len(self.curve.rows) > 1:
            done = self.card.training
            draw_loss_curve(self.curve.rows, self.card.model, self.folder / "curve.png", done.best_step, done.mean_loss)
        if measured:
            self.card.validation_errors = self.measure(self.network)
            self.card.training.stopped = stopped
            self._save()


@contextmanager
def _bar(shown: bool, title: str, steps: int, minutes: float | None) -> Iterator[Advance]:
    """A progress bar on stderr; yields a function of (step, share of the budget, loss)."""
    with progress_bar(title, steps if minutes is None else 1.0, shown=shown) as bar:
        smooth = math.nan

        def advance(step: int, share: float, loss: float) -> None:
            nonlocal smooth
            smooth = loss if math.isnan(smooth) else 0.98 * smooth + 0.02 * loss
            if step % 10 == 0 or step == steps:
                done, count = (step, None) if minutes is None else (share, f"{step} steps")
                bar.update(done, note=f"loss {smooth:.3f}", count=count)

        yield advance
