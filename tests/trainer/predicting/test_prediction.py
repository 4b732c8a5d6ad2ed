import numpy as np
import pytest
import xarray as xr

from shared.errors import RecordingError
from shared.store import DatasetFolder
from trainer.cli import app
from trainer.predicting.prediction import Estimate, Prediction, Predictions, predict
from trainer.predicting.recorded import read_window
from trainer.runs.checkpoint import Run
from trainer.training.fitting import fit

from .conftest import write


def test_a_shard_is_estimated_system_by_system(ridge_run, tanks):
    found = predict(ridge_run, tanks / "shards" / "000.nc")
    assert [one.system for one in found.predictions] == list(range(50))
    records = DatasetFolder(tanks).load()
    values = records.values[:50, :, -48:].transpose(0, 2, 1)
    expected = ridge_run.estimate(values, np.full(50, records.time[-48]))
    assert [one.parameters["tank.fill"].value for one in found.predictions] == pytest.approx(expected[:, 1].tolist())
    errors = expected[:, 1] - records.parameters[:50, 1]
    rmse = found.predictions[0].parameters["tank.fill"].rmse
    assert 1 / 3 < rmse / np.sqrt(np.mean(errors**2)) < 3


def test_a_recording_of_no_system_is_refused(ridge_run, shard, tmp_path):
    path = write(shard.isel(system=[]).drop_encoding(), tmp_path / "none.nc")
    with pytest.raises(RecordingError, match=r"none\.nc: its dimension system is empty; expected at least one system"):
        predict(ridge_run, path)


def test_one_recording_uses_its_last_window(ridge_run, recording, tmp_path, tanks):
    found = predict(ridge_run, write(recording, tmp_path / "r.nc")).predictions
    assert len(found) == 1
    one = found[0]
    assert one.system is None
    # samples 53 to 100 of half an hour each, stamped at their ends
    assert (one.begin, one.end) == ("2001-01-02T02:00:00", "2001-01-03T02:00:00")
    truth = DatasetFolder(tanks).load().parameters[4]
    assert one.parameters["tank.fill"].value == pytest.approx(truth[1], rel=0.1)
    assert one.parameters["tank.fill"].unit == "m"
    changed = recording.copy(deep=True)
    changed["level"][:52] = np.nan  # what lies before does not matter
    again = predict(ridge_run, write(changed, tmp_path / "again.nc")).predictions[0]
    assert again.parameters == one.parameters


def test_the_calendar_of_the_recording_does_not_matter(ridge_run, recording, tmp_path):
    one = predict(ridge_run, write(recording, tmp_path / "a.nc")).predictions[0]
    # 2024 began on a Monday as well
    later = recording.assign_coords(time=recording.time + (np.datetime64("2024-01-01") - np.datetime64("2001-01-01")))
    two = predict(ridge_run, write(later, tmp_path / "b.nc")).predictions[0]
    assert two.begin == "2024-01-02T02:00:00"
    assert two.parameters["tank.fill"].value == pytest.approx(one.parameters["tank.fill"].value, rel=1e-6)


# the tanks' ranges are 2 to 20 h, linear, and 1 to 4 m, in the logarithm: a thousandth of it ends at 1.00139 m, and
# begins at 3.99446 m
@pytest.mark.parametrize(
    ("estimate", "at_bound"), [([2.017, 1.0013], [True, True]), ([19.981, 3.9940], [False, False])]
)
def test_a_bound_is_near_in_the_scale_of_the_prior(ridge_run, tanks, monkeypatch, estimate, at_bound):
    def answer(run, values, *_):
        return run.card.encoding.targets(np.tile(estimate, (len(values), 1)))

    monkeypatch.setattr(Run, "read", answer)
    found = predict(ridge_run, tanks / "shards" / "000.nc").predictions[0].parameters
    assert [one.at_bound for one in found.values()] == at_bound


def stated(**attributes):
    """The recording with other attributes of its level; None for one that it has not."""

    def changed(r):
        r["level"].attrs = {name: one for name, one in (r["level"].attrs | attributes).items() if one is not None}
        return r

    return changed


def reads(value, where):
    """The recording with a value in the place of some readings."""

    def changed(r):
        r["level"][where] = value
        return r

    return changed


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (stated(units=None), "level has no units; the run expects 'm'"),
        (stated(units="cm"), "level is in 'cm'; the run expects 'm': convert it first"),
        (reads(np.nan, slice(70, 72)), "level has 2 missing values in its last 48 samples; expected none: choose"),
        (
            stated(cell_methods="area: mean time: mean (interval: 30 minutes)"),
            r"level is a mean over each step \(its cell_methods\); for the run it is an instant at each step's",
        ),
        (stated(cell_methods="time: maximum"), "level is the maximum of each step"),
        (
            reads(-9999.0, [60, 90]),
            r"r\.nc: level is -9999 m at 2001-01-02T06:30:00, as loggers write where a reading is missing \(the run's"
            r" training: [\d.]+ m, standard deviation [\d.]+ m\); expected a reading: declare such codes missing",
        ),
        (
            reads(-9000.0, [60, 90]),
            r"r\.nc: level is -9000 m at 2001-01-02T06:30:00, \d{5} standard deviations from the mean of the run's"
            r" training \([\d.]+ m, standard deviation [\d.]+ m\); expected at most 30: declare a code for a missing"
            r" reading missing \(NaN\)",
        ),
        (
            lambda r: r.assign_coords(time=np.arange(100.0)),
            "time has no units; expected for example 'seconds since 2001-01-01 00:00:00'",
        ),
        (
            lambda r: r.expand_dims("room"),
            r"level has dimensions \(room, time\); expected \(time\) or \(system, time\)",
        ),
        (lambda r: r.rename(level="height"), "has no 'level', which the run reads; found height"),
        (lambda r: r.drop_vars("time"), "has no coordinate 'time'"),
        (lambda r: r.isel(time=slice(0, 40)), r"has 40 samples \(20 h at the run's step\); the run needs 48 \(24 h\)"),
        (lambda r: r.isel(time=slice(None, None, 2)), "its step is 3600 s after 2001-01-01T02:30:00"),
        (lambda r: r.drop_isel(time=80), "its step is 3600 s after 2001-01-02T16:00:00; the run was trained on steps"),
    ],
)
def test_what_does_not_fit_is_told_in_a_sentence(ridge_run, recording, tmp_path, change, sentence):
    path = write(change(recording), tmp_path / "r.nc")
    with pytest.raises(RecordingError, match=sentence):
        predict(ridge_run, path)


def test_a_file_that_is_missing_or_no_netcdf_is_told(ridge_run, tmp_path):
    with pytest.raises(RecordingError, match="no such file; expected a recording"):
        predict(ridge_run, tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("time,level\n")
    with pytest.raises(RecordingError, match=r"is no NetCDF file but begins with 'time,level'; .* `diagnosis import`"):
        predict(ridge_run, tmp_path / "text.nc")
    (tmp_path / "cut.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(40))
    with pytest.raises(RecordingError, match="cannot be read as NetCDF"):
        predict(ridge_run, tmp_path / "cut.nc")


def test_only_a_cell_method_that_is_stated_and_known_is_held_against_the_run(ridge_run, recording, tmp_path):
    one = predict(ridge_run, write(recording, tmp_path / "point.nc")).predictions
    del recording["level"].attrs["cell_methods"]
    assert predict(ridge_run, write(recording, tmp_path / "unstated.nc")).predictions == one
    recording["level"].attrs["cell_methods"] = "time: mean"
    earlier = ridge_run.card.encoding.model_copy(update={"methods": []})
    assert read_window(write(recording, tmp_path / "mean.nc"), earlier).values.shape == (1, 48, 1)


def test_a_channel_that_never_varied_in_training_must_stay_as_it_was(tanks, recording, tmp_path):
    run = fit(tanks, tmp_path / "run", model="ridge", channels=["level", "valve"], steps=2)
    assert run.card.encoding.constant == ["valve"]

    def read(opening):
        valve = np.ones(100)
        valve[70:] = opening
        return write(recording.assign(valve=("time", valve, {"units": "1"})), tmp_path / f"{opening}.nc")

    told = "valve is 0.5 at 2001-01-02T11:30:00; in the run's training it was 1 throughout, so that the run cannot tell"
    with pytest.raises(RecordingError, match=told):
        predict(run, read(0.5))
    with pytest.raises(RecordingError, match=r"valve is 0\.998 at"):
        predict(run, read(0.998))
    # a rounding changes nothing, not even a little
    assert predict(run, read(1.0005)).predictions == predict(run, read(1.0)).predictions
    earlier = run.card.encoding.model_copy(update={"constant": []})
    assert read_window(read(0.5), earlier).values[0, -1, 1] == 0.5


def test_the_table_has_one_answer_the_posteriors_where_there_is_one(monkeypatch, capsys):
    value = Estimate(value=2.0, unit="m2", rmse=0.5, at_bound=False, median=2.1, low=1.5, high=2.7)

    def answer(one):
        predictions = [Prediction(system=None, begin="a", end="b", parameters={"tank.fill": one}, unlike=[])]
        more = {"file": "r.nc", "model": "ridge", "context_hours": 24, "noise": "none", "rmse_note": "rmse: of rooms"}
        monkeypatch.setattr(
            "trainer.predicting.prediction.predict", lambda *_, **__: Predictions(predictions=predictions, **more)
        )
        app(["predict", "run", "r.nc"], result_action="return_value", exit_on_error=False)
        return capsys.readouterr().out

    both = answer(value)
    assert "2.1" in both and "1.5 to 2.7" in both and "rmse" not in both
    assert "remark" not in both
    alone = answer(value.model_copy(update={"median": None, "low": None, "high": None}))
    assert "+- rmse" in alone and "0.5" in alone and "rmse: of rooms" in alone and "interval" not in alone
    bound = answer(value.model_copy(update={"at_bound": True}))
    assert "remark" in bound and "at the end of its range" in bound


def test_a_recording_in_memory_is_estimated_as_the_one_in_the_file(ridge_run, recording, tmp_path):
    path = write(recording, tmp_path / "r.nc")
    with xr.open_dataset(path) as opened:
        found = predict(ridge_run, opened)
    assert found == predict(ridge_run, path)
    assert predict(ridge_run, recording).predictions == found.predictions
    with pytest.raises(RecordingError, match=r"^dataset-\w+: has no 'level', which the run reads"):
        predict(ridge_run, recording.drop_vars("level").drop_encoding())
