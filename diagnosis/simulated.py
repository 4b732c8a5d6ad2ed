"""A recording beside its simulation: what the model with given parameters would have shown, and what is left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.recording import HOUR, check_warm_up, read_recording, recorded_inputs
from diagnosis.scores import score
from shared.errors import RecordingError, SystemDescriptionError
from shared.system import System, load_system


def residuals(
    system: System | Path | str,
    recording: Path | str,
    *,
    run: Path | str | None = None,
    parameters: Mapping[str, float] | None = None,
    replay: bool = False,
    warm_up: float = 240.0,
) -> dict[str, Any]:
    """Simulate a recording's inputs with given or estimated parameters and compare output by output.

    Parameters
    ----------
    run
        An estimator's folder, whose estimate is used for parameters that are not given.
    parameters
        Values by name [unit of the description].
    warm_up
        The recording's first day is repeated this long before its start [h]; at least a step.

    Returns
    -------
    dict
        ``parameters`` used, and for each measured output the figures of :class:`diagnosis.scores.Score` and the
        ``autocorrelation`` of the residual at one step.

    Raises
    ------
    RecordingError, SystemDescriptionError, SimulationError
        If the recording, the parameters or the simulation cannot be used.
    """
    described = system if isinstance(system, System) else load_system(system)
    record = read_recording(recording, described)
    values = _parameters(described, Path(recording), run, parameters or {})
    check_warm_up(record, warm_up * HOUR)
    described = described.with_experiment(step=record.step)
    inputs = recorded_inputs(described, record, warm_up * HOUR)
    trajectory = Simulator(described).run(
        values,
        inputs,
        start=record.start - warm_up * HOUR,
        stop=record.stop,
        record_from=record.start,
        replay=replay,
    )
    found = {}
    for k, output in enumerate(described.outputs):
        seen = np.isfinite(record.outputs[k])
        if seen.any():
            found[output.name] = _compare(record.outputs[k], trajectory.outputs[k], output.unit)
    return {"recording": str(recording), "parameters": values, "outputs": found}


def _parameters(
    system: System, recording: Path, run: Path | str | None, given: Mapping[str, float]
) -> dict[str, float]:
    unknown = sorted(set(given) - set(system.parameter_names))
    if unknown:
        raise SystemDescriptionError(f"{system.path}: {unknown[0]!r} is not an estimated parameter")
    values = dict(given)
    if run is not None:
        from trainer import predict

        estimate = predict(run, recording).predictions[0].parameters
        values = {**{name: one.value for name, one in estimate.items()}, **values}
    missing = [name for name in system.parameter_names if name not in values]
    if missing:
        raise RecordingError(f"no value for {', '.join(missing)}; expected --set NAME=VALUE or an estimator (--run)")
    return {name: float(values[name]) for name in system.parameter_names}


def _compare(measured: np.ndarray, simulated: np.ndarray, unit: str) -> dict[str, Any]:
    found = score(measured, simulated, unit)
    seen = np.isfinite(measured)
    both = seen[1:] & seen[:-1]
    series = np.where(seen, measured - simulated - found.bias, 0.0)
    spread = float(np.sum(series**2))
    lagged = float(np.sum((series[1:] * series[:-1])[both])) / spread if spread > 0 else 0.0
    return {**found.model_dump(), "autocorrelation": lagged}
