"""Which part of a recording is fitted, and which is kept to score on: chosen from the inputs alone.

Days are joined to blocks. A quarter of the blocks is kept: those with the most and the least of what varies most from
block to block (the first principal component of the blocks' input means), so that the score is one under other
conditions than the fit's. Outputs take no part in this. The first block is always fitted: it is where what came before
the recording is told.
"""

from __future__ import annotations

import numpy as np

from diagnosis.recording import DAY, Recording

PARTS = 8
SHARE = 0.25
"""Share of the blocks that is kept."""


def kept_for_scoring(recording: Recording) -> np.ndarray:
    """Steps that are scored on, shape (steps,); the others are fitted.

    A recording of less than four days keeps its last quarter.
    """
    days = (recording.stop - recording.start) / DAY
    if days < 4:
        return np.asarray(recording.time > recording.start + 0.75 * (recording.stop - recording.start))
    whole = int(days + 1e-9)
    length = int(np.ceil(whole / min(PARTS, whole)))
    count = -(-whole // length)
    # what is more than whole days belongs to the last block: hours alone would be the farthest out of all
    block = np.minimum((recording.time - recording.start - 1e-6) // (length * DAY), count - 1).astype(int)
    found = np.unique(block)
    means = np.array([[values[block == b].mean() for values in recording.inputs.values()] for b in found])
    spread = means.std(axis=0)
    moved = spread > 1e-9 * np.maximum(np.abs(means).max(axis=0, initial=0.0), 1e-300)
    if not moved.any():
        order = np.arange(len(found))
    else:
        apart = (means[:, moved] - means[:, moved].mean(axis=0)) / spread[moved]
        component = np.linalg.svd(apart, full_matrices=False)[0][:, 0]
        # the sign of a component is the processor's choice; where one block is kept, it is the one farthest out
        component *= np.sign(component[np.abs(component).argmax()])
        order = np.argsort(component, kind="stable")
    order = order[order > 0]  # the first block tells what came before the recording
    keep = max(round(SHARE * len(found)), 1)
    ends = [*order[: keep // 2], *order[len(order) - (keep - keep // 2) :]]
    return np.isin(block, found[ends])
