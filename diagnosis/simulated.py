"""A recording beside its simulation: what the model with given parameters would have shown, and what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as with_changes
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import opened
from diagnosis.calibrating.given import check_given, check_unknowns, given_calibration, noise_of
from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import curves, plot
from diagnosis.fitting.likely import LOOKS, most_likely, pruned
from diagnosis.fitting.lines import metered
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import InProcess, Outcome, Run
from diagnosis.recording import HOUR, Recording
from diagnosis.scores import score
from diagnosis.usual import WARM_UP
from diagnosis.zero_shot import estimate
from shared.errors import RecordingError, SystemDescriptionError
from shared.refused import meant
from shared.results import Result
from shared.stretches import Stretch
from shared.system import System
from shared.variables import spaced


@dataclass(frozen=True, repr=False)
class Residuals(Result):
    """What is left of a recording after its simulation.

    ``parameters`` that were used, what is ``assumed`` of inputs that were not measured, and which outputs were
    ``replayed``: their readings drive the model, so that their figures say nothing of it. ``outputs``: for each that
    was measured the figures of :class:`diagnosis.scores.Score`, and the ``autocorrelation`` of the residual at one step
    (None where no two neighbouring readings are there). ``drawn``: measured and model over (output, time).
    """

    recording: str
    parameters: dict[str, float]
    assumed: dict[str, str]
    replayed: list[str]
    outputs: dict[str, dict[str, Any]]
    drawn: xr.Dataset

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        left = ", ".join(f"{name} {one['rmse']:.3g}{spaced(one['unit'])}" for name, one in self.outputs.items())
        return f"{self.recording}: RMSE {left}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each output: its figures."""
        return pd.DataFrame(self.outputs).T.rename_axis("output")

    def plot(self) -> Figure:
        """Measured and simulated, output by output."""
        return plot(self.drawn)

    def to_json(self) -> dict[str, Any]:
        """What ``diagnosis residuals --json`` prints."""
        return {name: one for name, one in vars(self).items() if name != "drawn"}


def residuals(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
    *,
    run: Path | str | None = None,
    calibration: Calibration | Path | str | None = None,
    parameters: Mapping[str, float] | None = None,
    replay: bool = False,
    stretch: Stretch | None = None,
    noise: str | None = None,
    warm_up: float = WARM_UP,
) -> Residuals:
    """Simulate a recording with given, estimated or calibrated parameters and compare output by output.

    The model is driven as in a calibration: see :mod:`diagnosis.fitting.inputs`. Persons whom nobody counted are as the
    description expects them, and the recording's first day stands in for what came before it. With ``calibration`` both
    are what the recording's readings make most likely, so that on its own recording the figures are the calibration's.

    Parameters
    ----------
    run
        An estimator's folder, whose estimate is used for parameters that are not given.
    calibration
        A calibration made before, or its folder: its parameters, uncertain constants and noise, in place of ``run``,
        ``parameters`` and ``noise``.
    parameters
        Values by name [unit of the description], which are simulated as they are, beyond their ranges too.
    replay
        The recorded actuators replace the model's control loops, cleared of their meters' noise.
    stretch
        Which stretch without gaps of a recording's inputs is taken; the longest, if not given.
    noise
        A noise preset of the description: how noisy those meters are (``sensor`` if not given).
    warm_up
        The recording's first day is repeated this long before its start [h]; at least a step.

    Raises
    ------
    RecordingError, SystemDescriptionError, EstimatorError, SimulationError
        If the recording, the preset, the parameters, the estimator or the simulation cannot be used.
    """
    given = None
    if calibration is not None:
        beside = {"run": run, "parameters (--set)": parameters or None, "noise": noise}
        given = given_calibration(calibration, beside)
    noise = "sensor" if noise is None else noise
    described, record = opened(
        system,
        recording,
        noise=noise,
        warm_up=warm_up,
        replay=replay,
        occupancy=None if given is None else given.occupancy,
        stretch=stretch,
    )
    if given is not None:
        check_given(given, calibration, described, replay=replay)
        values = {one.name: one.value for one in given.parameters}
        problem, simulated = _calibrated(given, calibration, described, record, warm_up)
        expected = "what the readings make most likely"
    else:
        values = _parameters(described, record, run, parameters or {})
        problem, simulated = _with_values(described, record, values, noise=noise, replay=replay, warm_up=warm_up)
        expected = "as many as the description expects"
    assumed = dict(problem.drive.assumed)
    assumed |= {described.input_names[level.column]: expected for level in problem.nuisance.levels}
    found = {}
    for k, output in enumerate(described.outputs):
        seen = np.isfinite(record.outputs[k])
        if seen.any():
            found[output.name] = _compare(record.outputs[k], simulated[k], output.unit)
    drawn = curves(record.time, record.zero, described.outputs, measured=record.outputs, model=simulated)
    return Residuals(str(record.path), values, assumed, list(problem.drive.replayed), found, drawn)


def _with_values(
    system: System, record: Recording, values: Mapping[str, float], *, noise: str, replay: bool, warm_up: float
) -> tuple[Problem, np.ndarray]:
    """A recording's problem and the outputs (outputs, steps) with given parameters, nuisance as expected."""
    simulator = Simulator(system)
    problem = Problem(
        simulator,
        record,
        noise=noise,
        replay=replay,
        warm_up=warm_up * HOUR,
        known=("constants", "history"),
        runner=_Given(simulator, values),
    )
    return problem, problem.simulate(problem.unknowns(values))


def _calibrated(
    report: Calibration, path: object, system: System, record: Recording, warm_up: float
) -> tuple[Problem, np.ndarray]:
    """A recording's problem and the outputs (outputs, steps) with a calibration's unknowns, nuisance most likely."""
    problem = Problem(
        Simulator(system),
        record,
        noise=noise_of(report, system),
        replay=report.replay,
        occupancy=report.occupancy,
        warm_up=warm_up * HOUR,
    )
    check_unknowns(report, path, problem)
    z = np.array(report.z)
    fitted, _ = metered(*pruned(problem, problem.linearise(z)))
    return problem, most_likely(fitted, z, LOOKS)[1]


class _Given(InProcess):
    """Simulates with given values exactly: a problem's unknowns end where the parameters' ranges do."""

    def __init__(self, simulator: Simulator, values: Mapping[str, float]) -> None:
        super().__init__(simulator)
        self._values = values

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.simulations.Runner`."""
        return super().map([with_changes(run, parameters={**run.parameters, **self._values}) for run in runs])


def _parameters(
    system: System, recording: Recording, run: Path | str | None, given: Mapping[str, float]
) -> dict[str, float]:
    unknown = sorted(set(given) - set(system.parameter_names))
    if unknown:
        said = (f"{name!r} is not an estimated parameter{meant(name, system.parameter_names)}" for name in unknown)
        raise SystemDescriptionError(
            "\n".join(f"{system.path}: {one}" for one in said)
            + f"\nexpected names of {', '.join(system.parameter_names)}"
        )
    values = dict(given)
    if run is not None:
        values = {**estimate(run, recording, system), **values}
    missing = [name for name in system.parameter_names if name not in values]
    if missing:
        raise RecordingError(
            f"no value for {', '.join(missing)}; expected --set NAME=VALUE, an estimator (--run) or a calibration"
            " (--calibration)"
        )
    return {name: float(values[name]) for name in system.parameter_names}


def _compare(measured: np.ndarray, simulated: np.ndarray, unit: str) -> dict[str, Any]:
    found = score(measured, simulated, unit)
    seen = np.isfinite(measured)
    both = seen[1:] & seen[:-1]
    series = np.where(seen, measured - simulated - found.bias, 0.0)
    variance = float(np.mean(series[seen] ** 2))
    # per pair as per reading: where readings are missing there are fewer pairs
    pairs = (series[1:] * series[:-1])[both]
    lagged: float | None = None
    if pairs.size:
        lagged = float(np.clip(np.mean(pairs) / variance, -1.0, 1.0)) if variance > 0 else 0.0
    return {**found.model_dump(), "autocorrelation": lagged}
