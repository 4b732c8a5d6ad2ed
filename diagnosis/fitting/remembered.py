"""Simulations that were just made are not made again: a fit asks for its base point in several places."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from diagnosis.fitting.run import Run
from diagnosis.fitting.side_by_side import Outcome, Runner

KEPT = 16
"""Outcomes that are remembered, the latest: a fit comes back to where it was, not to where it was long ago."""


class Remembered:
    """Outcomes of runs that were asked for singly.

    A simulation depends on its run alone, so the answer is the same to the last bit. Runs of a batch are the steps of
    differences, to which nobody comes back: they are looked up, but not kept. Failures are not kept either.
    """

    def __init__(self) -> None:
        self._known: OrderedDict[bytes, np.ndarray] = OrderedDict()

    def map(self, runner: Runner, runs: Sequence[Run]) -> tuple[list[Outcome], int]:
        """Outcome of each run, in order, and how many of them the runner had to simulate."""
        keys = [_key(one) for one in runs]
        left = [k for k, key in enumerate(keys) if key not in self._known]
        made = dict(zip(left, runner.map([runs[k] for k in left]) if left else [], strict=True))
        # copies: whoever changes what they were given must not change what is remembered
        outcomes = [made[k] if k in made else self._known[key].copy() for k, key in enumerate(keys)]
        if len(runs) == 1 and isinstance(outcomes[0], np.ndarray):
            self._known[keys[0]] = outcomes[0].copy()
            self._known.move_to_end(keys[0])
            if len(self._known) > KEPT:
                self._known.popitem(last=False)
        return outcomes, len(left)


def _key(run: Run) -> bytes:
    """What a simulation depends on."""
    rest = (sorted(run.parameters.items()), run.inputs.names, run.start, run.stop, run.record_from, run.replay)
    digest = blake2b(repr((rest, run.tolerance)).encode(), digest_size=16)
    for values in (run.inputs.time, run.inputs.left, run.inputs.right, run.inputs.jump):
        digest.update(values.tobytes())
    return digest.digest()
