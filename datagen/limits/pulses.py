"""Responses to many short pulses from fewer simulations: those that lie far apart share one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

APART = 240.0 * 3600.0
"""Pulses so far apart share a simulation [s]: what somebody brings in half an hour is gone by then."""


def responses(
    response: Callable[[Sequence[tuple[float, float]]], np.ndarray],
    pulses: Sequence[tuple[float, float]],
    time: np.ndarray,
    apart: float = APART,
) -> np.ndarray:
    """Responses to pulses one by one, shape (outputs, steps, pulses), from those to several at once.

    Parameters
    ----------
    response
        Outputs (outputs, steps) less those without, for some pulses.
    pulses
        Begin and end of each [s], one after another.
    time
        Ends of the steps, shape (steps,) [s].
    apart
        Pulses that begin so long after one another share a simulation; each is followed until the next begins [s].
    """
    begins = np.array([begin for begin, _ in pulses])
    found: list[np.ndarray] = [np.empty(0)] * len(pulses)
    left = list(range(len(pulses)))
    while left:
        comb: list[int] = []
        for k in left:
            if not comb or begins[k] >= begins[comb[-1]] + apart:
                comb.append(k)
        left = [k for k in left if k not in set(comb)]
        whole = response([pulses[k] for k in comb])
        for k, end in zip(comb, [*begins[comb[1:]], np.inf], strict=True):
            found[k] = np.where((time > begins[k]) & (time <= end), whole, 0.0)
    return np.stack(found, axis=-1)
