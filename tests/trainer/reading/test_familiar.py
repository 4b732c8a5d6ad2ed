"""In what a recording is unlike a training: against windows that are made to be so."""

import json

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from shared.errors import EstimatorError, RecordingError
from shared.store import DatasetFolder
from trainer.predicting.prediction import predict
from trainer.reading.data import load_records
from trainer.reading.familiar import Familiar, looks, stuck, unlike
from trainer.runs.checkpoint import load_run

NAN = float("nan")


@given(st.lists(st.sampled_from([0.0, 1.5, -2.0, NAN]), min_size=1, max_size=30))
def test_a_look_at_a_window_is_what_a_loop_over_its_readings_finds(readings):
    found = looks(np.array(readings)[None, :, None])
    seen = [reading for reading in readings if reading == reading]
    if not seen:
        assert np.isnan([part[0, 0] for part in found]).all()
        return
    longest, run, before = 1, 1, NAN
    for reading in readings:
        run = run + 1 if reading == before else 1
        longest, before = max(longest, run), reading
    assert (found.lowest[0, 0], found.highest[0, 0], found.still[0, 0]) == (min(seen), max(seen), longest)
    assert found.sd[0, 0] == pytest.approx(np.std(seen))


def test_windows_of_the_training_are_familiar_and_so_are_nearly_all_of_other_systems(ridge_run, tanks, other_tanks):
    encoding, known = ridge_run.card.encoding, ridge_run.card.familiar
    assert [(one.length, one.windows) for one in known] == [(48, 2000)]
    (one,) = known

    def notes(folder, rows=None):
        records = load_records(DatasetFolder(folder), encoding.recorded)
        rows = np.arange(len(records.systems)) if rows is None else records.of_split(rows)
        windows = [records.values[row, :, begin : begin + 48].T for row in rows for begin in (0, 17, 96)]
        return [unlike(window, one, encoding) for window in windows]

    assert not any(notes(tanks, "train"))
    assert np.mean([bool(note) for note in notes(other_tanks)]) < 0.05


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda level: level - 3.0, "level falls to"),
        (lambda level: 2.0 * level, "level rises to"),
        (lambda level: np.where(np.arange(len(level)) > 80, level[80], level), "level stands still for"),
        (lambda level: level.mean() + 1e-3 * (level - level.mean()), "level varies by"),
    ],
)
def test_what_no_training_window_showed_is_said_with_the_estimate(ridge_run, tanks, tmp_path, change, sentence):
    with xr.open_dataset(tanks / "shards" / "000.nc") as opened:
        recording = opened.load().isel(system=4, drop=True)[["level"]].isel(time=slice(0, 100))
    recording.to_netcdf(tmp_path / "as-it-was.nc")
    assert predict(ridge_run, tmp_path / "as-it-was.nc").predictions[0].unlike == []
    recording["level"].values[:] = change(recording["level"].values)
    recording.to_netcdf(tmp_path / "changed.nc")
    notes = predict(ridge_run, tmp_path / "changed.nc").predictions[0].unlike
    assert any(note.startswith(sentence) and note.endswith("in training") for note in notes), notes


def test_a_sensor_that_stands_still_throughout_is_refused(ridge_run, tanks, tmp_path):
    with xr.open_dataset(tanks / "shards" / "000.nc") as opened:
        recording = opened.load()[["level"]].isel(system=slice(0, 3), time=slice(0, 100))
    recording["level"].values[1] = 2.0
    recording.to_netcdf(tmp_path / "dead.nc")
    sentence = r"dead\.nc: level of system 1 is 2 m throughout the window of 24 h, and in the run's training never for"
    with pytest.raises(RecordingError, match=sentence):
        predict(ridge_run, tmp_path / "dead.nc")


def test_an_output_that_may_be_off_for_long_may_be_off(tanks, ridge_run):
    """A heater in summer."""
    (one,) = ridge_run.card.familiar
    patient = one.model_copy(update={"longest_still": [45]})
    dead = np.full((1, 48, 1), 2.0)
    assert stuck(dead, one, ridge_run.card.encoding) == (0, 0)
    assert stuck(dead, patient, ridge_run.card.encoding) is None
    without = ridge_run.card.encoding.model_copy(update={"optional": ["level"]})
    assert stuck(dead, one, without) is None


def test_a_card_without_it_is_read_and_one_with_too_little_is_refused(own_ridge):
    path = own_ridge / "estimator.json"
    card = json.loads(path.read_text())
    known = card.pop("familiar")
    path.write_text(json.dumps(card))
    assert load_run(own_ridge).card.familiar == []
    known[0]["highest"] = []
    path.write_text(json.dumps(card | {"familiar": known}))
    with pytest.raises(EstimatorError, match="highest: has 0 values; expected 1"):
        load_run(own_ridge)
    known[0] = {key: [] if isinstance(value, list) else value for key, value in known[0].items()}
    path.write_text(json.dumps(card | {"familiar": known}))
    with pytest.raises(EstimatorError, match="familiar: is of 0 channels; expected 1"):
        load_run(own_ridge)
    assert Familiar(**known[0]).length == 48
