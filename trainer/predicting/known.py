"""What a user knows of a building beside its readings, as an estimator takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from shared.errors import EstimatorError, RecordingError
from shared.refused import meant
from shared.times import read_recorded
from trainer.reading.encoding import Encoding


def facts_of(
    given: Path | xr.Dataset, encoding: Encoding, known: Mapping[str, float], systems: Sequence[int | None]
) -> np.ndarray | None:
    """Facts (systems, facts) [own units], not a number where unknown; None for an estimator that reads none.

    ``given`` is the recording, a file or in memory: its scalars of role ``given`` are facts that it brings. What the
    user says, ``known`` by name, comes first. Raises EstimatorError if something is known that the estimator does not
    read, or a parameter lies outside its range; RecordingError if a given fact of the recording is in another unit.
    """
    for name, value in known.items():
        if name not in encoding.facts:
            if not encoding.facts:
                raise EstimatorError(
                    f"known: {name!r} is given, and the run reads no facts; expected a run of `trainer fit --facts`"
                )
            raise EstimatorError(
                f"known: {name!r} is not a fact that the run reads{meant(name, encoding.facts)}; expected some of"
                f" {', '.join(encoding.facts)}"
            )
        if name in encoding.parameters:
            k = encoding.parameters.index(name)
            low, high = encoding.parameter_min[k], encoding.parameter_max[k]
            if not low <= value <= high:
                raise EstimatorError(f"known: {name} is {value:g}; expected {low:g} to {high:g}, the run's range")
    if not encoding.facts:
        return None
    facts = np.full((len(systems), len(encoding.facts)), np.nan)
    if encoding.given:
        path, recording = read_recorded(given)
        for one in encoding.given:
            found = recording.data_vars.get(one.name)
            if found is None or found.attrs.get("role") != "given" or found.dims not in ((), ("system",)):
                continue
            if found.attrs.get("units") != one.unit:
                raise RecordingError(
                    f"{path}: given fact {one.name} is in {found.attrs.get('units')!r}; the run expects {one.unit!r}"
                )
            facts[:, encoding.facts.index(one.name)] = np.asarray(found.values, dtype=np.float64)
    for name, value in known.items():
        facts[:, encoding.facts.index(name)] = value
    bad = [one.name for one in encoding.given if one.log and (facts[:, encoding.facts.index(one.name)] <= 0).any()]
    if bad:
        raise EstimatorError(f"known: {', '.join(bad)}: is not positive; expected a positive number")
    return facts


def facts_known(facts: np.ndarray | None, encoding: Encoding) -> dict[str, float]:
    """What is known of the first system, by name [own units]."""
    if facts is None:
        return {}
    return {name: float(v) for name, v in zip(encoding.facts, facts[0], strict=True) if np.isfinite(v)}
