"""Estimate the parameters behind one recording."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from pydantic import BaseModel

from shared.errors import EstimatorError, RecordingError
from shared.logs import logger
from shared.netcdf import write_netcdf
from shared.places import check_folder
from shared.results import Result
from shared.store import temporary_name
from shared.stretches import Stretch
from trainer.figures import draw_estimates
from trainer.predicting.known import facts_known, facts_of
from trainer.predicting.readings import date_of
from trainer.predicting.recorded import Window, read_window
from trainer.reading.encoding import Encoding
from trainer.reading.familiar import Familiar, stuck, unlike
from trainer.reading.kind import Kind
from trainer.runs.checkpoint import Run, load_run, make_folder
from trainer.runs.unfinished import unfinished
from trainer.runs.validation import Typical, typical_errors
from trainer.seeds import check_seed

_log = logger(__name__)

NEAR = 1e-3
"""An estimate this close to an end of its range, as a share of the prior, is said to lie at its bound."""

BRIDGED_NOTE = "the intervals take the readings that were put in for measured ones: they do not allow for them"
"""Of a window whose gaps were bridged a posterior is not told that it had any."""

SAMPLES = 1000
"""Drawn from a posterior."""


class Estimate(BaseModel, extra="forbid"):
    """One parameter.

    ``value`` is the estimator's answer made a mean (:mod:`trainer.runs.scatter`), where its card knows how far answers
    scatter; ``at_bound`` is of the answer itself. ``rmse`` [unit] is the root mean square error on validation systems
    of estimates from windows of the same length and channels; None where the run's card has none for these. Where the
    run has a posterior, ``median`` and ``low`` to ``high``, the central 90 % interval, are its own.
    """

    value: float
    unit: str
    rmse: float | None
    at_bound: bool
    median: float | None = None
    low: float | None = None
    high: float | None = None


class Prediction(BaseModel, extra="forbid"):
    """Parameters of one system, from the window of the steps from ``begin`` to ``end``."""

    system: int | None
    begin: str
    end: str
    parameters: dict[str, Estimate]
    correlation: list[list[float]] | None = None
    """of the parameters under the posterior, in their order"""
    unlike: list[str] | None = None
    """in what the window is unlike all that the run was trained on: then errors are larger than is said; None where the
    run does not remember it, so that nothing was checked"""
    bridged: int = 0
    """readings of this system that were put in where single ones were missing"""


class Predictions(Result, BaseModel, extra="forbid"):
    """What ``trainer predict`` prints."""

    schema_version: int = 10
    file: str
    model: str
    unfinished: str | None = None
    """a sentence where the run's training did not come to its end, or another run is at work in its folder"""
    context_hours: float
    noise: str
    absent: list[str] = []
    """channels that the run can do without, and that the recording lacks, or lacks too much of in one of its systems"""
    failed: list[str] = []
    """why channels that the recording has are absent, a sentence each, which names the system"""
    facts: dict[str, float] = {}
    """parameters and given facts that the estimate was told, of the first system [own units]"""
    bridged: int = 0
    """readings that were put in where single ones were missing, in all systems"""
    passed: str | None = None
    """why a longer window, which the run knows as well, was not read; None where none was passed over"""
    held: list[str] | None = None
    """uncertain constants of the description that the run has seen as declared only; None where it does not remember"""
    rmse_held: list[str] | None = None
    """those that the systems which ``rmse`` is of have as declared: where a building's are others, errors are larger;
    None where there is no such error, or the run does not remember it"""
    interval_held: list[str] | None = None
    """the same of the systems that the posterior was fitted to, and of its intervals"""
    rmse_note: str
    """What ``rmse`` is over, or why it is null."""
    interval_note: str | None = None
    """In what the posterior's systems are unlike those of the run's last training; None where in nothing."""
    interval_doubt: str | None = None
    """Why intervals are not to be trusted: too few systems calibrated them, or they tell less than the ranges alone."""
    interval_gaps: str | None = None
    """That intervals do not allow for the readings that were put in; None where none were, or there is no posterior."""
    predictions: list[Prediction]

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        several = "" if len(self.predictions) == 1 else f"{len(self.predictions)} systems, "
        count = len(self.predictions[0].parameters)
        return f"{Path(self.file).name}: {several}{count} parameters from {self.context_hours:g} h"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each system and parameter: value, unit, rmse, median, and the ends of the 90 % interval."""
        rows = [
            {"system": one.system, "parameter": name, **value.model_dump()}
            for one in self.predictions
            for name, value in one.parameters.items()
        ]
        frame = pd.DataFrame(rows).set_index(["system", "parameter"])
        return frame.droplevel("system") if len(self.predictions) == 1 else frame

    def plot(self) -> Figure:
        """A panel for each parameter: the estimates and their 90 % intervals, system by system."""
        return draw_estimates(self.to_dataframe())


def predict(
    run: Run | Path | str,
    file: Path | str | xr.Dataset,
    *,
    samples: int = SAMPLES,
    seed: int = 0,
    stretch: Stretch | None = None,
    known: Mapping[str, float] | None = None,
    out: Path | str | None = None,
    corner: Path | str | None = None,
) -> Predictions:
    """Estimate parameters from a recording: one forward pass over its last context window.

    A run with a posterior also gives intervals and correlations.

    Parameters
    ----------
    run
        A run folder, or a run already loaded.
    file
        NetCDF file, or a Dataset in memory. It has the run's recorded channels as variables over (time) or
        (system, time), each with ``units``, and a ``time`` coordinate, as the shards of a dataset have it. Each system
        of it is estimated by itself,
        but all from windows of one length and without the same channels: of what one lacks too much is read of none.
    samples
        Drawn from the posterior of each system, at least 20.
    seed
        Of the samples.
    stretch
        Which stretch without gaps in the inputs that the run reads is taken, of which the last window is read; the
        longest, if not given.
    known
        Parameters and given facts that are known, by name [own units], for a run that was trained with ``facts``. They
        come before the given facts of the recording, which are read as well.
    out
        NetCDF file to write the samples to.
    corner
        PNG file for the posterior's marginals and pairs; the recording must be of one system.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or its channels, units, cell methods, step, length or values do not fit the
        run.
    EstimatorError
        If the run cannot be used, samples or a figure are wanted and it has no posterior, or both in one file, or
        samples are too few for an interval.
    """
    from trainer.posterior.checkpoint import load_posterior, prior_of  # the flows take a while to import
    from trainer.posterior.inference import check_samples, summarise

    check_seed(seed)
    check_samples(samples)
    run = run if isinstance(run, Run) else load_run(run)
    recording = file if isinstance(file, xr.Dataset) else Path(file)
    file = recording.encoding.get("source", "the Dataset") if isinstance(recording, xr.Dataset) else recording
    if cut_short := unfinished(run.card, run.folder):
        _log.warning("%s: %s", run.folder, cut_short)  # for callers that use the values alone
    _check_files(Path(file), out, corner)
    encoding = run.card.encoding
    window = read_window(recording, encoding, run.card.system_name, stretch)
    familiar = {one.length: one for one in run.card.familiar}
    alike = familiar.get(len(window.stamps))
    for values in (*window.longer, window.values):  # a gap long ago does not make a dead sensor live
        if (like := familiar.get(values.shape[1])) is not None:
            _check_moving(Path(file), values, window.systems, like, encoding)
    begins = window.begins + window.stamps[0]
    told = facts_of(recording, encoding, known or {}, window.systems)
    answers = run.read(window.values, begins, told)
    estimates = run.estimates(answers, len(window.stamps), window.absent)
    if told is not None and encoding.known:  # what is known needs no mean made of it
        known_values = told[:, : len(encoding.parameters)]
        estimates = np.where(np.isfinite(known_values), known_values, estimates)
    posterior = load_posterior(run)
    if posterior is None and (out is not None or corner is not None):
        raise EstimatorError(f"{run.folder}: has no posterior to draw samples from; `trainer posterior` fits one")
    if corner is not None and len(window.systems) > 1:
        raise EstimatorError(f"{file}: has {len(window.systems)} systems; expected one for a corner plot")
    drawn = None if posterior is None else posterior.sample(window.values, begins, samples, seed=seed, facts=told)
    found = None if drawn is None else summarise(drawn)
    names, units = encoding.parameters, encoding.parameter_units
    if drawn is not None and out is not None:
        make_folder(Path(out).parent)
        facts: dict[str, str | int] = {"recording": str(file), "estimator": run.card.weights_sha256, "seed": seed}
        _write_samples(Path(out), drawn, window.systems, names, units, facts)
    if drawn is not None and corner is not None:
        from trainer.posterior.figures import draw_corner

        make_folder(Path(corner).parent)
        ranges = list(zip(encoding.parameter_min, encoding.parameter_max, strict=True))
        draw_corner(drawn[0], names, units, ranges, Path(corner))
    fitted_to = None if posterior is None else posterior.card.dataset
    typical = typical_errors(run.card, len(window.stamps), window.absent)
    prior = prior_of(run, encoding.scales()) if posterior is None else posterior.prior
    place = prior.to_unit(encoding.estimates(answers))
    predictions = []
    for i, (system, row, moved) in enumerate(zip(window.systems, estimates, window.begins, strict=True)):
        # a stamp is the end of its step, and so the window begins a step before its first one
        begin, end = (date_of(stamp + moved) for stamp in (window.stamps[0] - encoding.step, window.stamps[-1]))
        parameters = {
            name: Estimate(
                value=float(row[k]),
                unit=encoding.parameter_units[k],
                rmse=None if typical.rmse is None else typical.rmse[name],
                at_bound=bool(place[i, k] < NEAR or place[i, k] > 1 - NEAR),
                median=None if found is None else float(found.median[i, k]),
                low=None if found is None else float(found.low[i, k]),
                high=None if found is None else float(found.high[i, k]),
            )
            for k, name in enumerate(encoding.parameters)
        }
        correlation = None if found is None else found.correlation[i].tolist()
        predictions.append(
            Prediction(
                system=system,
                begin=begin,
                end=end,
                parameters=parameters,
                correlation=correlation,
                unlike=None if alike is None else unlike(window.values[i], alike, encoding),
                bridged=window.bridged[i],
            )
        )
    return Predictions(
        file=str(file),
        model=run.card.model,
        unfinished=cut_short,
        context_hours=len(window.stamps) * encoding.step / 3600,
        noise=run.card.noise,
        absent=window.absent,
        failed=list(window.failed),
        facts=facts_known(told, encoding),
        bridged=sum(window.bridged),
        passed=window.passed,
        held=run.card.held,
        rmse_held=None if typical.rmse is None else run.card.errors_held,
        interval_held=None if fitted_to is None else fitted_to.held,
        rmse_note=_rmse_note(typical, window, encoding, posterior is not None),
        interval_note=_interval_note(fitted_to, run.card.dataset),
        interval_doubt=None if posterior is None else posterior.card.doubt(),
        interval_gaps=BRIDGED_NOTE if any(window.bridged) and posterior is not None else None,
        predictions=predictions,
    )


def _check_files(recording: Path, out: Path | str | None, corner: Path | str | None) -> None:
    """Refuse files to write that are the recording, folders, or one and the same."""
    for name, path, kind in (("out", out, "NetCDF"), ("corner", corner, "PNG")):
        if path is None:
            continue
        if Path(path).exists() and recording.exists() and Path(path).samefile(recording):
            raise EstimatorError(f"{name}: is {path}, the recording itself; expected another file")
        if Path(path).is_dir():
            raise EstimatorError(f"{name}: {path} is a folder; expected a {kind} file to write")
        check_folder(Path(path).parent, EstimatorError)
    if out is not None and corner is not None and Path(out).resolve() == Path(corner).resolve():
        raise EstimatorError(
            f"out and corner: both are {out}, and one would be written over the other; expected two files"
        )


def _check_moving(
    path: Path, values: np.ndarray, systems: list[int | None], known: Familiar, encoding: Encoding
) -> None:
    """Refuse an output of windows (systems, length, recorded) that stands still throughout, if none did in training."""
    at = stuck(values, known, encoding)
    if at is None:
        return
    name, unit = encoding.recorded[at[1]], encoding.units[at[1]]
    hours = values.shape[1] * encoding.step / 3600
    level = np.nanmin(values[at[0], :, at[1]])  # some readings may be missing
    found = f"{level:g}{'' if unit == '1' else f' {unit}'}"
    whose = "" if systems[at[0]] is None else f" of system {systems[at[0]]}"
    longest = known.longest_still[at[1]] * encoding.step / 3600
    never = f"never for more than {longest:.3g} h on end" if longest < hours else "never so long there"
    raise RecordingError(
        f"{path}: {name}{whose} is {found} throughout the window of {hours:g} h, and"
        f" in the run's training {never}; expected readings of a sensor that works"
    )


def _rmse_note(typical: Typical, window: Window, encoding: Encoding, posterior: bool) -> str:
    """A sentence on the errors that are given, or on why none are."""
    present = [name not in window.absent for name in encoding.recorded]
    gappy = any(window.bridged) or np.isnan(window.values[..., present]).any()
    gaps = "; the recording has gaps, with which errors are larger" if gappy else ""
    if typical.rmse is None:
        interval = "; the 90 % interval is the posterior's own, for this very recording" if posterior else ""
        return f"no rmse: {typical.note}{interval}{gaps}"
    return f"rmse: {typical.note}{gaps}"


def _interval_note(fitted_to: Kind | None, trained_on: Kind | None) -> str | None:
    """A sentence where intervals are of systems of another kind than those of the training."""
    if fitted_to is None or trained_on is None or not (unlike := fitted_to.unlike(trained_on)):
        return None
    return f"the posterior was fitted to systems unlike those of the estimator's training: {'; '.join(unlike)}"


def _write_samples(
    path: Path,
    samples: np.ndarray,
    systems: list[int | None],
    parameters: list[str],
    units: list[str],
    attributes: dict[str, str | int],
) -> None:
    """Write samples (windows, n, parameters) [own units] as NetCDF: one variable per parameter, with its unit.

    They are over (system, sample), or over (sample) alone where the recording has no systems. Raises EstimatorError if
    the file cannot be written.
    """
    alone = systems == [None]
    dims = ("sample",) if alone else ("system", "sample")
    variables = {
        name: (dims, samples[0, :, k] if alone else samples[:, :, k], {"units": unit})
        for k, (name, unit) in enumerate(zip(parameters, units, strict=True))
    }
    coordinates = {} if alone else {"system": systems}
    # a seed may be any whole number, a number in NetCDF has 64 bits
    facts = {name: one if isinstance(one, str) or one < 1 << 63 else str(one) for name, one in attributes.items()}
    temporary = temporary_name(path)
    try:
        write_netcdf(xr.Dataset(variables, coordinates, facts), temporary, {})
        os.replace(temporary, path)
    except OSError as error:
        raise EstimatorError(f"{path}: cannot be written ({error.strerror}); expected a place to write to") from None
    finally:
        temporary.unlink(missing_ok=True)
