"""``forecast``: a recording's first days tell the parameters, and the model goes on with them (Figure 3 of the paper).

The bands are simulations with parameters and nuisance drawn from the posterior of the context, plus measurement noise.

Draws of what is not known about the inputs, for bands of a forecast.

Given the readings the nuisance is taken to be normal. Persons whom nobody counted are not: most hours of a night have
none. Drawn normally, and never fewer than none, they would be too many in hours to come, of which no reading tells. So
draws begin with courses of the description's own random occupancy, and each is corrected by what the readings say: with
``r`` the standardised residual at the prior mean, ``B`` the outputs by the unknowns, ``K`` the mean of the unknowns
given a residual, ``u`` a draw from the prior and ``e`` one of the errors,

    u + K (r - B u - e),

which has the posterior's mean and covariance where ``u`` has the prior's (conditioning by kriging; Chiles and Delfiner,
Geostatistics, section 7.3), and leaves hours that no reading tells of as they were drawn.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import calibrate, taken
from diagnosis.calibrating.given import check_given, check_unknowns, given_calibration, noise_of
from diagnosis.calibrating.schema import Calibration, check_unseen
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import root
from diagnosis.fitting.inputs import LOST, courses, driving
from diagnosis.fitting.likely import most_likely
from diagnosis.fitting.linear import Marginal
from diagnosis.fitting.noise import errors_under
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import check_command, side_by_side, simulations
from diagnosis.forecasting.forecasted import Ahead, Forecast, Forecasted, about_failed
from diagnosis.physics import check_physics, check_recording
from diagnosis.recording import HOUR, Recording, check_warm_up
from diagnosis.scores import score
from diagnosis.usual import LEVEL, STARTS, WARM_UP
from diagnosis.zero_shot import check_estimator
from shared.errors import RecordingError, SimulationError, TimeUp
from shared.logs import logger
from shared.stretches import Stretch
from shared.system import System, load_system

_log = logger(__name__)


def from_the_prior(problem: Problem, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Standard normal unknowns of the nuisance, shape (draws, unknowns).

    Those of persons whom nobody counted are such that their heights are a course of the description's.
    """
    nuisance = problem.nuisance
    found = rng.standard_normal((draws, nuisance.factor.shape[1]))
    for level in nuisance.levels:
        rows = nuisance.column == level.column
        columns = np.abs(nuisance.factor[rows]).any(axis=0)
        drawn = courses(problem.system, problem.drive).heights[:, : rows.sum()]  # those in the recording come first
        some = drawn[rng.integers(len(drawn), size=draws)] - nuisance.mean[rows]
        found[:, columns] = np.linalg.lstsq(nuisance.factor[np.ix_(rows, columns)], some.T, rcond=None)[0].T
    return found


def corrected(drawn: np.ndarray, likely: np.ndarray, marginal: Marginal, rng: np.random.Generator) -> np.ndarray:
    """A draw (unknowns,) given the readings, from one before them and the mean (unknowns,) that they leave."""
    outputs = marginal.by_unknown @ drawn
    return likely + drawn - marginal.unknowns(outputs + rng.standard_normal(len(outputs)))


DRAWS = 40
SPANS = {"fitting": (0.0, 0.8), "simulating": (0.8, 1.0)}


def forecast(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
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
    minutes: float | None = None,
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
    minutes
        Time that there is. When it is up, the calibration ends with the last round that was made, and half of the draws
        are made.

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
    check_command(out, minutes)
    given = None
    if calibration is not None:
        given = given_calibration(calibration, {"run": run, "starts": starts, "noise": noise})
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
    if run is not None:
        check_estimator(run, described)
    described = described.with_experiment(step=record.step, hours=context + ahead)
    simulator, place = Simulator(described), None if out is None else Path(out)
    with (
        side_by_side(simulator, workers=workers, scheduler=scheduler) as runner,
        simulations(runner, place, simulator, whole_record, minutes=minutes, spans=SPANS) as simulated,
    ):
        common = {"replay": replay, "occupancy": occupancy, "warm_up": warm_up}
        if given is None:
            simulated.stage("fitting the context")
            done = calibrate(
                described.with_experiment(hours=context),
                first,
                run=run,
                noise=preset,
                starts=STARTS if starts is None else starts,
                seed=seed,
                workers=workers,
                scheduler=scheduler,
                within=simulated,
                **common,  # type: ignore[arg-type]
            )
            report, noise_model = done.report, done.problem.noise
        else:
            report = given
            check_given(report, calibration, described, replay=replay)
            check_unseen(report, record, described.output_names, split, end)
            noise_model = noise_of(report, described)
        z, covariance = np.array(report.z), np.array(report.covariance)
        problem = Problem(
            simulator, whole_record, noise=noise_model, replay=replay, occupancy=occupancy, warm_up=warm_up * HOUR,
            runner=simulated,
        )  # fmt: skip
        check_unknowns(report, calibration, problem)
        simulated.stage("simulating the days ahead")
        seen = np.zeros(problem.observed.shape, dtype=bool)
        seen[:, :split] = True
        centre, made, failed = _ensemble(problem.with_observed(seen), z, covariance, draws, seed)
        if failed:
            _log.warning("%s: %s", record.path, about_failed(len(made), failed))
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
                failed=failed,
                stopped=len(made) + failed < draws,
                occupancy=problem.occupancy,
                calibration=report,
                physics=check_physics(described, whole_record),
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
        if place is not None:
            from diagnosis.forecasting.report import write_forecast

            write_forecast(answer, place)
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


def band(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the interval that holds a further draw with probability LEVEL, from draws (draws, ...).

    A further draw lies below the k-th smallest of n with probability k / (n + 1) (Weibull's plotting position); the
    usual interpolation, k / (n - 1), would make the band of 20 draws one of 81 %. What so few draws cannot tell (below
    2 / (n + 1) outside) ends at the outermost ones.
    """
    low, high = np.quantile(draws, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0, method="weibull")
    return low, high


def _part(record: Recording, steps: int) -> Recording:
    """The first steps of a recording."""
    inputs = {name: values[:steps] for name, values in record.inputs.items()}
    return replace(record, time=record.time[:steps], outputs=record.outputs[:, :steps], inputs=inputs)


def _ensemble(
    problem: Problem, z: np.ndarray, covariance: np.ndarray, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray, int]:
    """The most likely outputs (outputs, steps), draws with noise (draws, outputs, steps) [unit of each], and failures.

    Draws that cannot be simulated are left out. Where the time is up, half of them are made all the same.
    """
    with problem.runner.lifted():
        around, centre = most_likely(problem, z)
    rng = np.random.default_rng(seed)
    low, high = problem.bounds
    spread = root(covariance)
    made: list[np.ndarray] = []
    failed = 0
    for k, unread in enumerate(from_the_prior(problem, draws, rng)):
        drawn = np.clip(z + spread @ rng.standard_normal(len(z)), low, high)
        problem.runner.reached(k / draws)
        try:
            with problem.runner.lifted() if len(made) < draws / 2 else nullcontext():
                nuisance = corrected(unread, problem.likely_nuisance(drawn, around), around.marginal, rng)
                outputs = problem.simulate(drawn, problem.nuisance.heights(nuisance))
        except FAILURES:
            failed += 1
            continue
        except TimeUp:
            break
        made.append(outputs + problem.noise.draw(rng, problem.time))
    if len(made) < draws / 2:
        raise SimulationError(f"{failed} of {draws} draws from the posterior could not be simulated")
    return centre, np.stack(made), failed
