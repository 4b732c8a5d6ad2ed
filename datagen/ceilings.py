"""What a recording can tell at all: the linearised Bayesian limit of R2 for each parameter.

For a random system and a random window, outputs depend on the parameters, on the unknown state at the window's start
and on the unknown occupancy. Linearised about the truth, and with Gaussian priors of the same mean and covariance as
the real ones, the posterior of the parameters is Gaussian, and no estimator of any kind has a smaller mean square
error. With parameters standardised by their prior,

    S = H C H' + X P X' + R,   posterior covariance = (I + J' S^-1 J)^-1,   R2 <= 1 - posterior variance,

J: outputs by parameters, X: by initial states (prior P), H: by occupancy (prior covariance C of its means over
:data:`PULSE`, from the sampler), R: sensor noise with the numerical floor. All derivatives are central differences of
whole simulations, so saturation and events are in them. Weather, schedules and excitation are taken as known. Where an
occupancy input is among the channels persons are known as means over the steps, as they are recorded, and C is what
that leaves: when within a step they came.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from datagen.inputs import build_inputs
from datagen.occupancy import occupancy_prior
from datagen.package import weather_hashes
from datagen.pulses import responses
from datagen.sampling import record_start, sample_parameters, stream
from datagen.simulator import Simulator
from datagen.tables import InputTable
from shared.ceiling import Ceiling, Origin
from shared.errors import SystemDescriptionError
from shared.interrupts import interrupts_held
from shared.progress import progress_bar
from shared.store import sha256_of
from shared.system import System, load_system

HOUR = 3600.0
PULSE = 600.0
"""Length of an occupancy pulse at most [s]: people come and go within the hour, and nobody knows when. Half-hours
would pass for known within: with 1800 here a day of clean readings has a mean R2 of 0.80, with 600 of 0.75, with 300 of
0.74 (the default system, two sensors, three rooms, seed 1)."""
SPIN_UP_HOURS = 240.0
PARAMETER_STEP = 0.02
"""Half-width of a parameter's difference, in prior standard deviations."""
STATE_STEP = 0.02
PRIOR_DRAWS, DRAWS_EACH = 4000, 5
"""Of the occupancy: at least, and for each pulse, lest its covariance lack directions that nobody happened to take."""
TOLERANCE = 1e-8
"""Tighter than the farm's: differences of simulations are small."""


@dataclass(frozen=True)
class Window:
    """Sensitivities of one random window.

    ``parameters`` (outputs, steps, parameters) per prior standard deviation; ``states`` (outputs, steps, states)
    [unit of output per unit of state]; ``occupancy`` (outputs, steps, pulses) per person; ``occupancy_covariance``
    (pulses, pulses) [persons^2]; ``occupancy_steps`` (pulses,), the step that each pulse lies in; ``visited`` (steps,
    states), states met on the way, for the prior of the start.
    """

    parameters: np.ndarray
    states: np.ndarray
    occupancy: np.ndarray
    occupancy_covariance: np.ndarray
    occupancy_steps: np.ndarray
    visited: np.ndarray


def identifiability(
    system: System | Path | str,
    *,
    context: float = 168.0,
    noise: str = "none",
    channels: list[str] | None = None,
    systems: int = 10,
    seed: int = 1,
    workers: int = 1,
) -> Ceiling:
    """The ceiling of R2 for one context length [h], noise preset and set of channels, over random systems.

    Windows are of records as the description's experiment has them: of its start and hours.
    """
    return ceilings_of(
        system, contexts=[context], conditions=[(noise, channels)], systems=systems, seed=seed, workers=workers
    )[0]


def ceilings_of(
    system: System | Path | str,
    *,
    contexts: Iterable[float],
    conditions: Iterable[tuple[str, list[str] | None]],
    systems: int = 10,
    seed: int = 1,
    workers: int = 1,
    quiet: bool = True,
) -> list[Ceiling]:
    """Ceilings for several contexts [h] and several (noise, channels) at little more than the cost of one.

    Raises
    ------
    SystemDescriptionError
        For an unknown noise preset, an unknown channel, or channels without any output.
    WeatherError
        If a weather file cannot be read.
    """
    described = system if isinstance(system, System) else load_system(system)
    wanted = [(noise, channels or described.estimator.channels) for noise, channels in conditions]
    for noise, channels in wanted:
        described.noise_sd(noise)
        known = [*described.output_names, *described.input_names]
        if unknown := [name for name in channels if name not in known]:
            raise SystemDescriptionError(
                f"{described.path}: channels {unknown} are neither outputs nor inputs; expected some of {known}"
            )
        if not set(channels) & set(described.output_names):
            raise SystemDescriptionError(f"{described.path}: channels {channels} hold no output; nothing to learn from")
    results, lengths, weather = [], list(contexts), weather_hashes(described)
    with progress_bar("windows", systems * len(lengths), shown=not quiet) as bar:
        for count, context in enumerate(lengths):
            windows = []
            for window in _windows(described, context, systems, seed, workers):
                windows.append(window)
                bar.update(count * systems + len(windows), note=f"{context:g} h")
            visited = np.concatenate([w.visited for w in windows])
            start = (visited - visited.mean(axis=0)).T @ (visited - visited.mean(axis=0)) / len(visited)
            experiment = described.experiment
            # a window that is longer than a record is a record of its own
            origin = Origin(start=experiment.start, hours=max(experiment.hours, context), weather=weather)
            for noise, channels in wanted:
                variances = np.array([posterior_variance(described, w, start, noise, channels) for w in windows])
                results.append(_summarise(described, variances, context, noise, channels, seed, origin))
    return results


def posterior_variance(
    system: System, window: Window, state_covariance: np.ndarray, noise: str, channels: list[str]
) -> np.ndarray:
    """Posterior variance of each standardised parameter, shape (parameters,); 1 is the prior.

    ``state_covariance`` (states, states) is the prior of the start. Persons are unknown unless one of the channels
    counts them: then they are known as means over the steps.
    """
    rows = [k for k, name in enumerate(system.output_names) if name in channels]
    sd = system.noise_sd(noise)[rows]

    def flat(sensitivity: np.ndarray) -> np.ndarray:
        return (sensitivity[rows] / sd[:, None, None]).reshape(-1, sensitivity.shape[2])

    by_parameter = flat(window.parameters)
    by_state = flat(window.states)
    covariance = np.eye(len(by_parameter)) + by_state @ state_covariance @ by_state.T
    if window.occupancy.shape[2]:
        persons = window.occupancy_covariance
        if set(channels) & set(crowd_inputs(system)):
            persons = given_means(persons, window.occupancy_steps)
        by_occupancy = flat(window.occupancy)
        covariance += by_occupancy @ persons @ by_occupancy.T
    information = by_parameter.T @ cho_solve(cho_factor(covariance, lower=True), by_parameter)
    return np.diag(np.linalg.inv(np.eye(len(information)) + information))


def given_means(covariance: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Covariance of pulses (pulses, pulses) where their means over the steps that they lie in (pulses,) are known.

    A Gaussian's conditional covariance: C - C A' (A C A')^-1 A C, A: means of steps by pulses.
    """
    found, place, count = np.unique(steps, return_inverse=True, return_counts=True)
    if count.max() == 1:
        return np.zeros_like(covariance)
    means = (place == np.arange(len(found))[:, None]) / count[:, None]
    across = covariance @ means.T
    return np.asarray(covariance - across @ np.linalg.pinv(means @ across, rcond=1e-10, hermitian=True) @ across.T)


def crowd_inputs(system: System) -> list[str]:
    """Names of the inputs that are the number of persons: one crowd, however many read it."""
    return [one.name for one in system.inputs if one.source == "occupancy"]


def _summarise(
    system: System, variances: np.ndarray, context: float, noise: str, channels: list[str], seed: int, origin: Origin
) -> Ceiling:
    r2 = 1 - variances.mean(axis=0)
    rng = np.random.default_rng(0)
    draws = rng.integers(len(variances), size=(1000, len(variances)))
    low, high = np.percentile(1 - variances.mean(axis=1)[draws].mean(axis=1), [5, 95])
    return Ceiling(
        context_hours=context,
        step=system.experiment.step,
        noise=noise,
        channels=channels,
        r2=dict(zip(system.parameter_names, r2.tolist(), strict=True)),
        r2_mean=float(r2.mean()),
        r2_mean_low=float(low),
        r2_mean_high=float(high),
        systems=len(variances),
        seed=seed,
        origin=origin,
    )


def _windows(system: System, context: float, systems: int, seed: int, workers: int) -> Iterator[Window]:
    jobs = [(system, context, seed, index) for index in range(systems)]
    if workers <= 1:
        yield from (_window(*job) for job in jobs)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        with interrupts_held():
            found = pool.map(_window, *zip(*jobs, strict=True))
        yield from found


_SIMULATORS: dict[str, Simulator] = {}


def _window(system: System, context: float, seed: int, index: int) -> Window:
    """Sensitivities of a random window of a random system, from its record as the farm makes it."""
    key = f"{system.canonical()} {system.fmu_path} {sha256_of(system.fmu_path)}"
    if key not in _SIMULATORS:
        _SIMULATORS[key] = Simulator(system)
    simulator = _SIMULATORS[key]
    step = system.experiment.step
    span = context * HOUR
    latest = max(int((system.experiment.hours * HOUR - span) // step), 0)
    begin = record_start(system, seed, index) + step * int(stream(seed, index, "window").integers(latest + 1))
    theta = sample_parameters(system, seed, index)
    scale = np.array([float(np.std(p.from_unit(np.linspace(0, 1, 2001)))) for p in system.parameters])
    spin_up = SPIN_UP_HOURS * HOUR
    table = build_inputs(system, root_seed=seed, index=index, start=begin - spin_up, stop=begin + span)
    names = system.parameter_names
    warm = simulator.run(
        dict(zip(names, theta.tolist(), strict=True)), table, start=begin - spin_up, stop=begin, record_states=True
    )
    start_states = warm.states[-1]
    spread = warm.states.std(axis=0)
    each = int(np.ceil(step / PULSE - 1e-9))
    edges = begin + step / each * np.arange(round(span / step) * each + 1)
    fine = table.restricted(begin, begin + span).refined(edges)

    def outputs(values: np.ndarray, states: np.ndarray, inputs: InputTable) -> np.ndarray:
        return simulator.run(
            dict(zip(names, values.tolist(), strict=True)),
            inputs,
            start=begin,
            stop=begin + span,
            tolerance=TOLERANCE,
            initial_states=states,
        ).outputs

    def difference(up: np.ndarray, down: np.ndarray, width: float) -> np.ndarray:
        return (up - down) / width

    by_parameter, by_state = [], []
    for k in range(len(theta)):
        move = np.zeros_like(theta)
        move[k] = PARAMETER_STEP * scale[k]
        pair = [outputs(theta + sign * move, start_states, fine) for sign in (1, -1)]
        by_parameter.append(difference(pair[0], pair[1], 2 * PARAMETER_STEP))
    for k in range(len(start_states)):
        move = np.zeros_like(start_states)
        move[k] = max(STATE_STEP * spread[k], 1e-9 * abs(start_states[k]), 1e-12)
        pair = [outputs(theta, start_states + sign * move, fine) for sign in (1, -1)]
        by_state.append(difference(pair[0], pair[1], 2 * move[k]))
    shape = (len(system.outputs), round(span / step), 0)
    by_pulse, covariance, within = np.empty(shape), np.empty((0, 0)), np.empty(0, dtype=int)
    crowd = [system.input_names.index(name) for name in crowd_inputs(system)]
    if crowd and system.occupancy is not None:
        base = outputs(theta, start_states, fine)

        def response(pulses: Sequence[tuple[float, float]]) -> np.ndarray:
            more = fine
            for column in crowd:
                for a, b in pulses:
                    more = more.with_pulse(column, a, b, 1.0)
            return outputs(theta, start_states, more) - base

        draws = occupancy_prior(system.occupancy, edges, max(PRIOR_DRAWS, DRAWS_EACH * (len(edges) - 1)), seed)
        some = np.flatnonzero(np.ptp(draws, axis=0) > 0)  # nobody comes at night
        covariance, within = np.atleast_2d(np.cov(draws[:, some], rowvar=False)), some // each
        pulses = list(pairwise(edges))
        by_pulse = responses(response, [pulses[k] for k in some], begin + step * np.arange(1, shape[1] + 1))
    return Window(
        parameters=np.stack(by_parameter, axis=-1),
        states=np.stack(by_state, axis=-1) if by_state else np.empty(shape),
        occupancy=by_pulse,
        occupancy_covariance=covariance,
        occupancy_steps=within,
        visited=warm.states,
    )
