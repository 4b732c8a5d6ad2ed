"""``compare``: how far two models of one system are apart, over the time of year and by regime.

The second model is another system description (another FMU), or the recorded trajectories of another tool
(:mod:`datagen.comparing.recorded`). Both get the same parameters, weather and occupancy, to the last bit of the input
table, as far as both have them; what only one has is told. What the first description has under ``[fixed]`` the second
model gets, too, where it has such a parameter and its own ``[fixed]`` does not say otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from datagen.comparing.matching import handed_on, inputs_for, matched, told_apart, unmatched
from datagen.comparing.recorded import HOUR, check_lengths, compared, load_recorded, series_of
from datagen.comparing.regimes import months, regimes
from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import record_start, sample_parameters
from datagen.fmi.checking import all_of, fmu_of, set_faults
from datagen.simulating.simulator import Simulator
from shared.errors import RecordingError, SystemDescriptionError
from shared.logs import logger
from shared.progress import tracked
from shared.results import Result
from shared.system import System, load_system
from shared.variables import Output

_log = logger(__name__)

AFTER = 1e-3
"""How long after a jump its effect is read off [s]: nothing continuous has moved by then."""


@dataclass(frozen=True)
class _Run:
    """One system: ``time`` (steps,), outputs of both models (outputs, steps), masks (steps,) of the regimes."""

    time: np.ndarray
    first: np.ndarray
    second: np.ndarray
    regimes: dict[str, np.ndarray]


@dataclass(frozen=True)
class Row:
    """Differences, second model minus first, over the steps of one cell.

    ``bias``, ``rms``, ``p95`` (95th percentile of the size) and ``largest`` are arrays (outputs,) [unit of each].
    """

    group: str
    cell: str
    steps: int
    bias: np.ndarray
    rms: np.ndarray
    p95: np.ndarray
    largest: np.ndarray


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Trajectories of the same systems from two models.

    Attributes
    ----------
    names
        Of the two models.
    outputs
        The outputs that both have, as the first description declares them.
    systems
        A label for each system.
    time
        Ends of the output steps, shape (systems, steps) [s since time zero].
    first, second
        Shape (systems, outputs, steps) [unit of each].
    cells
        Masks (systems, steps) by (group, cell); the groups are ``month`` and ``regime``.
    notes
        Sentences on parameters and inputs that only one of the models has.
    """

    names: tuple[str, str]
    outputs: list[Output]
    systems: list[str]
    time: np.ndarray
    first: np.ndarray
    second: np.ndarray
    cells: dict[tuple[str, str], np.ndarray]
    notes: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        names = " against ".join(self.names)
        return f"{names}: {len(self.outputs)} outputs of {len(self.systems)} systems"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each output, month, regime and system: steps, and bias, rms, p95 and largest difference [unit]."""
        return pd.DataFrame(self.records()).set_index(["output", "group", "cell"])

    def records(self) -> list[dict[str, Any]]:
        """The same as plain numbers."""
        return [
            {"group": row.group, "cell": row.cell, "output": output.name, "unit": output.unit, "steps": row.steps}
            | {name: float(getattr(row, name)[k]) for name in ("bias", "rms", "p95", "largest")}
            for row in self.rows()
            for k, output in enumerate(self.outputs)
        ]

    @property
    def differences(self) -> np.ndarray:
        """Second minus first, shape (systems, outputs, steps)."""
        return self.second - self.first

    def rows(self) -> list[Row]:
        """The table: everything, each month, each regime, each system; cells without a step are left out."""
        masks = {("all", "all"): np.ones(self.time.shape, dtype=bool), **self.cells}
        for k, label in enumerate(self.systems):
            masks["system", label] = np.zeros(self.time.shape, dtype=bool)
            masks["system", label][k] = True
        return [self._row(*key, mask) for key, mask in masks.items() if mask.any()]

    def _row(self, group: str, cell: str, mask: np.ndarray) -> Row:
        picked = np.moveaxis(self.differences, 1, 0)[:, mask]
        size = np.abs(picked)
        return Row(
            group,
            cell,
            int(mask.sum()),
            bias=picked.mean(axis=1),
            rms=np.sqrt((picked**2).mean(axis=1)),
            p95=np.quantile(size, 0.95, axis=1),
            largest=size.max(axis=1),
        )


def compare(
    first: Path | str | System,
    second: Path | str | System | None = None,
    *,
    recorded: Path | str | None = None,
    data: Path | str | None = None,
    systems: int = 5,
    seed: int | None = None,
    hours: float | None = None,
    step: float | None = None,
    excitation: bool = True,
    quiet: bool = True,
) -> Comparison:
    """Simulate the same systems with two models, or with one against recorded trajectories.

    Parameters
    ----------
    first
        System description. It says what is simulated: parameters, inputs and experiment are drawn from it.
    second
        Description of the other model; its own ranges, weather and occupancy are not used, its ``[fixed]`` is.
    recorded
        In place of ``second``: a TOML that maps the columns of CSV files (:mod:`datagen.comparing.recorded`).
    data
        Folder of those CSV files; by default the TOML's.
    systems
        How many random systems; of recorded ones, at most so many.
    seed
        Root seed of the systems, 0 by default; not with recorded trajectories, which have their own.
    hours, step
        Length [h] and output step [s], by default the first description's; not with recorded trajectories either.
    excitation
        Whether the description's sinusoids act; never against recorded trajectories, unless a column holds them.

    Raises
    ------
    SystemDescriptionError
        If the two do not fit each other.
    RecordingError
        If the recorded trajectories cannot be used.
    SimulationError
        If a simulation did not reach its end.
    """
    system = first if isinstance(first, System) else load_system(first)
    if (second is None) == (recorded is None):
        raise SystemDescriptionError(
            f"{system.path}: is to be compared with {'nothing' if second is None else 'two things'}; "
            "expected a second system description, or recorded trajectories"
        )
    if systems < 1:
        raise SystemDescriptionError(f"systems is {systems}; expected at least 1")
    if recorded is not None:
        settings = {"seed": seed, "hours": hours, "step": step, "excitation": None if excitation else False}
        if meant := [name for name, one in settings.items() if one is not None]:
            raise RecordingError(
                f"{recorded}: {meant[0]} is given; expected none, for recorded trajectories are as they are"
            )
        return _with_recorded(system, Path(recorded), data, systems, quiet)
    assert second is not None
    if data is not None:
        raise SystemDescriptionError(f"data is {str(data)!r} and nothing is recorded; expected both, or neither")
    other = second if isinstance(second, System) else load_system(second)
    return _with_system(system.with_experiment(hours=hours, step=step), other, systems, seed or 0, excitation, quiet)


def _with_system(system: System, other: System, count: int, seed: int, excitation: bool, quiet: bool) -> Comparison:
    outputs, other = matched(system, other)
    simulators = Simulator(system), Simulator(other)
    fixed = handed_on(system, other, (simulators[0].fmu, simulators[1].fmu))
    notes = tuple(unmatched(system, other, simulators[1].fmu))
    for note in notes:
        _log.warning("%s", note)
    experiment = system.experiment
    places = [system.output_names.index(one.name) for one in outputs]
    runs = []
    for index in tracked(range(count), "systems", shown=not quiet):
        values = dict(zip(system.parameter_names, sample_parameters(system, seed, index).tolist(), strict=True))
        begin = record_start(system, seed, index)
        start, stop = begin - experiment.warm_up_hours * HOUR, begin + experiment.hours * HOUR
        table = build_inputs(system, root_seed=seed, index=index, start=start, stop=stop, excitation=excitation)
        span: dict[str, Any] = {"start": start, "stop": stop, "record_from": begin, "step": experiment.step}
        a = simulators[0].run(values, table, **span, tolerance=experiment.tolerance)
        b = simulators[1].run({**fixed, **values}, inputs_for(other, table), **span, tolerance=experiment.tolerance)
        edges = np.append(begin, a.time)
        runs.append(_Run(a.time, a.outputs[places], b.outputs, regimes(system, table, edges, a.outputs)))
    return replace(_assembled(told_apart(system, other), outputs, list(map(str, range(count))), runs), notes=notes)


def _with_recorded(system: System, mapping: Path, data: Path | str | None, count: int, quiet: bool) -> Comparison:
    spec, cases = load_recorded(mapping, system, Path(data) if data is not None else None)
    check_lengths(mapping, spec, cases[:count])
    given = spec.outputs
    changed = [
        one.model_copy(update={"method": given[one.name].method}) if one.name in given else one
        for one in system.outputs
    ]
    if wrong := set_faults("recorded.fixed:", spec.fixed, system, fmu_of(system)):
        raise RecordingError(f"{mapping}: {all_of(wrong)}")
    described = system.model_copy(update={"outputs": changed}).with_known(spec.fixed)
    outputs = [one for one in changed if one.name in given]
    simulator = Simulator(described)
    places = [described.output_names.index(one.name) for one in outputs]
    runs, labels = [], []
    for case in tracked(cases[:count], "recorded systems", shown=not quiet):
        time, measured, table = series_of(spec, case, described)
        rows, keep = compared(spec, time)
        late = AFTER if spec.jumps == "after" else 0.0  # ours are values just before a jump
        begin, step = float(rows[0]) + late, float(rows[-1] - rows[0]) / (len(rows) - 1)
        stop = float(rows[-1]) + late
        a = simulator.run(case.parameters, table, start=float(time[0]), stop=stop, record_from=begin, step=step)
        found = regimes(described, table, rows, a.outputs)
        b = np.stack([measured[one.name][1 : len(rows)] for one in outputs])
        masks = {label: mask[keep] for label, mask in found.items()}
        runs.append(_Run(rows[1:][keep], a.outputs[places][:, keep], b[:, keep], masks))
        labels.append(case.name)
    return _assembled((system.fmu_path.name, mapping.stem), outputs, labels, runs)


def _assembled(names: tuple[str, str], outputs: list[Output], labels: list[str], runs: list[_Run]) -> Comparison:
    time = np.stack([one.time for one in runs])
    cells = {("month", name): mask for name, mask in months(time).items()}
    for label in runs[0].regimes:
        mask = np.stack([one.regimes[label] for one in runs])
        if not mask.all():  # else it is no regime but the whole record
            cells["regime", label] = mask
    first, second = np.stack([one.first for one in runs]), np.stack([one.second for one in runs])
    return Comparison(names, outputs, labels, time, first, second, cells)
