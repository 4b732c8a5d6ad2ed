"""The reachable ceiling of R2: posteriors of random rooms, with the real simulator and the occupancy as it is drawn.

A room, its recording and its window are drawn as the farm draws them. Weather, schedules and excitation are known, also
those of :data:`PAST_HOURS` before the window: what the room did then is simulated along, from the FMU's own start. A
chain visits the posterior (:mod:`datagen.limits.chains`). No estimate has a smaller mean square error than its mean:

    R2 <= 1 - mean over rooms of the posterior variance / prior variance

Readings err independently, as :meth:`shared.system.System.noise_sd` says; none is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from datagen.driving.inputs import build_inputs
from datagen.driving.occupancy import Draw, draw_numbers, occupancy_of, occupancy_prior
from datagen.driving.sampling import record_start, sample_parameters, stream
from datagen.driving.tables import InputTable, Piecewise
from datagen.fmi.fmu import fmu_sha256
from datagen.limits.ceilings import check_conditions
from datagen.limits.chains import HALF, Problem, State, effective, sample
from datagen.limits.pulses import responses
from datagen.limits.sensitivities import HOUR, crowd_inputs, simulator_of
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.drawn import drawn_values
from shared.errors import SystemDescriptionError, ZeroshotError
from shared.manifest import write_atomically
from shared.progress import progress_bar
from shared.reading import read_json, validated
from shared.signals import Occupancy
from shared.system import System

PAST_HOURS = 72.0
"""Simulated before a window, at most: a room forgets its start sooner, and each hour costs all chains its time."""
PULSE = 1200.0
"""Length of an interval of the linearisation in persons at most [s]; the simulator has them at their very times."""
APART = 72 * HOUR
"""Pulses of persons so far apart share a simulation [s]."""
DIFFERENCE = 0.1
"""Half-width of the difference for an unknown, in prior standard deviations."""
TIGHT, LOOSE = 1e-6, 1e-5
"""Tolerances of differences, and of recordings and chains alike: to a tenth of a sensor's noise."""
ENOUGH = 10.0
"""Effective draws of a room, in the harmonic mean: below, chains are so short that more than a tenth is corrected."""


class Room(BaseModel):
    """What a chain says of one room; lists are by parameter, and variances are over the prior's.

    ``of`` is what it was asked, ``variance`` the posterior's, ``linearised`` that of the linearisation, ``error`` the
    square of truth less posterior mean.
    """

    model_config = ConfigDict(extra="forbid")
    of: dict[str, str]
    variance: list[float]
    linearised: list[float]
    error: list[float]
    effective: list[float]
    acceptance: float


class Reachable(BaseModel):
    """The reachable ceiling under one condition; lists are by parameter, and of their mean.

    ``r2`` with its 90 % interval over rooms, None where these have fewer than :data:`ENOUGH` effective draws;
    ``linearised``, of the same rooms and their past; ``scored``, the R2 that the posterior means have; ``effective``,
    effective draws of a room in the harmonic mean, as errors of a variance add up; ``acceptance``, least and most.
    """

    context_hours: float
    noise: str
    channels: list[str]
    parameters: list[str]
    r2: list[float | None]
    low: list[float | None]
    high: list[float | None]
    linearised: list[float]
    scored: list[float]
    effective: list[float]
    acceptance: tuple[float, float]
    rooms: int


def reachable_ceilings(
    system: System,
    folder: Path,
    *,
    contexts: Sequence[float],
    conditions: Sequence[tuple[str, list[str]]],
    systems: int = 10,
    seed: int = 1,
    steps: int = 2000,
    uncertain: bool = False,
    quiet: bool = True,
) -> list[Reachable]:
    """Reachable ceilings for contexts [h] and (noise, channels), from chains of so many steps.

    Each room is kept in ``folder`` as soon as it is done, and one that is there is not computed again.

    Raises
    ------
    SystemDescriptionError
        As :func:`datagen.limits.ceilings.ceilings_of`, and for what no chain can be of.
    ZeroshotError
        If the folder holds rooms of something else, or cannot be written.
    SimulationError
        If a simulation did not reach its end.
    """
    check_conditions(system, contexts, conditions, systems=systems, uncertain=uncertain)
    for _, channels in conditions:
        if counted := sorted(set(channels) & set(crowd_inputs(system))):
            raise SystemDescriptionError(
                f"{system.path}: channels has {counted}, a count of persons; expected outputs alone for --exact: its"
                " chains cannot keep to a count"
            )
    if system.ratios or (system.occupancy is not None and system.occupancy.per):
        raise SystemDescriptionError(
            f"{system.path}: has ratios or an occupancy.density; expected parameters and occupancy that are drawn"
            " independently, or no --exact"
        )
    folder.mkdir(parents=True, exist_ok=True)
    cases = [(context, *condition) for context in contexts for condition in conditions]
    kept: list[list[Room]] = [[] for _ in cases]
    with progress_bar("rooms", systems * len(cases), shown=not quiet) as bar:
        for index in range(systems):
            for rooms, case in zip(kept, cases, strict=True):
                rooms.append(_room(system, folder, *case, seed, index, steps, uncertain))
                bar.update(sum(map(len, kept)))
    return [summarised(system.parameter_names, *case, rooms) for case, rooms in zip(cases, kept, strict=True)]


def summarised(names: list[str], context: float, noise: str, channels: list[str], rooms: Sequence[Room]) -> Reachable:
    """The ceiling that some rooms make."""

    def r2(variances: list[list[float]]) -> np.ndarray:
        each = 1 - np.array(variances)
        return np.concatenate([each, each.mean(axis=1, keepdims=True)], axis=1)

    each = r2([one.variance for one in rooms])
    draws = each[np.random.default_rng(0).integers(len(rooms), size=(1000, len(rooms)))].mean(axis=1)
    usual = 1 / np.mean(1 / np.maximum([one.effective for one in rooms], 1e-9), axis=0)
    usual = np.append(usual, usual.min())

    def where_enough(values: np.ndarray, rooms_needed: int = 1) -> list[float | None]:
        enough = (usual >= ENOUGH) & (len(rooms) >= rooms_needed)
        return [float(value) if good else None for value, good in zip(values, enough, strict=True)]

    return Reachable(
        context_hours=context,
        noise=noise,
        channels=channels,
        parameters=[*names, "mean"],
        r2=where_enough(each.mean(axis=0)),
        low=where_enough(np.percentile(draws, 5, axis=0), 2),
        high=where_enough(np.percentile(draws, 95, axis=0), 2),
        linearised=r2([one.linearised for one in rooms]).mean(axis=0).tolist(),
        scored=r2([one.error for one in rooms]).mean(axis=0).tolist(),
        effective=usual.tolist(),
        acceptance=(min(one.acceptance for one in rooms), max(one.acceptance for one in rooms)),
        rooms=len(rooms),
    )


def _room(
    system: System,
    folder: Path,
    context: float,
    noise: str,
    channels: list[str],
    seed: int,
    index: int,
    steps: int,
    uncertain: bool,
) -> Room:
    """A room that is kept, or is computed and kept now."""
    asked = {
        "system": system.hash(),
        "fmu": fmu_sha256(system.fmu_path),
        "experiment": system.experiment.model_dump_json(),
        "uncertain": "; ".join(one.model_dump_json() for one in system.uncertain) if uncertain else "",
        "condition": f"{context:g} h, {noise}, {' '.join(channels)}, seed {seed}, {steps} steps",
    }
    path = folder / f"{index:04d}-{context:g}h-{noise}-{'+'.join(channels)}.json"
    if path.exists():
        found = validated(Room, read_json(path, ZeroshotError, "a room of --exact"), f"{path}", ZeroshotError, "a room")
        wrong = next((name for name in asked if found.of.get(name) != asked[name]), None)
        if wrong is None:
            return found
        raise ZeroshotError(
            f"{path}: is of {wrong} {found.of.get(wrong, '')!r}, this is of {asked[wrong]!r}; expected another --out"
        )
    problem = recorded(system, context, noise, channels, seed, index, uncertain)
    chain = sample(problem, steps, np.random.default_rng([seed, index]))

    def physical(x: np.ndarray) -> np.ndarray:
        """Parameters (..., parameters) in prior standard deviations of the scale that R2 is of."""
        unit = np.clip(0.5 + x[..., : problem.uniform] / (2 * HALF), 0, 1)
        spread = [np.std(one.from_unit(np.linspace(0, 1, 2001))) for one in system.parameters]
        return np.stack([one.from_unit(unit[..., k]) / spread[k] for k, one in enumerate(system.parameters)], axis=-1)

    visited = physical(chain.x)
    draws = effective(visited)
    more = draws / np.maximum(draws - 1, 0.5)  # about its own mean a chain varies less
    room = Room(
        of=asked,
        variance=(visited.var(axis=0) * more).tolist(),
        linearised=chain.linearised[: problem.uniform].tolist(),
        error=((visited.mean(axis=0) - physical(problem.truth.x)) ** 2).tolist(),
        effective=draws.tolist(),
        acceptance=chain.acceptance,
    )
    write_atomically(path, (room.model_dump_json(indent=1) + "\n").encode())
    return room


def recorded(
    system: System, context: float, noise: str, channels: list[str], seed: int, index: int, uncertain: bool = False
) -> Problem:
    """The recording of a random room and window of ``context`` [h], with the linearisation about its truth."""
    simulator = simulator_of(system)
    step = system.experiment.step
    latest = max(int((system.experiment.hours * HOUR - context * HOUR) // step), 0)
    since = step * int(stream(seed, index, "window").integers(latest + 1))
    begin = record_start(system, seed, index) + since
    stop = begin + context * HOUR
    past = min(PAST_HOURS * HOUR, since + system.experiment.warm_up_hours * HOUR)
    first = begin - step * np.ceil(past / step - 1e-9)
    crowd = crowd_inputs(system)
    spec = system.occupancy if crowd else None
    columns = [system.input_names.index(name) for name in crowd]
    empty = {name: Piecewise.constant(0.0) for name in crowd}
    base = build_inputs(system, root_seed=seed, index=index, start=first, stop=stop, overrides=empty)
    known = constants(system, simulator.fmu) if uncertain else ()
    relative = np.array([one.relative for one in known])
    given, n = drawn_values(simulator, seed, index), len(system.parameters)
    rows = [k for k, name in enumerate(system.output_names) if name in channels]
    sd = system.noise_sd(noise)[rows, None]

    def simulated(x: np.ndarray, table: InputTable, tolerance: float) -> np.ndarray:
        unit = np.clip(0.5 + x[:n] / (2 * HALF), 0.0, 1.0)
        values = {one.name: float(one.from_unit(u)) for one, u in zip(system.parameters, unit, strict=True)}
        values = given | values | values_of(known, np.exp(relative * x[n:]))
        span = {"start": first, "stop": stop, "record_from": begin}
        return simulator.run(values, table, **span, tolerance=tolerance, driven=False).outputs[rows] / sd

    def driven(persons: Draw | None) -> InputTable:
        if persons is None or spec is None:
            return base
        signal = occupancy_of(spec, persons, first, stop)
        table = base.refined(signal.times)
        left, right, jump = table.left.copy(), table.right.copy(), table.jump.copy()
        left[:, columns] = right[:, columns] = signal.at(table.time[:-1])[:, None]
        jump[1:-1] |= (np.diff(left[:, columns], axis=0) != 0).any(axis=1)
        return InputTable(table.names, table.time, left, right, jump)

    def outputs(state: State) -> np.ndarray:
        return simulated(state.x, driven(state.persons), LOOSE).ravel()

    parameters = sample_parameters(system, seed, index)
    unit = [float(one.to_unit(value)) for one, value in zip(system.parameters, parameters, strict=True)]
    x = 2 * HALF * (np.array(unit) - 0.5)
    if known:
        x = np.append(x, np.log(sample_factors(system, seed, index)) / relative)
    truth = State(x, draw_numbers(spec, stream(seed, index, "occupancy"), first, stop) if spec else None)
    table = driven(truth.persons)
    by_unknown = []
    for k in range(len(x)):
        ends = np.tile(x, (2, 1))
        ends[:, k] += DIFFERENCE * np.array([-1.0, 1.0])
        ends[:, :n] = np.clip(ends[:, :n], -HALF, HALF)
        low, high = (simulated(one, table, TIGHT) for one in ends)
        by_unknown.append((high - low).ravel() / (ends[1, k] - ends[0, k]))
    edges, by_person = None, np.zeros((len(by_unknown[0]), 0))
    if spec:
        each = int(np.ceil(step / PULSE - 1e-9))
        edges = first + step / each * np.arange(round((stop - first) / step) * each + 1)
        fine = table.refined(edges)
        by_person = _by_person(lambda table: simulated(x, table, TIGHT), fine, columns, spec, edges, begin)
    noise_free = outputs(truth)
    normal = stream(seed, index, f"reading {noise}").standard_normal(
        (len(system.outputs), len(noise_free) // len(rows))
    )
    readings = noise_free + normal[rows].ravel()
    return Problem(truth, readings, n, outputs, np.stack(by_unknown, axis=1), by_person, spec, edges)


def _by_person(
    simulated: Callable[[InputTable], np.ndarray],
    table: InputTable,
    columns: list[int],
    spec: Occupancy,
    edges: np.ndarray,
    begin: float,
) -> np.ndarray:
    """Derivatives of readings by mean persons over the intervals between edges, shape (readings, intervals)."""
    undisturbed = simulated(table)
    step = (edges[-1] - begin) / undisturbed.shape[1]
    draws = occupancy_prior(spec, edges, 300, 0)
    height = max(1.0, float(draws.max()) / 6)  # a fraction of a full room: more than the solver's error

    def response(pulses: Sequence[tuple[float, float]]) -> np.ndarray:
        more = table
        for column in columns:
            for a, b in pulses:
                more = more.with_pulse(column, a, b, height)
        return (simulated(more) - undisturbed) / height

    some = np.flatnonzero(np.ptp(draws, axis=0) > 0)
    spans = list(pairwise(edges.tolist()))
    found = np.zeros((undisturbed.size, len(spans)))
    if some.size:
        time = begin + step * np.arange(1, undisturbed.shape[1] + 1)
        each = responses(response, [spans[k] for k in some], time, apart=APART)
        found[:, some] = each.reshape(undisturbed.size, -1)
    return found
