"""Errors on validation systems, condition by condition, and what is said where there are none."""

import json
import shutil

import numpy as np
import pytest
import torch
import xarray as xr

from shared.store import DatasetFolder
from trainer.posterior import fit_posterior
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import load_run
from trainer.runs.validation import typical_errors
from trainer.training.fitting import fit

from ..test_cli import run as command


@pytest.fixture(scope="module")
def folder(tanks, tmp_path_factory):
    """A run of two lengths, an optional channel and two presets, with a posterior; tests must not change it."""
    torch.set_num_threads(1)
    run = fit(
        *(tanks, tmp_path_factory.mktemp("validation") / "run"),
        model="multiscale-transformer",
        channels=["level", "glow"],
        optional=["glow"],
        context_hours=24.0,
        other_contexts=[48.0],
        noise="none gauge",
        steps=40,
        options={"width": 16, "layers": 1, "heads": 2, "feedforward": 16},
    )
    fit_posterior(run, tanks, windows_per_system=2, epochs=1)
    return run.folder


@pytest.fixture
def earlier(folder, tmp_path):
    """The same run with a card of the first version: one figure over everything."""
    own = shutil.copytree(folder, tmp_path / "earlier")
    card = json.loads((own / "estimator.json").read_text())
    del card["validation_errors"]
    (own / "estimator.json").write_text(json.dumps(card | {"schema_version": 1}))
    return own


@pytest.fixture
def record(tanks, tmp_path):
    """Writes a recording of so many hours with some channels."""
    with xr.open_dataset(tanks / "shards" / "000.nc") as opened:
        shard = opened.load().isel(system=4, drop=True)

    def write(hours, channels=("level", "glow")):
        path = tmp_path / f"{hours}-{len(channels)}.nc"
        shard[list(channels)].isel(time=slice(0, 2 * hours)).to_netcdf(path)
        return path

    return write


def errors_of(run, **condition):
    (one,) = [e for e in run.card.validation_errors if all(getattr(e, k) == v for k, v in condition.items())]
    return one


def test_a_fit_measures_every_length_preset_and_missing_channel(folder, tanks):
    run = load_run(folder)
    conditions = {(one.length, tuple(one.absent), one.noise) for one in run.card.validation_errors}
    assert conditions == {(n, a, p) for n in (48, 96) for a in ((), ("glow",)) for p in ("none", "gauge")}
    # records of 480 samples are cut into ten windows of 48 in one way only
    records = DatasetFolder(tanks).load(["level", "glow"])
    rows = records.of_split("validation")
    values = records.values[rows].transpose(0, 2, 1).reshape(-1, 48, 2)
    time = (records.starts[rows][:, None] + records.time[::48][None]).ravel()
    truth = np.repeat(records.parameters[rows], 10, axis=0)
    for absent in ([], ["glow"]):
        read = values.copy()
        read[:, :, 1] = np.nan if absent else read[:, :, 1]
        found = errors_of(run, length=48, absent=absent, noise="none")
        assert (found.windows, found.systems) == (100, 10)
        expected = np.sqrt(np.mean((run.estimate(read, time) - truth) ** 2, axis=0))
        assert list(found.rmse.values()) == pytest.approx(expected.tolist(), rel=1e-3)


def test_a_prediction_has_the_errors_of_its_own_length_and_channels(folder, record):
    run = load_run(folder)
    for hours, channels, absent in (
        (24, ("level", "glow"), []),
        (48, ("level", "glow"), []),
        (24, ("level",), ["glow"]),
    ):
        found = predict(run, record(hours, channels))
        figures = [errors_of(run, length=2 * hours, absent=absent, noise=noise).rmse for noise in ("none", "gauge")]
        for name, one in found.predictions[0].parameters.items():
            assert one.rmse == max(figure[name] for figure in figures)
        lacking = " without glow" if absent else ""
        assert f"systems, {hours} h{lacking}, noise none or gauge, whichever is larger" in found.rmse_note


def test_readings_that_were_put_in_are_told_of_intervals_and_without_an_rmse_too(folder, earlier, record, capsys):
    """One in twenty is lost; bridged, the posterior takes the recording for a complete one."""
    path = record(48)
    assert predict(earlier, path).interval_gaps is None
    data = xr.load_dataset(path)
    data["level"][5:90:20] = np.nan
    data.to_netcdf(path.with_name("holes.nc"))
    sentence = "the intervals take the readings that were put in for measured ones: they do not allow for them"
    for run in (folder, earlier):
        found = predict(run, path.with_name("holes.nc"))
        assert found.bridged == 5 and found.interval_gaps == sentence
        assert found.rmse_note.startswith("rmse: " if run == folder else "no rmse: ")
        assert found.rmse_note.endswith("; the recording has gaps, with which errors are larger")
    _, out, _ = command(capsys, "predict", earlier, path.with_name("holes.nc"))
    assert sentence in " ".join(out.split())


def test_a_condition_that_was_not_measured_has_no_errors(folder):
    card = load_run(folder).card.model_copy(deep=True)
    card.validation_errors = [one for one in card.validation_errors if not one.absent]
    found = typical_errors(card, 48, ["glow"])
    assert found.rmse is None
    assert found.note == (
        "the run's card has errors of validation systems, but none for 24 h without glow, noise none or gauge"
    )
