"""``simulate`` one system into one NetCDF file, the shape in which measurements come too."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from datagen.driving.sampling import record_start, sample_parameters, stream, told_values
from datagen.simulating.constants import sample_factors
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator
from shared.errors import DatasetError, SystemDescriptionError
from shared.logs import logger
from shared.places import check_folder
from shared.refused import meant
from shared.schema import CLOCK, STEP_END, build_shard
from shared.store import write_shard
from shared.system import System, load_system
from shared.variables import Noise, spaced

_log = logger(__name__)


def simulate(
    system: Path | str | System,
    *,
    parameters: Mapping[str, float] | None = None,
    out: Path | str | None = None,
    hours: float | None = None,
    step: float | None = None,
    seed: int = 0,
    index: int = 0,
    excitation: bool = True,
    uncertain: bool = False,
    noise: str = "none",
) -> xr.Dataset:
    """Simulate one system and return its outputs and inputs, dimensions (time); write them to ``out`` if given.

    Parameters
    ----------
    parameters
        Values by name [unit of the description]; the others are drawn as the farm would for (``seed``, ``index``).
    uncertain
        Draw the description's uncertain constants, too; a value that is given stays.
    noise
        Preset of the description, as which its sensors read the outputs; ``none`` leaves them as simulated. The errors
        depend on (``seed``, ``index``).

    Raises
    ------
    SystemDescriptionError
        If a parameter is unknown to the description and the FMU, or the preset to the description.
    SimulationError
        If the end was not reached.
    DatasetError
        If the seed or the index is out of range, or ``out`` cannot be written or is no .nc; a file that was there is as
        it was.
    """
    for name, value in (("seed", seed), ("index", index)):
        if value < 0:
            raise DatasetError(f"{name} is {value}; expected at least 0")
    if index >= 2**63:  # what a record's int64 holds
        raise DatasetError(f"index is {index}; expected at most {2**63 - 1}")
    path = _place(out) if out is not None else None
    described = system if isinstance(system, System) else load_system(system)
    described = described.with_experiment(hours=hours, step=step)
    if uncertain and not described.uncertain:
        raise SystemDescriptionError(
            f"uncertain is set; expected an [[uncertain]] table in {described.path}, which has none"
        )
    described.noise_sd(noise)  # refuses an unknown preset before long work
    simulator = Simulator(described)
    given = dict(parameters or {})
    for name in given:
        variable = simulator.fmu.variables.get(name)
        estimated = name in described.parameter_names  # which may be an input of the FMU
        if not estimated and (variable is None or variable.causality != "parameter"):
            raise SystemDescriptionError(
                f"{described.path}: {name!r} is not a parameter of {simulator.fmu.path.name}; "
                f"estimated ones are {', '.join(described.parameter_names)}{_meant(name, described, simulator)}"
            )
    for one in described.parameters:
        if one.name in given and not one.min <= given[one.name] <= one.max:
            _log.warning(
                "%s is set to %g%s, beyond its range of %g to %g: no estimator that is trained on the description knows"
                " such systems",
                *(one.name, given[one.name], spaced(one.unit), one.min, one.max),
            )
    for name in given:
        for still in _still(name, described):
            _log.warning(
                "%s is set to %g, and does nothing: it acts while input %r is not 0, which the description holds at 0",
                *(name, given[name], still),
            )
    trajectory = simulate_system(
        simulator, root_seed=seed, index=index, parameters=given, excitation=excitation, uncertain=uncertain
    )
    drawn = sample_parameters(described, seed, index)
    values = np.array([given.get(n, v) for n, v in zip(described.parameter_names, drawn, strict=True)])
    others = {k: v for k, v in given.items() if k not in described.parameter_names}
    open_ = described.with_known(others).uncertain  # what is set is not drawn
    drawn_at = [k for k, one in enumerate(described.uncertain) if one.name in {o.name for o in open_}]
    shard = build_shard(
        described.model_copy(update={"uncertain": open_}),
        indices=np.array([index]),
        root_seed=seed,
        parameters=values[None],
        outputs=readings(described, trajectory.outputs, noise, stream(seed, index, "sensors"))[None],
        inputs=trajectory.inputs[None],
        starts=np.array([record_start(described, seed, index)]),
        factors=sample_factors(described, seed, index)[None, drawn_at] if uncertain else None,
        given=told_values(described, seed, index)[None] if described.told else None,
        attributes={
            "fmu_sha256": simulator.fmu.sha256,
            "root_seed": str(seed),
            **({"noise": noise} if noise != "none" else {}),
            **({"other_parameters": ", ".join(f"{k}={v:g}" for k, v in others.items())} if others else {}),
        },
    )
    record = on_the_clock(shard.isel(system=0))
    if path is not None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_shard(path, record, [index])
        except OSError as error:
            raise DatasetError(
                f"{path}: cannot be written ({error.strerror or error}); expected a place that can be written to, with "
                "free space"
            ) from None
    return record


def readings(system: System, outputs: np.ndarray, noise: str, rng: np.random.Generator) -> np.ndarray:
    """Outputs (outputs, steps) [unit of each] as sensors show them, NaN where a reading is lost.

    Gaussian noise comes first, then rounding, then lost readings, as the description's preset ``noise`` has them.
    """
    shown = outputs.copy()
    for row, output in zip(shown, system.outputs, strict=True):
        sensor = output.noise.get(noise, Noise())
        row += sensor.sd * rng.standard_normal(row.size)
        if sensor.quantum:
            row[:] = np.round(row / sensor.quantum) * sensor.quantum
        row[rng.random(row.size) < sensor.dropout] = np.nan
    return shown


def _still(name: str, described: System) -> list[str]:
    """Inputs that would say when a parameter of an effect acts, and that the description holds at 0."""
    zero = {one.name for one in described.inputs if one.source == "constant" and one.value == 0}
    if any(name in one.parameters for one in described.effects if one.kind == "parameter"):
        return []
    driving = {one.input for one in described.effects if one.kind == "shaped" and name in one.parameters}
    return sorted(driving) if driving <= zero else []


def _meant(name: str, described: System, simulator: Simulator) -> str:
    """Which parameter was meant, of the estimated ones first; empty if none is like it."""
    others = [one for one, variable in simulator.fmu.variables.items() if variable.causality == "parameter"]
    return meant(name, described.parameter_names) or meant(name, others)


def _place(out: Path | str) -> Path:
    """Where the record goes, looked at before long work."""
    path = Path(out)
    if not path.name or path.is_dir():
        raise DatasetError(f"{str(out)!r}: is a folder, or has no name; expected the name of a NetCDF file to write")
    if path.suffix != ".nc":  # a description that was just read has another, and would be lost
        raise DatasetError(f"{path}: ending is {path.suffix!r}; expected .nc")
    check_folder(path.parent, DatasetError)
    return path


def on_the_clock(record: xr.Dataset) -> xr.Dataset:
    """The record of one system with its beginning in its time, as measurements have it."""
    begin = float(record["start"])
    bounds = record["time_bnds"].variable + begin  # a variable: its own times would not match those that it is put to
    moved = record.drop_vars(["start", "time_bnds"])
    moved = moved.assign_coords(time=("time", record["time"].values + begin, STEP_END | CLOCK))
    return moved.assign(time_bnds=bounds)
