"""Windows over records: the paper's sampler (section 2.4) and the disjoint windows of its test (section 4.1)."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch

from shared.errors import EstimatorError
from shared.store import Records
from trainer.memory import memory_for
from trainer.reading.encoding import Encoding
from trainer.reading.facts import Known, Reveal
from trainer.reading.noise import Sensors


class Batch(NamedTuple):
    """What an estimator is given: encoded windows, their first time stamps, and the standardised targets."""

    windows: torch.Tensor
    """float32 (batch, length, columns)"""
    time: torch.Tensor
    """float64 (batch,) [s since time zero]"""
    targets: torch.Tensor
    """float32 (batch, parameters)"""


def context_length(context_hours: float, records: Records) -> int:
    """Samples in a context.

    Raises EstimatorError if the context is not a whole number of steps, or longer than the records.
    """
    count = len(records.time)
    step = float(records.time[1] - records.time[0]) if count > 1 else 3600.0
    exact = context_hours * 3600 / step
    length = round(exact) if math.isfinite(exact) else 0
    if length < 1 or abs(length * step - context_hours * 3600) > 1e-6 * step:
        raise EstimatorError(f"context is {context_hours:g} h; expected a whole number of steps of {step:g} s")
    if length > count:
        raise EstimatorError(
            f"context is {context_hours:g} h ({exact:.10g} samples); the dataset's records have {count} samples"
            f" ({count * step / 3600:g} h)"
        )
    return length


class WindowSource:
    """All records as one float32 tensor (systems, time, recorded); a batch of windows is one index operation.

    Sensor noise comes from ``generator``, on whose device the records are put. ``gaps`` makes readings go missing, and
    ``known`` says which facts windows tell, of an encoding that has some (:class:`trainer.reading.facts.Reveal`).
    Raises EstimatorError if memory does not hold the records a second time.
    """

    def __init__(
        self,
        records: Records,
        encoding: Encoding,
        sensors: Sensors,
        generator: torch.Generator,
        gaps: Callable[[torch.Tensor, torch.Generator], torch.Tensor] | None = None,
        known: Known = "nothing",
    ) -> None:
        device = generator.device
        # (systems, time, channels): a window is then one contiguous piece of memory
        with memory_for(f"a copy of the records of {len(records.values)} systems"):
            values = torch.from_numpy(np.ascontiguousarray(records.values.transpose(0, 2, 1), dtype=np.float32))
            self.values = values.to(device)
        self.time = torch.from_numpy(records.time.astype(np.float64)).to(device)
        self.begin = torch.from_numpy(records.starts.astype(np.float64)).to(device)
        self.targets = encoding.targets(records.parameters).to(device)
        facts = [records.parameters[:, : len(encoding.facts) - len(encoding.given)], records.given]
        self.facts = encoding.standardised(np.concatenate(facts, axis=1) if encoding.given else facts[0]).to(device)
        self.reveal = Reveal(facts[0].shape[1], len(encoding.given), known)
        self.encoding = encoding
        self.sensors = sensors
        self.generator = generator
        self.gaps = gaps
        self._offsets = torch.arange(encoding.length, device=device)

    def under(
        self,
        sensors: Sensors,
        generator: torch.Generator,
        gaps: Callable[[torch.Tensor, torch.Generator], torch.Tensor] | None,
        known: Known = "nothing",
    ) -> WindowSource:
        """The same records, not copied, under other conditions; the generator is of the same device."""
        other = copy.copy(self)
        other.sensors, other.generator, other.gaps = sensors, generator, gaps
        other.reveal = Reveal(self.reveal.parameters, self.reveal.given, known)
        return other

    def gather(self, rows: torch.Tensor, starts: torch.Tensor, length: int | None = None) -> Batch:
        """Windows of the records ``rows`` that begin at the samples ``starts``, both int64 (batch,).

        They are as long as the encoding says, or ``length`` samples.
        """
        rows, starts = rows.to(self.values.device), starts.to(self.values.device)
        values = self.values[rows[:, None], starts[:, None] + self._offsets[:length]]
        time = self.begin[rows] + self.time[starts]
        values = self.sensors(values, self.generator)
        if self.gaps is not None:
            values = self.gaps(values, self.generator)
        static = self.reveal(self.facts[rows], self.generator) if self.facts.shape[1] else None
        return Batch(self.encoding.encode(values, time, static), time, self.targets[rows])


class Sampler:
    """The paper's sampler: a system uniformly, then a start uniformly; an epoch is as many windows as one asks for.

    Where the encoding has several lengths, all windows of a batch have one of them: half of the batches have the length
    ``main``, the others take turns by chance, long ones less often in proportion, so that each costs the same.
    """

    def __init__(self, source: WindowSource, rows: np.ndarray, seed: int, main: int | None = None) -> None:
        self.source = source
        self.rows = torch.from_numpy(np.asarray(rows, dtype=np.int64))
        self.lengths = source.encoding.lengths
        others = [0.0 if length == main else 1.0 / length for length in self.lengths]
        share = 0.5 if main is not None and len(self.lengths) > 1 else 0.0
        self.odds = torch.tensor([(1 - share) * o / (sum(others) or 1.0) for o in others])
        if main is not None:
            self.odds[self.lengths.index(main)] = share or 1.0
        self.generator = torch.Generator().manual_seed(seed)

    def indices(self, count: int, length: int | None = None) -> tuple[torch.Tensor, torch.Tensor]:
        """Rows and starts of ``count`` windows, int64 (count,) each."""
        starts = self.source.values.shape[1] - (length or self.source.encoding.length) + 1
        which = torch.randint(len(self.rows), (count,), generator=self.generator)
        return self.rows[which], torch.randint(starts, (count,), generator=self.generator)

    def draw(self, count: int) -> Batch:
        """A batch of ``count`` windows."""
        if len(self.lengths) == 1:
            return self.source.gather(*self.indices(count))
        length = self.lengths[int(torch.multinomial(self.odds, 1, generator=self.generator))]
        return self.source.gather(*self.indices(count, length), length)


def disjoint_windows(
    rows: np.ndarray, samples: int, length: int, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and starts, int64 (windows,) each, of up to ``count`` windows of which no two overlap (paper, section 4.1).

    Each record is cut into ``samples // length`` windows behind an offset of its own; of all those, ``count`` are drawn
    without replacement. Where there are fewer, all are returned.
    """
    slots = samples // length
    if slots < 1 or len(rows) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    offsets = rng.integers(samples - slots * length + 1, size=len(rows))
    chosen = np.sort(rng.choice(len(rows) * slots, size=min(count, len(rows) * slots), replace=False))
    which, slot = np.divmod(chosen, slots)
    return np.asarray(rows, np.int64)[which], offsets[which] + slot * length
