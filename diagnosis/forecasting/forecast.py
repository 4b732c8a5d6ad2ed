"""``forecast``: a recording's first days tell the parameters, and the model goes on with them (Figure 3 of the paper).

The bands are simulations with parameters and nuisance drawn from the posterior of the context, plus measurement noise.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import calibrate
from diagnosis.calibrating.checks import check_recording, taken
from diagnosis.calibrating.schema import Calibration, read_calibration
from diagnosis.calibrating.seen import check_unseen
from diagnosis.fitting.drive import LOST, driving
from diagnosis.fitting.noise import errors_under
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.renewing import renewed
from diagnosis.fitting.side_by_side import side_by_side
from diagnosis.forecasting.forecasted import Ahead, Forecast, Forecasted, about_failed
from diagnosis.forecasting.given import check_constants, check_given, noise_of
from diagnosis.forecasting.persons import corrected, from_the_prior
from diagnosis.intervals import LEVEL
from diagnosis.recording import HOUR, Recording, check_warm_up
from diagnosis.scores import score
from diagnosis.usual import STARTS, WARM_UP
from shared.errors import RecordingError, SimulationError
from shared.places import check_folder
from shared.stretches import Stretch
from shared.system import System, load_system

_log = logging.getLogger(__name__)
DRAWS = 40


def forecast(
    system: System | Path | str,
    recording: Recording | Path | str,
    *,
    context: float = 168.0,
    ahead: float = 336.0,
    run: Path | str | None = None,
    calibration: Calibration | Path | str | None = None,
    out: Path | str | None = None,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
    noise: str | None = None,
    draws: int = DRAWS,
    starts: int | None = None,
    warm_up: float = WARM_UP,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Forecasted:
    """Calibrate on the first ``context`` hours of a recording and simulate the next ``ahead`` hours.

    Ahead, the recording's inputs drive the model, with ``replay`` also what was read of actuators; other outputs are
    only compared with. What is not listed here is as in :func:`diagnosis.calibrating.calibration.calibrate`.

    Parameters
    ----------
    run, starts, noise
        Of the calibration on the context: folder of an estimator for the first guess, starts in all, and a noise preset
        of the description (``sensor`` if not given).
    calibration
        A calibration made before, in place of that one; its noise is the forecast's.
    stretch
        Which stretch without gaps of a recording's inputs is taken; the longest, if not given.
    draws
        Simulations behind the bands.
    out
        Folder for ``forecast.json`` and ``forecast.html``, written when all is done.
    tell
        Is told when what was given is found in order, and simulations begin.

    Raises
    ------
    RecordingError
        If a calibration is given together with what only one on the context takes; if the recording ends before the
        forecast does, or cannot be calibrated on; if the given calibration has seen what is to be forecast; if an
        actuator to be replayed was not read there; if the folder cannot be written to.
    """
    for name, hours in (("context", context), ("ahead", ahead)):
        if not hours > 0:
            raise RecordingError(f"{name} is {hours:g} h; expected more than 0")
    if out is not None:
        check_folder(Path(out), RecordingError)
    given = None
    if calibration is not None:
        beside = (("run", run), ("starts", starts), ("noise", noise))
        if idle := [name for name, one in beside if one is not None]:
            raise RecordingError(
                f"calibration is given, and {' and '.join(idle)} beside it; expected one of both: nothing is fitted"
                " where parameters and noise are those of a calibration made before"
            )
        given = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    described = system if isinstance(system, System) else load_system(system)
    preset = "sensor" if noise is None else noise
    errors_under(described, preset)  # whatever is wrong is said before the simulator is built
    record = taken(described, recording, replay=replay, occupancy=occupancy, stretch=stretch)
    split, end = (_steps(record, hours) for hours in (context, context + ahead))
    if end > len(record.time):
        raise RecordingError(_too_short(record, context, ahead))
    whole_record, first = _part(record, end), _part(record, split)
    check_recording(first, described)
    check_warm_up(record, warm_up * HOUR)
    if replay:
        check_driven(described, whole_record, split)
    described = described.with_experiment(step=record.step, hours=context + ahead)
    common = {"replay": replay, "occupancy": occupancy, "warm_up": warm_up}
    if given is None:
        done = calibrate(
            described.with_experiment(hours=context),
            first,
            run=run,
            noise=preset,
            starts=STARTS if starts is None else starts,
            seed=seed,
            workers=workers,
            scheduler=scheduler,
            tell=tell,
            **common,  # type: ignore[arg-type]
        )
        report, noise_model = done.report, done.problem.noise
    else:
        report = given
        check_given(report, calibration, described, replay=replay)
        check_unseen(report, record, described.output_names, split, end)
        noise_model = noise_of(report, described)
    z, covariance = np.array(report.z), np.array(report.covariance)
    simulator = Simulator(described)
    with side_by_side(simulator, workers=workers, scheduler=scheduler) as runner:
        problem = Problem(
            simulator, whole_record, noise=noise_model, replay=replay, occupancy=occupancy, warm_up=warm_up * HOUR,
            runner=runner,
        )  # fmt: skip
        if len(z) != problem.size:
            raise RecordingError(
                f"{calibration}: was made with persons {report.occupancy} and {len(report.constants)} uncertain"
                f" constants, which makes {len(z)} unknowns; the forecast has {problem.size}, with persons"
                f" {problem.occupancy} and {len(problem.constants)} constants: give both the same occupancy and system"
            )
        check_constants(report, problem, z)
        tell("simulating")
        seen = np.zeros(problem.observed.shape, dtype=bool)
        seen[:, :split] = True
        centre, made = _ensemble(problem.with_observed(seen), z, covariance, draws, seed)
    if len(made) < draws:
        _log.warning("%s: %s", record.path, about_failed(len(made), draws - len(made)))
    low, high = band(made)
    outputs: dict[str, Ahead | None] = {}
    for k, output in enumerate(described.outputs):
        found = whole_record.outputs[k, split:]
        inside = np.isfinite(found)
        outputs[output.name] = None
        if inside.any() and output.name not in problem.drive.replayed:
            covered = (found >= low[k, split:]) & (found <= high[k, split:])
            scores = score(found, centre[k, split:], output.unit)
            outputs[output.name] = Ahead(**scores.model_dump(), covered=float(covered[inside].mean()))
    answer = Forecasted(
        Forecast(
            system=described.name,
            recording=str(record.path),
            begin=record.began,
            context_hours=context,
            ahead_hours=ahead,
            level=LEVEL,
            draws=len(made),
            failed=draws - len(made),
            occupancy=problem.occupancy,
            calibration=report,
            outputs=outputs,
        ),
        described,
        problem.time,
        whole_record.outputs,
        centre,
        low,
        high,
        split,
        given=given is not None,
    )
    if out is not None:
        from diagnosis.forecasting.report import write_forecast

        write_forecast(answer, Path(out))
    return answer


def _too_short(record: Recording, context: float, ahead: float) -> str:
    """That a recording ends before the forecast does, and what fits: two thirds of what it has, in whole days."""
    hours = len(record.time) * record.step / HOUR
    known = max(24.0, 24.0 * (2 * hours // (3 * 24)))
    fits = f"; --context {known:g} --ahead {hours - known:g} would fit" if hours - known >= record.step / HOUR else ""
    return (
        f"{record.path}: what is taken of it, from {record.began}, is {hours:g} h long; expected at least"
        f" {context + ahead:g} h: --context of {context:g} h and the inputs of --ahead {ahead:g} h{fits}"
    )


def check_driven(system: System, record: Recording, split: int) -> None:
    """Refuse to replay an output of which too much was not read from step ``split`` of a recording on.

    Raises
    ------
    RecordingError
        Naming the output.
    """
    for name in driving(system, record):
        found = np.isfinite(record.outputs[system.output_names.index(name), split:])
        if found.mean() < 1 - LOST:
            raise RecordingError(
                f"{record.path}: {name!r} was read in {found.mean():.0%} of the hours ahead; expected at least"
                f" {1 - LOST:.0%}, as it drives the model: forecast with simulated controllers, without replay"
            )


def _steps(record: Recording, hours: float) -> int:
    """Steps of a recording in so many hours, one at least."""
    if not record.step / HOUR <= hours < np.inf:
        raise RecordingError(
            f"{record.path}: {hours:g} h are asked for; expected a step of it at least, {record.step / HOUR:g} h"
        )
    steps = hours * HOUR / record.step
    if abs(steps - round(steps)) > 1e-6:
        raise RecordingError(
            f"{record.path}: is in steps of {record.step / HOUR:g} h, which do not divide {hours:g} h; expected"
            " a context and a time ahead of whole steps"
        )
    return round(steps)


def band(draws: np.ndarray, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the interval that holds a further draw with probability ``level``, from draws (draws, ...).

    A further draw lies below the k-th smallest of n with probability k / (n + 1) (Weibull's plotting position); the
    usual interpolation, k / (n - 1), would make the band of 20 draws one of 81 %. What so few draws cannot tell (below
    2 / (n + 1) outside) ends at the outermost ones.
    """
    low, high = np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=0, method="weibull")
    return low, high


def _part(record: Recording, steps: int) -> Recording:
    """The first steps of a recording."""
    inputs = {name: values[:steps] for name, values in record.inputs.items()}
    return replace(record, time=record.time[:steps], outputs=record.outputs[:, :steps], inputs=inputs)


def _ensemble(
    problem: Problem, z: np.ndarray, covariance: np.ndarray, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """The most likely outputs (outputs, steps), and draws with noise (draws, outputs, steps) [unit of each].

    Draws that cannot be simulated are left out.
    """
    around = renewed(problem, z, problem.linearise(z))
    centre = problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
    rng = np.random.default_rng(seed)
    low, high = problem.bounds
    factor = np.linalg.cholesky(covariance)
    made = []
    for unread in from_the_prior(problem, draws, rng):
        drawn = np.clip(z + factor @ rng.standard_normal(len(z)), low, high)
        try:
            nuisance = corrected(unread, problem.likely_nuisance(drawn, around), around.marginal, rng)
            outputs = problem.simulate(drawn, problem.nuisance.heights(nuisance))
        except SimulationError:
            continue
        made.append(outputs + problem.noise.draw(rng, problem.time))
    if len(made) < draws / 2:
        raise SimulationError(f"{draws - len(made)} of {draws} draws from the posterior could not be simulated")
    return centre, np.stack(made)
