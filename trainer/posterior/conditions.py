"""Windows under the conditions of an estimator's own training, as contexts: computed once, used in every epoch.

Sensor presets, missing channels and gaps are drawn as they were for the estimator; its card says which. Lengths are
the estimator's, too, but their shares are not: see :data:`MAIN`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from shared.store import DatasetFolder
from trainer.posterior.context import as_float, context_of
from trainer.posterior.prior import Prior
from trainer.reading.data import load_records
from trainer.reading.facts import known_parameters
from trainer.reading.missing import Missing
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource
from trainer.runs.checkpoint import Run

MAIN = 0.4
"""Share of the windows that have the run's main length, where there are others; these share the rest evenly.
For the estimator's training half have it, and of the others long ones are drawn less often."""
SPREAD = 0.3
"""Of the noise that stands for the error of a known parameter [standard deviations of the prior]."""
CHUNK = 1024
"""Windows gathered at a time."""


class Contexts(NamedTuple):
    """Windows as a flow sees them.

    ``context`` float32 (windows, context), ``z`` float32 (windows, parameters): the truth, standard normal under the
    prior; ``length`` (windows,): which of the run's lengths; ``system`` (windows,): which row of the source.
    """

    context: torch.Tensor
    z: torch.Tensor
    length: torch.Tensor
    system: torch.Tensor

    def of_length(self, length: int) -> Contexts:
        """Those of one length."""
        return self.only(self.length == length)

    def only(self, chosen: torch.Tensor) -> Contexts:
        """Those that are chosen, bool (windows,)."""
        return Contexts(*(part[chosen] for part in self))


def source_of(run: Run, dataset: DatasetFolder, rows: np.ndarray) -> tuple[WindowSource, np.ndarray]:
    """Windows of the systems in some rows of a dataset, under the run's own conditions, and the systems' parameters."""
    encoding = run.card.encoding
    records = load_records(dataset, encoding.recorded, rows)
    gaps = Missing(encoding.recorded, encoding.outputs, encoding.optional) if run.model.reads_missing else None
    sensors = Sensors(dataset.system, encoding.recorded, run.card.noise)
    return WindowSource(records, encoding, sensors, torch.Generator(), gaps, "random"), records.parameters


def draw_contexts(
    run: Run,
    prior: Prior,
    source: WindowSource,
    parameters: np.ndarray,
    systems: np.ndarray,
    per_system: int,
    seed: int,
) -> Contexts:
    """Contexts of ``per_system`` windows of each of some systems, of all lengths that the run reads.

    ``source`` and ``parameters`` are of :func:`source_of`, ``systems`` rows of it.
    """
    encoding, card = run.card.encoding, run.card
    seeds = np.random.SeedSequence(seed).generate_state(2)
    source.generator = torch.Generator().manual_seed(int(seeds[0]))
    lengths = encoding.lengths
    main = lengths.index(card.length)
    odds = np.full(len(lengths), (1 - MAIN) / max(1, len(lengths) - 1))
    odds[main] = MAIN if len(lengths) > 1 else 1.0
    rng = np.random.default_rng(seeds[1])
    where = np.repeat(systems, per_system)
    which = rng.choice(len(lengths), size=len(where), p=odds)
    starts = (rng.random(len(where)) * (len(source.time) - np.array(lengths)[which] + 1)).astype(np.int64)
    parts, order, told = [], [], []
    for k, length in enumerate(lengths):
        for chosen in np.array_split(np.flatnonzero(which == k), 1 + np.sum(which == k) // CHUNK):
            if len(chosen):
                batch = source.gather(torch.from_numpy(where[chosen]), torch.from_numpy(starts[chosen]), length)
                parts.append(context_of(run, prior, batch.windows, batch.time))
                told.append(_told(run, batch.windows))
                order.append(chosen)
    place = np.concatenate(order)
    context, truth = torch.cat(parts), as_float(prior.to_normal(parameters[where[place]]))
    # a parameter that is known has no error to learn: noise about its answer, which samples never show
    free = context[:, : truth.shape[1]] + SPREAD * torch.randn(truth.shape, generator=source.generator)
    return Contexts(
        context,
        torch.where(torch.cat(told), free, truth),
        torch.from_numpy(which[place]),
        torch.from_numpy(where[place]),
    )


def _told(run: Run, windows: torch.Tensor) -> torch.Tensor:
    """Which parameters encoded windows tell, bool (windows, parameters)."""
    if not run.model.known:
        return torch.zeros((len(windows), len(run.card.encoding.parameters)), dtype=torch.bool)
    return known_parameters(windows, run.model.static, run.model.known)[0]
