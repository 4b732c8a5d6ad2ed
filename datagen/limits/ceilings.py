"""What a recording can tell at all: the linearised Bayesian limit of R2 for each parameter.

For a random system and a random window, outputs depend on the parameters, on the unknown state at the window's start
and on the unknown occupancy. Linearised about the truth, and with Gaussian priors of the same mean and covariance as
the real ones, the posterior of the parameters is Gaussian, and no estimator of any kind has a smaller mean square
error. With parameters standardised by their prior,

    S = H C H' + X P X' + K K' + R,   posterior covariance = (I + J' S^-1 J)^-1,   R2 <= 1 - posterior variance,

J: outputs by parameters, X: by initial states (prior P), H: by occupancy (prior covariance C of its means over
:data:`datagen.limits.sensitivities.PULSE`, from the sampler), K: by the logarithms of the uncertain constants' factors,
per prior standard deviation of each, R: sensor noise with the numerical floor. Weather, schedules and excitation are
taken as known, and so are the constants, as declared, unless they are asked for as uncertain: then each system has its
own, as the farm draws them. Where an occupancy input is among the channels persons are known as means over the steps,
as they are recorded, and C is what that leaves: when within a step they came.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np

from datagen.farming.package import weather_hashes
from datagen.limits.sensitivities import HOUR, Window, crowd_inputs, random_window
from shared.ceiling import Ceiling, Origin, Unknown, unknown_constants
from shared.children import starting, worker_pool
from shared.errors import SimulationError, SystemDescriptionError
from shared.progress import progress_bar
from shared.system import WHOLE, System, load_system


def identifiability(
    system: System | Path | str,
    *,
    context: float = 168.0,
    noise: str = "none",
    channels: list[str] | None = None,
    systems: int = 10,
    seed: int = 1,
    workers: int = 1,
    uncertain: bool = False,
) -> Ceiling:
    """The ceiling of R2 for one context length [h], noise preset and set of channels, over random systems.

    Windows are of records as the description's experiment has them: of its start and hours. Where ``uncertain`` is set
    the description's uncertain constants are drawn for each system, and nobody knows them.
    """
    return ceilings_of(
        system,
        contexts=[context],
        conditions=[(noise, channels)],
        systems=systems,
        seed=seed,
        workers=workers,
        uncertain=uncertain,
    )[0]


def ceilings_of(
    system: System | Path | str,
    *,
    contexts: Iterable[float],
    conditions: Iterable[tuple[str, list[str] | None]],
    systems: int = 10,
    seed: int = 1,
    workers: int = 1,
    uncertain: bool = False,
    quiet: bool = True,
) -> list[Ceiling]:
    """Ceilings for several contexts [h] and several (noise, channels) at little more than the cost of one.

    Raises
    ------
    SystemDescriptionError
        For no context or one that is no positive number of whole steps, no system, an unknown noise preset, an unknown
        channel, channels without any output, or constants that are to be uncertain where the description declares none.
    WeatherError
        If a weather file cannot be read.
    SimulationError
        If a simulation did not reach its end, or took its process down.
    """
    described = system if isinstance(system, System) else load_system(system)
    lengths = list(contexts)
    wanted = [(noise, described.estimator.channels if channels is None else channels) for noise, channels in conditions]
    check_conditions(described, lengths, wanted, systems=systems, uncertain=uncertain)
    results, weather = [], weather_hashes(described)
    constants = unknown_constants(described.uncertain if uncertain else [])
    with progress_bar("windows", systems * len(lengths), shown=not quiet) as bar:
        for count, context in enumerate(lengths):
            windows = []
            for window in _windows(described, context, systems, seed, workers, uncertain):
                windows.append(window)
                bar.update(count * systems + len(windows), note=f"{context:g} h")
            visited = np.concatenate([w.visited for w in windows])
            moved = visited - visited.sum(axis=0) / max(len(visited), 1)  # none where all begin as the FMU does
            start = moved.T @ moved / max(len(visited), 1)
            experiment = described.experiment
            # a window that is longer than a record is a record of its own
            origin = Origin.of(experiment.model_copy(update={"hours": max(experiment.hours, context)}), weather=weather)
            for noise, channels in wanted:
                variances = np.array([posterior_variance(described, w, start, noise, channels) for w in windows])
                results.append(_summarise(described, variances, context, noise, channels, seed, origin, constants))
    return results


def check_conditions(
    system: System,
    contexts: Sequence[float],
    conditions: Sequence[tuple[str, list[str]]],
    *,
    systems: int,
    uncertain: bool,
) -> None:
    """Refuse what no ceiling can be of, before anything is simulated.

    Raises
    ------
    SystemDescriptionError
        As :func:`ceilings_of`.
    """
    if uncertain and not system.uncertain:
        raise SystemDescriptionError(
            f"uncertain is set; expected an [[uncertain]] table in {system.path}, which has none"
        )
    if systems < 1:
        raise SystemDescriptionError(f"systems is {systems}; expected at least 1")
    _check_lengths(contexts, system.experiment.step)
    if not conditions:
        raise SystemDescriptionError("noise or channels are empty; expected at least one preset and one set of outputs")
    for noise, channels in conditions:
        system.noise_sd(noise)
        known = [*system.output_names, *system.input_names]
        if unknown := [name for name in channels if name not in known]:
            raise SystemDescriptionError(
                f"{system.path}: channels {unknown} are neither outputs nor inputs; expected some of {known}"
            )
        if not set(channels) & set(system.output_names):
            raise SystemDescriptionError(f"{system.path}: channels {channels} hold no output; nothing to learn from")


def posterior_variance(
    system: System, window: Window, state_covariance: np.ndarray, noise: str, channels: list[str]
) -> np.ndarray:
    """Posterior variance of each standardised parameter, shape (parameters,); 1 is the prior."""
    told = information(system, window, state_covariance, noise, channels)
    return np.diag(np.linalg.inv(np.eye(len(told)) + told))


def information(
    system: System, window: Window, state_covariance: np.ndarray, noise: str, channels: list[str]
) -> np.ndarray:
    """What a window tells of the standardised parameters beside their prior, shape (parameters, parameters).

    ``state_covariance`` (states, states) is the prior of the start. Persons are unknown unless one of the channels
    counts them: then they are known as means over the steps.
    """
    from scipy.linalg import cho_factor, cho_solve  # what is refused need not wait for it

    rows = [k for k, name in enumerate(system.output_names) if name in channels]
    sd = system.noise_sd(noise)[rows]

    def flat(sensitivity: np.ndarray) -> np.ndarray:
        _, steps, unknowns = sensitivity.shape  # there may be none: -1 would not do
        return (sensitivity[rows] / sd[:, None, None]).reshape(len(rows) * steps, unknowns)

    by_parameter = flat(window.parameters)
    by_state = flat(window.states)
    by_constant = flat(window.constants)
    covariance = np.eye(len(by_parameter)) + by_state @ state_covariance @ by_state.T + by_constant @ by_constant.T
    if window.occupancy.shape[2]:
        persons = window.occupancy_covariance
        if set(channels) & set(crowd_inputs(system)):
            persons = given_means(persons, window.occupancy_steps)
        by_occupancy = flat(window.occupancy)
        covariance += by_occupancy @ persons @ by_occupancy.T
    return np.asarray(by_parameter.T @ cho_solve(cho_factor(covariance, lower=True), by_parameter))


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


def _check_lengths(lengths: Sequence[float], step: float) -> None:
    """Refuse lengths [h] that are no window in steps [s]."""
    if not lengths:
        raise SystemDescriptionError("context is empty; expected at least one length [h]")
    for hours in lengths:
        steps = hours * HOUR / step
        if not 0.5 < steps < float("inf") or abs(steps - round(steps)) > WHOLE:  # of a NaN no comparison holds
            raise SystemDescriptionError(
                f"context is {hours:g} h; expected a positive number of whole output steps, which are {step:g} s"
            )


def _summarise(
    system: System,
    variances: np.ndarray,
    context: float,
    noise: str,
    channels: list[str],
    seed: int,
    origin: Origin,
    constants: dict[str, Unknown],
) -> Ceiling:
    r2 = 1 - variances.mean(axis=0)
    low = high = None
    if len(variances) > 1:  # one system drawn again and again would tell of an interval without width
        rng = np.random.default_rng(0)
        draws = rng.integers(len(variances), size=(1000, len(variances)))
        low, high = map(float, np.percentile(1 - variances.mean(axis=1)[draws].mean(axis=1), [5, 95]))
    return Ceiling(
        context_hours=context,
        step=system.experiment.step,
        noise=noise,
        channels=channels,
        r2=dict(zip(system.parameter_names, r2.tolist(), strict=True)),
        r2_mean=float(r2.mean()),
        r2_mean_low=low,
        r2_mean_high=high,
        systems=len(variances),
        seed=seed,
        origin=origin,
        constants=constants,
    )


def _windows(
    system: System, context: float, systems: int, seed: int, workers: int, uncertain: bool
) -> Iterator[Window]:
    jobs = [(system, context, seed, index, uncertain) for index in range(systems)]
    if workers <= 1:
        yield from (random_window(*job) for job in jobs)
        return
    try:
        with worker_pool(workers) as pool:
            with starting():
                found = pool.map(random_window, *zip(*jobs, strict=True))
            yield from found
    except BrokenProcessPool:
        raise SimulationError(
            f"{system.fmu_path}: took a process down that simulated windows of {context:g} h, or memory ran out;"
            " expected an FMU that bears every parameter within its range, or fewer workers"
        ) from None
