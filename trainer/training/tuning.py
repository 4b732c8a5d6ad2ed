"""Search for an estimator's options with Optuna (paper, section 3), scored on validation systems only."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pandas as pd
import xarray as xr
from optuna.trial import FrozenTrial, Trial, TrialState
from pydantic import BaseModel, Field
from sqlalchemy import URL, make_url

from shared.errors import EstimatorError, OptionsError
from shared.lock import FolderLock
from shared.logs import fields, logger
from shared.progress import progress_bar
from shared.reading import read_json, validated, why
from shared.results import Result
from shared.store import DatasetFolder, write_atomically
from trainer.reading.data import difference, identity_of, load_records
from trainer.runs.checkpoint import make_folder
from trainer.runs.versions import other_version, versions_here
from trainer.seeds import check_seed
from trainer.training.fitting import fit
from trainer.training.material import material_of, recipe_of
from trainer.training.space import space_of

_log = logger(__name__)
BEST, STUDY = "best.json", "study.db"
AGAIN = "again"
"""Of a trial that is tried again after it was cut short: the number that it had then."""
ERROR = "error"
"""Of a trial whose options have no result: the sentence."""
MEAN = "mean loss"
"""Of a trial: the validation loss of the mean."""


class Best(Result, BaseModel, extra="forbid"):
    """``best.json``: what ``trainer fit --options`` reads."""

    model: str
    options: dict[str, Any] = {}
    batch_size: int | None = Field(None, gt=0)
    lr: float | None = Field(None, gt=0, allow_inf_nan=False)
    validation_loss: float | None = None
    mean_loss: float | None = None
    """of the mean of the training's targets on the same windows"""
    default_loss: float | None = None
    """of the estimator's defaults under the same budget"""
    trials: int = 0
    settings: dict[str, Any] = {}

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        loss = "" if self.validation_loss is None else f", validation loss {self.validation_loss:.4g}"
        return f"{self.model}, best of {self.trials} trials{loss}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each option."""
        chosen = {**self.options, "batch_size": self.batch_size, "lr": self.lr}
        rows = [(name, value) for name, value in chosen.items() if value is not None]
        return pd.DataFrame(rows, columns=["option", "value"]).set_index("option")


def read_options(path: Path) -> Best:
    """Read ``best.json``, or a file by hand that has at least ``model``; an EstimatorError if it is neither."""
    expected = "a file of `trainer tune`"
    return validated(Best, read_json(path, EstimatorError, expected), f"{path}", EstimatorError, expected)


def tune(
    dataset_dir: Path | str | xr.Dataset,
    out: Path | str,
    *,
    model: str = "patch-transformer",
    trials: int = 20,
    minutes: float | None = None,
    steps: int | None = None,
    context_hours: float | None = None,
    channels: list[str] | None = None,
    noise: str = "none",
    systems: int | None = None,
    seed: int = 0,
    progress: bool = False,
) -> Best:
    """Search an estimator's options, batch size and learning rate for the lowest loss on validation systems.

    The first trial is the estimator's defaults. Test systems are never looked at. The same call goes on with an
    unfinished search.

    Parameters
    ----------
    dataset_dir
        A dataset made by ``datagen run``.
    out
        Folder of the search: study.db, a run folder for each trial, best.json.
    model
        One of ``trainer.models.ESTIMATORS``.
    trials
        How many in all.
    minutes, steps
        Budget of each trial; two minutes by default.
    context_hours, channels, noise, systems
        As for ``fit``.
    seed
        Of every fit, and of the search: of this and of how many trials there are follows what is tried next.
    progress
        Show progress on stderr.

    Raises
    ------
    EstimatorError
        If an argument is wrong, ``out`` holds a search with other settings or another one is at work there, or no trial
        came to an end. Options that do not go together, or a loss that is not a number, end their own trial only.
    DatasetError
        If the dataset cannot be used.
    """
    if trials < 1:
        raise EstimatorError(f"trials: is {trials}; expected at least 1")
    check_seed(seed)
    if minutes is None and steps is None:
        minutes = 2.0
    space, folder = space_of(model), Path(out)
    recipe_of(model, steps, minutes)
    dataset = DatasetFolder(dataset_dir)
    # a slip must not become the settings of the search
    material_of(dataset, model, context_hours=context_hours, channels=channels, noise=noise, systems=systems)
    settings: dict[str, Any] = {
        "model": model,
        "minutes": minutes,
        "steps": steps,
        "context_hours": context_hours,
        "channels": channels,
        "noise": noise,
        "training systems": systems,
        "seed": seed,
        **identity_of(dataset, load_records(dataset, [])),
    }
    defaults = {name: default for name, (_, default) in space.items()}

    def objective(trial: Trial) -> float:
        try:
            chosen = {name: suggest(trial, name, default) for name, (suggest, default) in space.items()}
        except ValueError:  # Optuna's word for choices that a study has had otherwise
            raise EstimatorError(
                f"{folder / STUDY}: was begun by a version that searched {model} elsewhere; choose another folder"
            ) from None
        batch_size, lr = chosen.pop("batch_size"), chosen.pop("lr")
        run = fit(
            dataset.folder,
            folder / "trials" / f"{trial.number:04d}",
            model=model,
            context_hours=context_hours,
            channels=channels,
            noise=noise,
            steps=steps,
            minutes=minutes,
            batch_size=batch_size,
            lr=lr,
            options=chosen,
            systems=systems,
            seed=seed,
            overwrite=True,
        )
        trial.set_user_attr(MEAN, run.card.training.mean_loss)
        return run.card.training.validation_loss

    make_folder(folder)
    with FolderLock(folder, kind=EstimatorError):
        study = _study(folder, settings, defaults, seed)
        with _bar(progress, trials, len(_finished(study))) as say:
            while len(_finished(study)) < trials:
                number = _try(study, objective)
                say(study, study.trials[number])
        best = _best(study, model, settings, defaults)
        write_atomically(folder / BEST, (best.model_dump_json(indent=1) + "\n").encode())
    return best


def _try(study: optuna.Study, objective: Callable[[Trial], float]) -> int:
    """One trial; returns its number. Optuna's own loop would show a traceback of whatever ends it, Ctrl-C included."""
    trial = study.ask()
    try:
        loss = objective(trial)
    except OptionsError as error:
        # the search learns to stay away; any other error would meet the next trials as well
        trial.set_user_attr(ERROR, str(error))
        study.tell(trial, state=TrialState.PRUNED)
    except BaseException:
        study.tell(trial, state=TrialState.FAIL)
        raise
    else:
        study.tell(trial, loss)
    return trial.number


def _finished(study: optuna.Study) -> list[FrozenTrial]:
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def _storage(path: Path) -> str:
    """The database at a path as a URL, whatever is in its name: a bare question mark would end the name there.

    Raises EstimatorError if sqlalchemy would read another name out of it.
    """
    url = URL.create("sqlite", database=str(path)).render_as_string()
    if make_url(url).database != str(path):
        raise EstimatorError(f"{path}: sqlalchemy cannot use this name; expected one without ? and %")
    return url


def _study(folder: Path, settings: dict[str, Any], defaults: dict[str, Any], seed: int) -> optuna.Study:
    """Open the search in a folder, or begin it with the defaults.

    What was cut short in the middle of a trial is tried again.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    path = (folder / STUDY).resolve()
    fresh = not path.exists()
    try:
        study = optuna.create_study(
            storage=_storage(path),
            study_name="tune",
            direction="minimize",
            load_if_exists=True,
        )
        if fresh or "settings" not in study.user_attrs:
            study.set_user_attr("settings", json.dumps(settings))
            study.set_user_attr("versions", versions_here())
            study.enqueue_trial(defaults)
        found = dict(json.loads(study.user_attrs["settings"]))
        done = len(study.get_trials(deepcopy=False))
    except Exception as error:  # sqlalchemy's own errors, which optuna lets through
        raise EstimatorError(
            f"{path}: cannot be opened as an Optuna study ({type(error).__name__}: {why(error.__cause__ or error)});"
            " expected one that `trainer tune` made, on a file system where SQLite can lock it"
        ) from None
    other = difference(found, settings)
    if other is not None:
        raise EstimatorError(f"{path}: {other}; choose another folder for another search")
    if changed := other_version(study.user_attrs.get("versions", {})):
        _log.warning("%s: begun with %s %s, and this is %s: its trials may differ by that, too", path, *changed)
    # a sampler begins its random numbers anew: with the seed alone, a search that goes on would repeat its first draws
    own = int(np.random.SeedSequence([seed, done]).generate_state(1)[0])
    study.sampler = optuna.samplers.TPESampler(seed=own, n_startup_trials=8)
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(trial.number, state=TrialState.FAIL)
    # whether it was killed or interrupted, when Optuna itself notes a failure
    again = {trial.user_attrs.get(AGAIN) for trial in study.get_trials(deepcopy=False)}
    for trial in study.get_trials(deepcopy=False, states=(TrialState.FAIL,)):
        tried = trial.params or (defaults if trial.number == 0 else {})
        if tried and trial.number not in again:
            study.enqueue_trial(tried, user_attrs={AGAIN: trial.number})
    return study


def _best(study: optuna.Study, model: str, settings: dict[str, Any], defaults: dict[str, Any]) -> Best:
    complete = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    losses = [(trial.value, trial) for trial in complete if trial.value is not None and math.isfinite(trial.value)]
    if not losses:
        why = [f"{one.user_attrs[ERROR]}" for one in study.get_trials(deepcopy=False) if ERROR in one.user_attrs]
        raise EstimatorError(
            "no trial came to an end; try a longer budget, or a lower learning rate by hand"
            + (f". The last one: {why[-1]}" if why else "")
        )
    loss, trial = min(losses, key=lambda pair: pair[0])
    options = dict(trial.params)
    usual = next((one for one in complete if one.params == defaults), None)
    return Best(
        model=model,
        batch_size=options.pop("batch_size"),
        lr=options.pop("lr"),
        options=options,
        validation_loss=loss,
        mean_loss=trial.user_attrs.get(MEAN),
        default_loss=usual.value if usual is not None else None,
        trials=len(_finished(study)),
        settings=settings,
    )


@contextmanager
def _bar(shown: bool, total: int, done: int) -> Iterator[Callable[[optuna.Study, FrozenTrial], None]]:
    """Progress of a search on stderr; yields what is to be called after each trial."""
    with progress_bar("trials", total, done=done, shown=shown) as bar:

        def say(study: optuna.Study, trial: FrozenTrial) -> None:
            losses = [
                one.value for one in _finished(study) if one.state is TrialState.COMPLETE and one.value is not None
            ]
            bar.update(len(_finished(study)), note=f"best {min(losses, default=math.nan):.4f}")
            figures = fields(trial=trial.number, validation_loss=trial.value, state=trial.state.name, **trial.params)
            _log.debug("trial %d", trial.number, extra=figures)

        yield say
