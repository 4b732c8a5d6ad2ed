"""Seeds: which are allowed, and torch's own random numbers under one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from shared.errors import EstimatorError


def check_seed(seed: int) -> None:
    """Refuse a seed that numpy's generators do not take.

    Raises
    ------
    EstimatorError
        If it is negative.
    """
    if seed < 0:
        raise EstimatorError(f"seed: is {seed}; expected a whole number of at least 0")


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
