"""The limit of R2 that stands beside an evaluation, if one of its condition has been computed."""

from __future__ import annotations

from pathlib import Path

from shared.ceiling import FILE_NAME, Origin, Unknown, fitting, in_words, read_ceilings, unknown_constants
from shared.store import DatasetFolder
from trainer.evaluating.report import CeilingFigures
from trainer.runs.checkpoint import Card


def find_ceiling(
    card: Card, dataset: DatasetFolder, path: Path | None, *, hours: float, noise: str, channels: list[str]
) -> tuple[CeilingFigures | None, str]:
    """The ceiling of a condition, or None; and a sentence that says which, or why there is none.

    Channels from the clock and inputs are no part of the condition, but for counted persons: the ceiling takes them for
    known. A dataset without excitation has none: ceilings are computed with it. Where a dataset's uncertain constants
    were drawn the ceiling is one that took just these for unknown; where they are as declared, one that knew them.
    Raises ZeroshotError if a file that was named cannot be read.
    """
    where, manifest = path or dataset.folder / FILE_NAME, dataset.manifest
    if path is None and not where.exists():
        return None, f"no ceiling: {where} does not exist; `datagen identifiability` writes one"
    ceilings = read_ceilings(where)
    if ceilings.system_hash != card.system_hash:
        return None, f"no ceiling: {where} is of another system ({ceilings.system_name})"
    if ceilings.fmu_sha256 != manifest.fmu_sha256:
        found = f"its fmu_sha256 is {ceilings.fmu_sha256[:12]}, this dataset has {manifest.fmu_sha256[:12]}"
        return None, f"no ceiling: {where} is of another FMU: {found}"
    excited = manifest.settings.get("excitation", True) and not manifest.settings.get("calm")
    if not excited and any(i.source == "excitation" for i in dataset.system.inputs):
        return None, f"no ceiling: {where} holds with excitation; this dataset is not all with it"
    read = [name for name in card.encoding.recorded if name in channels]
    constants = constants_of(dataset)
    limits = ceilings.find(
        context_hours=hours, step=card.encoding.step, noise=noise, channels=read, constants=constants
    )
    condition = f"{hours:g} h, step {card.encoding.step:g} s, noise {noise}, channels {' '.join(read)}"
    if constants or any(one.constants for one in ceilings.ceilings):
        condition += f", {in_words(constants)}"
    if not limits:
        return None, f"no ceiling: {where} has none for {condition}"
    limit, reason = fitting(limits, origin_of(dataset), constants)
    if limit is None:
        return None, f"no ceiling: {where}: {reason}"
    return CeilingFigures(r2=limit.r2, r2_mean=limit.r2_mean), f"ceiling for {condition}, over {limit.systems} systems"


def origin_of(dataset: DatasetFolder) -> Origin:
    """What a dataset's windows are of; datasets of old say nothing of their weather."""
    weather = dataset.manifest.settings.get("weather")
    known = {str(k): str(v) for k, v in weather.items()} if isinstance(weather, dict) else {}
    return Origin.of(dataset.system.experiment, known)


def constants_of(dataset: DatasetFolder) -> dict[str, Unknown]:
    """The constants that were drawn for each system of a dataset."""
    return unknown_constants(dataset.system.uncertain if dataset.manifest.settings.get("uncertain") else [])
