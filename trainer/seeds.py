"""Seeds and threads: which are allowed, and torch's own random numbers under one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

from shared.errors import EstimatorError

_NOISE = 0x4015E
"""Tells the stream of a fit's noise from those that the seed itself gives."""
MOST_THREADS = 256
"""Of torch."""


def check_seed(seed: int) -> None:
    """Refuse a negative seed, which numpy's generators do not take: an EstimatorError."""
    if seed < 0:
        raise EstimatorError(f"seed: is {seed}; expected a whole number of at least 0")


def check_threads(threads: int) -> None:
    """Refuse a number of threads that torch cannot start: its library ends the process over it.

    Raises EstimatorError if there are none, or more than MOST_THREADS.
    """
    if not 1 <= threads <= MOST_THREADS:
        raise EstimatorError(f"threads: is {threads}; expected 1 to {MOST_THREADS}")


def check_device(name: str) -> torch.device:
    """The device of a name: ``cpu``, or ``cuda`` where there is a graphics card that torch can use.

    Raises EstimatorError if it is another name, or there is none.
    """
    if name.partition(":")[0] not in ("cpu", "cuda"):
        raise EstimatorError(f"device: is {name!r}; expected cpu or cuda")
    if name.startswith("cuda") and not torch.cuda.is_available():
        raise EstimatorError(f"device: is {name!r}, and torch finds no graphics card here; expected cpu")
    return torch.device(name)


def noise_seed(seed: int) -> int:
    """Seed of a fit's sensor noise and gaps.

    An evaluation takes the first number of the seed's own sequence for its noise. Were this the same one, an evaluation
    with the fit's seed would begin with the very noise that the weights were trained under and chosen by.
    """
    return int(np.random.SeedSequence(seed, spawn_key=(_NOISE,)).generate_state(1)[0])


@contextmanager
def torch_state(seed: int, threads: int) -> Iterator[None]:
    """Seed torch and set its threads, and put back both afterwards: a library must not change its host."""
    before = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(threads)
        try:
            yield
        finally:
            torch.set_num_threads(before)
