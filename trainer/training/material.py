"""What a training is made of: its recipe, and its records and encoding, held against the dataset before any writing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shared.errors import EstimatorError
from shared.store import DatasetFolder, Records
from trainer.models import estimator_class
from trainer.models.base import Estimator, Recipe
from trainer.reading.data import training_records
from trainer.reading.encoding import Encoding, make_encoding, split_channels
from trainer.reading.missing import LONGEST
from trainer.reading.noise import Sensors
from trainer.reading.windows import context_length


class Material(NamedTuple):
    """Records, and how windows of them are read.

    ``training`` and ``validation`` are rows of the records; ``hours`` [h] and ``length`` [samples] are those of the
    main window.
    """

    records: Records
    training: np.ndarray
    validation: np.ndarray
    encoding: Encoding
    sensors: Sensors
    hours: float
    length: int


def material_of(
    dataset: DatasetFolder,
    model: str,
    *,
    context_hours: float | None = None,
    other_contexts: list[float] | None = None,
    channels: list[str] | None = None,
    optional: list[str] | None = None,
    noise: str = "none",
    systems: int | None = None,
    facts: bool = False,
) -> Material:
    """Read what a training needs of a dataset; the arguments are those of ``fit``.

    Raises EstimatorError if an argument is wrong; DatasetError if the dataset cannot be used, or has no training or
    validation systems.
    """
    kind = estimator_class(model)
    recorded, derived = split_channels(dataset.system, channels)
    sensors = Sensors(dataset.system, recorded, noise)
    records = training_records(dataset, recorded, systems)
    training, validation = (records.of_split(split) for split in ("train", "validation"))
    hours = dataset.system.estimator.context_hours if context_hours is None else context_hours
    length = context_length(hours, records)
    if other_contexts and not kind.reads_shorter:
        raise EstimatorError(f"other_contexts: {model} reads windows of one length; leave it out")
    if optional and not kind.reads_missing:
        raise EstimatorError(f"optional: {model} needs every channel; leave it out")
    lengths = sorted({length, *(context_length(one, records) for one in other_contexts or [])})
    encoding = make_encoding(
        *(dataset.system, records, derived, lengths[-1], training),
        shorter=lengths[:-1],
        optional=optional,
        largest_gap=LONGEST if kind.reads_missing else 0.0,
        facts=facts,
    )
    return Material(records, training, validation, encoding, sensors, hours, length)


def recipe_of(
    model: str,
    steps: int | None = None,
    minutes: float | None = None,
    batch_size: int | None = None,
    lr: float | None = None,
) -> Recipe:
    """The recipe of an estimator, with what is given in place of its own.

    Raises EstimatorError if a number is not positive, steps [1] and minutes [min] are both given, or the estimator
    makes no use of one.
    """
    for name, value in (("steps", steps), ("minutes", minutes), ("batch_size", batch_size), ("lr", lr)):
        if value is not None and not 0 < value < math.inf:
            raise EstimatorError(f"{name}: is {value:g}; expected a positive number")
    if steps is not None and minutes is not None:
        raise EstimatorError("steps and minutes: both are given; expected one budget")
    kind = estimator_class(model)
    own, useless = kind.recipe, [] if kind.iterates else ["minutes", "lr"]
    if not kind.iterates and kind.prepare is Estimator.prepare:  # nor does it look at a window
        useless += ["steps", "batch_size"]
    for name, value in (("steps", steps), ("minutes", minutes), ("batch_size", batch_size), ("lr", lr)):
        if value is not None and name in useless:
            raise EstimatorError(f"{name}: {model} is solved, not trained by steps; leave it out")
    return replace(own, steps=steps or own.steps, batch_size=batch_size or own.batch_size, lr=lr or own.lr)
