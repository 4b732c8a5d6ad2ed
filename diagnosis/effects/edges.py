"""Readings that some candidate would have to invent: they count for none, so that all are weighed by the same ones.

A late clock shows at the recording's end what was there after it, and a set point that comes early is then one that
nobody recorded. Whatever is put in its place is charged to the cause that is right: a heater that starts at six, in a
week that ends at six, costs a clock that is a quarter of an hour late forty in log likelihood. Leaving such readings
out of one candidate alone would not do, because evidences of different readings cannot be compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.effects.base import Effect
from diagnosis.recording import Recording


def foreseen(effects: Sequence[Effect], recording: Recording) -> np.ndarray:
    """Readings that every effect derives from the recording's own time at any amplitude, shape (outputs, steps)."""
    kept = np.ones(recording.outputs.shape, dtype=bool)
    for effect in effects:
        invented = getattr(effect, "invented", None)  # of a package's own effects nothing is known
        if invented is not None:
            kept &= ~invented(recording.time)
    return kept
