"""The readings of a recording, held against those that a run was trained on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shared.codes import CODES
from shared.errors import RecordingError
from shared.schema import EPOCH
from shared.units import spelled
from shared.variables import spaced
from trainer.reading.encoding import Encoding

FARTHEST = 30.0
"""Standard deviations from the training's mean that a reading may lie: of no training does more than one reading in 900
lie farther (Chebyshev's inequality), and those of rooms simulated for other purposes stay within seven."""
ODD = 5.0
"""Standard deviations from the training's mean beyond which nines (:data:`shared.codes.CODES`) are taken for a code."""
COLDEST = 150.0
"""Temperature [K] below which no weather and no room has ever been: readings there are in degC, or a code."""
ROUNDING = 1e-3
"""Share of its value by which a channel that did not vary in training may differ: that much is how it was written."""
ROUNDED_KELVIN = 0.06
"""The same of a temperature [K], of which a share would be a quarter of a degree: 293.15 K may be written as 293.2."""


class GapError(RecordingError):
    """Readings, or whole rows, are missing: a shorter window may have them all."""


def date_of(stamp: float) -> str:
    """The date of a time stamp [s since time zero]."""
    return str(np.datetime64(EPOCH, "s") + np.timedelta64(round(stamp), "s"))


def check_gaps(path: Path, name: str, values: np.ndarray, systems: list[int | None], largest: float) -> None:
    """Refuse infinite values, and more missing ones than the share ``largest`` of a window.

    ``values`` are those of a channel, shape (systems, length). Raises RecordingError if there are such; of several
    systems the one that has most of them is named.
    """
    length = values.shape[-1]
    allowed = int(largest * length)
    finite = "expected numbers: check the unit, and declare what is missing so (NaN)"
    fewer = f"expected {f'at most {allowed}' if allowed else 'none'}: choose a window without (--from and --to)"
    fill = "; only an input's gaps may be filled (fill in the mapping of `diagnosis import`)"
    for what, found, most, expected in (
        ("infinite", np.isinf(values), 0, finite),
        ("missing", np.isnan(values), allowed, f"{fewer}{fill}"),
    ):
        counts = found.sum(axis=-1)
        worst = int(counts.argmax())
        if counts[worst] > most:
            whose = "" if systems[worst] is None else f" of system {systems[worst]}"
            many = f"{counts[worst]} {what} value{'' if counts[worst] == 1 else 's'}"
            kind = GapError if what == "missing" else RecordingError
            raise kind(f"{path}: {name}{whose} has {many} in its last {length} samples; {expected}")


def comparable(
    path: Path, values: np.ndarray, times: np.ndarray, systems: list[int | None], encoding: Encoding
) -> np.ndarray:
    """The readings, if they are of the kind that the run was trained on.

    ``values`` are (systems, length, recorded) [the run's units], NaN where missing, and ``times`` the ends of their
    steps, (systems, length) [s since time zero]. A channel that did not vary in training is given the value that it had
    there: an estimator was never told what to make of a rounding. Raises RecordingError if a reading is too far from
    the training's, or a code for a missing one; of several the first system's first.
    """
    mean = np.array(encoding.mean)
    constant = np.isin(encoding.recorded, encoding.constant)
    with np.errstate(over="ignore"):  # of a damaged card's numbers
        kelvin = np.array([spelled(unit) == "K" for unit in encoding.units], dtype=bool)
        absolute = kelvin & (mean > COLDEST)  # a difference is in K, too
        rounding = np.where(absolute, ROUNDED_KELVIN, ROUNDING * np.abs(mean))
        allowed = np.where(constant, rounding, FARTHEST * np.array(encoding.sd))
        allowed = np.where(absolute, np.minimum(allowed, mean - COLDEST), allowed)
        odd = np.where(constant, allowed, np.minimum(ODD * np.array(encoding.sd), allowed))
    away = np.abs(values - mean)
    codes = CODES.astype(np.float32)
    coded = (away > odd) & np.isin(values.astype(np.float32), codes)  # in whichever precision they were written
    far = coded | (away > allowed)  # nowhere for NaN
    if not far.any():
        return np.where(constant & np.isfinite(values), mean, values).astype(np.float32)
    i, at, k = (int(place) for place in np.unravel_index(np.argmax(far), far.shape))
    unit = spaced(encoding.units[k])
    whose = "" if systems[i] is None else f" of system {systems[i]}"
    found = f"{path}: {encoding.recorded[k]}{whose} is {values[i, at, k]:g}{unit} at {date_of(times[i, at])}"
    if constant[k]:
        raise RecordingError(
            f"{found}; in the run's training it was {mean[k]:g}{unit} throughout, so that the run cannot tell what a"
            " change of it does: fit one to a dataset in which it varies, or one that does not read it"
        )
    sd = encoding.sd[k]
    if coded[i, at, k]:
        raise RecordingError(
            f"{found}, as loggers write where a reading is missing (the run's training: {mean[k]:.4g}{unit}, standard"
            f" deviation {sd:.3g}{unit}); expected a reading: declare such codes missing (NaN)"
        )
    raise RecordingError(
        f"{found}, {abs(values[i, at, k] - mean[k]) / sd:.0f} standard deviations from the mean of the run's training"
        f" ({mean[k]:.4g}{unit}, standard deviation {sd:.3g}{unit}); expected at most {allowed[k] / sd:.3g}: declare"
        " a code for a missing reading missing (NaN), and check the unit"
    )
