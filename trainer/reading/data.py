"""A dataset, opened for training or evaluation: records of chosen channels, checked."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from shared.errors import DatasetError, EstimatorError
from shared.store import DatasetFolder, Records


def load_records(dataset: DatasetFolder, recorded: list[str], rows: np.ndarray | None = None) -> Records:
    """Read channels and parameters of all systems, or of those in some ``rows``.

    Raises DatasetError if a value is not finite, or a parameter is of another sign than its range, or the time stamps
    are not evenly spaced.
    """
    records = dataset.load(recorded, rows)
    for k, channel in enumerate(records.channels):
        bad = ~np.isfinite(records.values[:, k]).all(axis=1)
        if bad.any():
            raise DatasetError(
                f"{dataset.folder}: {channel} of system {records.systems[bad][0]} is not finite throughout;"
                f" `datagen verify` names what is damaged"
            )
    lowest = np.array([p.min if p.min <= 0 else np.nextafter(0.0, 1.0) for p in dataset.system.parameters])
    bad = ~(np.isfinite(records.parameters) & (records.parameters >= lowest)).all(axis=1)
    if bad.any():
        raise DatasetError(
            f"{dataset.folder}: a parameter of system {records.systems[bad][0]} is not a number of the sign that its"
            " range has; `datagen verify` names what is damaged"
        )
    steps = np.diff(records.time)
    if len(steps) and not np.allclose(steps, steps[0], rtol=1e-6):
        raise DatasetError(f"{dataset.folder}: time stamps are not evenly spaced")
    return records


def rows_of(records: Records, split: str, folder: Path) -> np.ndarray:
    """Rows of a split.

    Raises DatasetError if there are none.
    """
    rows = records.of_split(split)
    if not len(rows):
        raise DatasetError(
            f"{folder}: none of its {len(records.systems)} systems is in the split {split!r};"
            " of each ten systems one validates and one tests: simulate at least ten"
        )
    return rows


def training_records(dataset: DatasetFolder, recorded: list[str], systems: int | None) -> Records:
    """Training and validation systems, of the former the first so many; all if ``systems`` is None.

    Raises EstimatorError if there are fewer, or it is one only: answers and losses are in units of the spread between
    systems; DatasetError as :func:`load_records` and :func:`rows_of`.
    """
    index = load_records(dataset, [])
    training, validation = (rows_of(index, split, dataset.folder) for split in ("train", "validation"))
    if len(training) < 2:
        raise DatasetError(f"{dataset.folder}: has one training system; expected two or more, whose parameters differ")
    if systems is not None and not 2 <= systems <= len(training):
        raise EstimatorError(
            f"systems: is {systems}; expected 2 to the {len(training)} training systems of the dataset: one alone has"
            " no spread to tell parameters by"
        )
    return load_records(dataset, recorded, np.sort(np.concatenate([training[:systems], validation])))


def identity_of(dataset: DatasetFolder, index: Records) -> dict[str, Any]:
    """What makes the systems of a dataset these and no others, as JSON holds it.

    The hash of the description knows nothing of the FMU's bytes, nor of how it was simulated; equal numbers of systems
    may be of different root seeds.
    """
    who = "\n".join(f"{seed} {system}" for seed, system in zip(index.seeds, index.systems, strict=True))
    settings = json.dumps(dataset.manifest.settings, sort_keys=True)
    return {
        "system_name": dataset.system.name,
        "system_hash": dataset.manifest.system_hash,
        "systems": len(index.systems),
        "systems_sha256": hashlib.sha256(who.encode()).hexdigest(),
        "fmu_sha256": dataset.manifest.fmu_sha256,
        "settings_sha256": hashlib.sha256(settings.encode()).hexdigest(),
    }


def fingerprint(dataset: DatasetFolder) -> str:
    """sha256 of a dataset's identity."""
    return digest_of(identity_of(dataset, load_records(dataset, [])))


def digest_of(identity: dict[str, Any]) -> str:
    """sha256 of what :func:`identity_of` gave."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def difference(found: dict[str, Any], expected: dict[str, Any]) -> str | None:
    """What of ``expected`` is otherwise in ``found``, in words, or not in it at all; None where all is the same."""
    for name, value in expected.items():
        if name in found and found[name] != value:
            return f"{name} was {found[name]!r} and is {value!r} now"
    lacking = ", ".join(name for name in expected if name not in found)
    return f"an earlier version began it and did not note {lacking}: it may be of other data" if lacking else None
