"""A run folder: ``weights.safetensors`` and ``estimator.json``, which together are all that using an estimator takes.

No pickle: loading a run executes nothing that it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import torch
from pydantic import BaseModel, model_validator

from shared.errors import EstimatorError
from shared.reading import read_json, validated
from shared.refused import meant
from shared.results import Result
from shared.shipped import estimators, resolved_estimator, shipped_estimator, shipped_systems
from shared.store import Records
from trainer.models import build
from trainer.models.base import Estimator, Shape
from trainer.reading.encoding import Encoding
from trainer.reading.facts import static_columns
from trainer.reading.familiar import Familiar
from trainer.reading.kind import Kind
from trainer.runs.pair import digest, write_pair
from trainer.runs.scatter import Errors, factors_of
from trainer.runs.systems import Systems
from trainer.runs.weights import check_card_version, load_weights, weights_data

SCHEMA_VERSION = 7
"""The first version has no errors by condition; before the third it is not said which channels are means of a step, and
which never varied, before the fourth not which uncertain constants were as declared, before the fifth not of what
dataset the errors are, and before the sixth not how far answers scatter, so that these are not made means; before the
seventh no estimator reads facts."""
CARD = "estimator.json"
WEIGHTS = "weights.safetensors"
CALIBRATION = ("calibration.json", "calibration.md", "calibration.csv", "sbc.png", "coverage.png")
"""What says how good a posterior is, beside it."""
CHUNK = 256
"""Windows of one forward pass where many are estimated."""


Stop = Literal["steps", "minutes", "not a number", "interrupted", "running"]
"""Why a training ended."""
Keep = Literal["best", "last"]
"""Which weights of a training are kept."""


class Training(BaseModel, extra="forbid"):
    """How the estimator came about."""

    seed: int
    batch_size: int
    lr: float
    schedule: str
    steps: int
    best_step: int
    validation_loss: float
    mean_loss: float | None = None
    """of the mean of the training's targets on the same windows; None in cards of earlier versions"""
    validation_windows: int
    seconds: float
    stopped: Stop
    minutes: float | None = None
    """budget [min], where it was not steps"""
    planned: int | None = None
    """budget [steps], where it was not minutes; None in cards of earlier versions"""
    keep: Keep = "best"
    """weights that were best on validation systems, or the last ones"""
    coarse: bool = False
    """whether products were rounded to bfloat16"""
    data: str | None = None
    """sha256 of what the dataset is, where the training began with the weights of another one"""

    def loss_text(self) -> str:
        """The validation loss beside that of the mean, which is 1 only where validation systems vary as others do."""
        return beside_mean(self.validation_loss, self.mean_loss)


def beside_mean(loss: float, mean: float | None) -> str:
    """A loss beside that of the mean, where it is known."""
    return f"{loss:.4f}" + ("" if mean is None else f" (the mean's: {mean:.4f})")


def shape_of(encoding: Encoding) -> Shape:
    """Sizes of an estimator's windows and answers."""
    return Shape(
        length=encoding.length,
        outputs=encoding.outputs,
        recorded=len(encoding.recorded),
        columns=encoding.columns,
        parameters=len(encoding.parameters),
        step=encoding.step,
        static=2 * len(encoding.facts),
        known=len(encoding.parameters) if encoding.known else 0,
    )


class Card(BaseModel, extra="forbid"):
    """``estimator.json``."""

    schema_version: int = SCHEMA_VERSION
    model: str
    options: dict[str, Any]
    context_hours: float
    noise: str
    begun_with: str | None = None
    """sha256 of the weights that the training began with, if not with random ones"""
    encoding: Encoding
    system_name: str
    system_hash: str
    fmu_sha256: str
    training_systems: Systems
    validation_systems: Systems
    validation_rmse: dict[str, float]
    """Root mean square error of each parameter on the training's validation windows [its own unit].

    These have the main length, and all sensor presets and missing channels of the training, mixed.
    """
    validation_errors: list[Errors] = []
    """The same condition by condition; none in a card of the first version, or of a training that was interrupted."""
    familiar: list[Familiar] = []
    """What windows of the training and of the one it began with look like, by length; none in cards of old."""
    dataset: Kind | None = None
    """What the training itself was on, and the errors are of; None in cards of earlier versions."""
    held: list[str] | None = None
    """Uncertain constants of the description that all systems of both had as declared; None where it is not known, in
    cards of earlier versions and of what began with these."""
    training: Training
    versions: dict[str, str]
    weights_sha256: str = ""

    @model_validator(mode="after")
    def _errors_fit(self) -> Card:
        """Errors are of the encoding's parameters, what is familiar of its channels."""
        told = [("validation_errors", one.rmse) for one in self.validation_errors]
        told += [("validation_errors", one.scatter) for one in self.validation_errors if one.scatter is not None]
        told += [("validation_rmse", self.validation_rmse)] if self.weights_sha256 else []  # none before the first save
        for field, rmse in told:
            if set(rmse) != set(self.encoding.parameters):
                found, expected = ", ".join(rmse) or "none", ", ".join(self.encoding.parameters)
                raise ValueError(f"{field}: has errors of {found}; expected {expected}")
        for known in self.familiar:
            if len(known.lowest) != len(self.encoding.recorded):
                raise ValueError(
                    f"familiar: is of {len(known.lowest)} channels; expected {len(self.encoding.recorded)}"
                )
        return self

    def seen(self, system_hash: str, records: Records) -> np.ndarray:
        """Which rows of records, of a system, the run trained on or chose its weights by; bool (systems,)."""
        if system_hash != self.system_hash:
            return np.zeros(len(records.systems), dtype=bool)
        return self.training_systems.rows_in(records) | self.validation_systems.rows_in(records)

    @property
    def errors_held(self) -> list[str] | None:
        """Uncertain constants that the systems of its errors have as declared; None where it is not known."""
        if self.dataset is not None:
            return self.dataset.held
        if self.begun_with is None:
            return self.held
        return self.held or None  # what both trainings had so, the last one had; of others it is not known

    @property
    def length(self) -> int:
        """Samples of the window that the training was for first of all."""
        return round(self.context_hours * 3600 / self.encoding.step)

    def shape(self) -> Shape:
        """Sizes of the estimator."""
        return shape_of(self.encoding)


class Run(Result):
    """An estimator ready to use."""

    def __init__(self, card: Card, model: Estimator, folder: Path | None = None, results: Path | None = None) -> None:
        self.card = card
        self.model = model
        self.folder = folder
        self.results = results or folder
        """where findings about it go, unless told otherwise: not among the files of an installed package"""

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        card = self.card
        lengths = ", ".join(f"{one * card.encoding.step / 3600:g}" for one in card.encoding.lengths)
        return f"{card.model} of {card.system_name}, {len(card.encoding.parameters)} parameters from {lengths} h"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each parameter that it estimates: its unit and the ends of its range."""
        known = self.card.encoding
        rows = {"unit": known.parameter_units, "min": known.parameter_min, "max": known.parameter_max}
        return pd.DataFrame(rows, index=pd.Index(known.parameters, name="parameter"))

    def answers(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """Standardised log10 answers (windows, parameters) to encoded windows (windows, length, columns)."""
        return forward_in_chunks(self.model, windows, time)

    def read(self, values: np.ndarray, time: np.ndarray, facts: np.ndarray | None = None) -> torch.Tensor:
        """Answers (windows, parameters) to recorded windows; the arguments are those of :meth:`estimate`."""
        return self.answers(*self.encoded(values, time, facts))

    def encoded(
        self, values: np.ndarray, time: np.ndarray, facts: np.ndarray | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Encoded windows and their first stamps; the arguments are those of :meth:`estimate`."""
        encoding = self.card.encoding
        stamps = torch.from_numpy(np.asarray(time, dtype=np.float64))
        static = None
        if facts is not None and encoding.facts:
            static = static_columns(encoding.standardised(facts), torch.from_numpy(np.isfinite(facts)))
        return encoding.encode(torch.from_numpy(np.asarray(values, dtype=np.float32)), stamps, static), stamps

    def estimate(self, values: np.ndarray, time: np.ndarray, facts: np.ndarray | None = None) -> np.ndarray:
        """Parameters (windows, parameters) [own units], float64.

        Parameters
        ----------
        values
            Recorded channels, shape (windows, length, recorded) [units of ``card.encoding.units``].
        time
            Time stamp of each window's first sample, shape (windows,) [s since time zero].
        facts
            What is known, shape (windows, ``card.encoding.facts``) [own units], not a number where unknown; nothing is
            by default.
        """
        absent = self.card.encoding.absent_from(values)
        return self.estimates(self.read(values, time, facts), values.shape[1], absent)

    def estimates(self, answers: torch.Tensor, length: int, absent: Collection[str] = ()) -> np.ndarray:
        """Means (windows, parameters) [own units] for windows of ``length`` samples without ``absent`` channels.

        Where the card does not say how far answers scatter, they are what answers are themselves: geometric means.
        """
        errors = self.card.validation_errors
        return self.card.encoding.estimates(answers, factors_of(errors, self.card.encoding.parameters, length, absent))


def forward_in_chunks(model: Estimator, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
    """Answers in evaluation mode, a bounded number of windows at a time."""
    was_training = model.training
    device = next((one.device for one in model.parameters()), windows.device)
    model.eval()
    try:
        with torch.no_grad():
            pairs = zip(windows.to(device).split(CHUNK), time.to(device).split(CHUNK), strict=True)
            return torch.cat([model.with_known(model(part, stamps), part) for part, stamps in pairs]).cpu()
    finally:
        model.train(was_training)


def make_folder(folder: Path) -> None:
    """Make a folder to write results to; an EstimatorError if that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EstimatorError(f"{folder}: cannot be made a folder ({error.strerror})") from None


def save_run(folder: Path, card: Card, model: Estimator, before: Callable[[], None] | None = None) -> None:
    """Write a run folder: weights, and the card that names their hash; ``before`` is that of :func:`write_pair`."""
    make_folder(folder)
    data = weights_data(model)
    card.weights_sha256 = digest(data)
    write_pair(folder / WEIGHTS, data, folder / CARD, card.model_dump_json(indent=1) + "\n", before)


def read_card(folder: Path) -> Card:
    """Read ``estimator.json``.

    Raises EstimatorError if it is missing, damaged, or of a newer version.
    """
    path = folder / CARD
    expected = f"a run folder made by `trainer fit`, or a system that comes with an estimator ({estimators()})"
    expected += meant(folder.name, shipped_systems()) if len(folder.parts) == 1 else ""
    raw = read_json(path, EstimatorError, expected)
    check_card_version(path, raw, SCHEMA_VERSION, "trainer fit")
    return validated(Card, raw, f"{path}: damaged", EstimatorError)


def load_run(folder: Path | str) -> Run:
    """Load an estimator from its folder, or the one that comes with a shipped system, by the system's name.

    Raises
    ------
    EstimatorError
        If the folder holds none, or one of its files is damaged or newer than this version.
    """
    given, folder = Path(folder), resolved_estimator(folder)
    if folder == given and given.is_dir() and not (given / CARD).exists() and (shipped := shipped_estimator(given)):
        raise EstimatorError(
            f"{given}: a folder without {CARD}, which hides the estimator of that name; expected a run folder, or the"
            f" path of that estimator, {shipped}"
        )
    card = read_card(folder)
    try:
        model = load_weights(
            folder / WEIGHTS,
            card.weights_sha256,
            CARD,
            "fit the estimator again",
            lambda: build(card.model, card.shape(), card.options)[0],
        )
    except EstimatorError:
        if read_card(folder).weights_sha256 == card.weights_sha256:
            raise
        return load_run(given)  # a training has replaced both in between
    return Run(card, model, folder, None if folder == given else Path(f"{given.name}-results"))
