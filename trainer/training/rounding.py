"""Whether this processor is any faster with products that are rounded to bfloat16: some compute them in software."""

from __future__ import annotations

import time

import numpy as np
import torch

ROWS, WIDTH, TIMES = 2048, 256, 5
"""About the products of an encoder; how often each is timed."""


def slowdown() -> float:
    """Time of a product in bfloat16 over that in single precision, the median of a few in turn."""
    ratios = []
    with torch.inference_mode():
        exact = torch.ones(ROWS, WIDTH), torch.ones(WIDTH, WIDTH)
        coarse = tuple(one.bfloat16() for one in exact)
        _seconds(*exact), _seconds(*coarse)  # the first ones prepare what later ones find
        for _ in range(TIMES):
            single = _seconds(*exact)
            ratios.append(_seconds(*coarse) / single)
    return float(np.median(ratios))


def _seconds(left: torch.Tensor, right: torch.Tensor) -> float:
    began = time.perf_counter()
    torch.mm(left, right)
    return time.perf_counter() - began
