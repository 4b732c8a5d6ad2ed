"""A calibration that was made before: whether its parameters may be used here, and with what noise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from datagen.fmi.fmu import fmu_sha256
from diagnosis.calibrating.schema import Calibration, read_calibration
from diagnosis.fitting.noise import NoiseModel, errors_under
from diagnosis.fitting.problem import Problem
from diagnosis.recording import DAY, HOUR
from shared.errors import RecordingError
from shared.system import System


def given_calibration(calibration: Calibration | Path | str, beside: Mapping[str, object]) -> Calibration:
    """A calibration, or the one in a folder, that stands in the place of a fit.

    Parameters
    ----------
    beside
        What belongs to a fit, by name; None where it is not given.

    Raises
    ------
    RecordingError
        If any of these is given, too, or the calibration cannot be read.
    """
    if idle := [name for name, one in beside.items() if one is not None]:
        raise RecordingError(
            f"calibration is given, and {' and '.join(idle)} beside it; expected one of both: nothing is fitted"
            " where parameters and noise are those of a calibration made before"
        )
    return calibration if isinstance(calibration, Calibration) else read_calibration(calibration)


def check_given(report: Calibration, path: object, system: System, *, replay: bool) -> None:
    """Refuse a calibration of another model, or made with controllers where actuators are replayed.

    Parameters
    ----------
    path
        Where it came from, for what is said.

    Raises
    ------
    RecordingError
        If the description, the FMU's contents or the mode is not the calibration's.
    """
    if report.system_hash != system.hash():
        raise RecordingError(f"{path}: is a calibration of {report.system}; expected one of this system")
    if report.fmu_sha256 != fmu_sha256(system.fmu_path):
        raise RecordingError(
            f"{path}: was made with another {Path(system.fmu_path).name} than there is now; expected a calibration made"
            " with this one"
        )
    if report.replay != replay:
        had, has = (("replayed actuators" if one else "simulated controllers") for one in (report.replay, replay))
        raise RecordingError(
            f"{path}: was made with {had}, and here are {has}; expected the same in both:"
            f" {'give' if report.replay else 'leave out'} --replay"
        )


def check_unknowns(report: Calibration, path: object, problem: Problem) -> None:
    """Refuse a calibration that has other unknowns than a problem.

    Raises
    ------
    RecordingError
        If persons were counted in one of both alone, or the uncertain constants are not the same.
    """
    if len(report.z) != problem.size:
        raise RecordingError(
            f"{path}: was made with persons {report.occupancy} and {len(report.constants)} uncertain constants, which"
            f" makes {len(report.z)} unknowns; here are {problem.size}, with persons {problem.occupancy} and"
            f" {len(problem.constants)} constants: give both the same occupancy and system"
        )
    check_constants(report, problem, np.array(report.z))


def check_constants(report: Calibration, problem: Problem, z: np.ndarray) -> None:
    """Refuse a calibration whose uncertain constants are not the description's: they are no part of its hash.

    Raises
    ------
    RecordingError
        If a name or a factor is another one, or there are more or fewer.
    """
    had, has = ([one.name for one in some] for some in (report.constants, problem.constants))
    if len(had) != len(has):
        raise RecordingError(
            f"the calibration has {len(had)} uncertain constants ({', '.join(had) or 'none'}), the description"
            f" {len(has)} ({', '.join(has) or 'none'}): expected the same"
        )
    factors = problem.values(z)[problem.unknown.places_of_constants]
    for told, one, factor in zip(report.constants, problem.constants, factors, strict=True):
        if told.name != one.name or not np.isclose(told.factor, factor, rtol=1e-6):
            raise RecordingError(
                f"the calibration's uncertain constant {told.name!r} is {told.factor:.4g}; the description has"
                f" {one.name!r} there, which makes it {float(factor):.4g}: expected the same uncertain constants"
            )


def noise_of(report: Calibration, system: System) -> NoiseModel:
    """The noise that a calibration found, and as which it took that of outputs which it did not fit.

    A replayed meter is so cleared of as much noise as it was there. Of outputs that it had no readings of the noise is
    that of the description's preset ``sensor``.
    """
    white = errors_under(system, "sensor")
    slow, memory = np.zeros_like(white), np.full_like(white, DAY)
    for k, name in enumerate(system.output_names):
        one = report.outputs.get(name)
        if one is not None and one.used:
            white[k], slow[k] = one.noise, one.slow_noise
            memory[k] = one.slow_hours * HOUR if one.slow_noise > 0 else DAY
        elif one is not None:
            white[k] = one.declared
    return NoiseModel(white, slow, memory)
