"""Recordings as they are read."""

from types import SimpleNamespace

import pytest
import xarray as xr

from datagen import simulate
from diagnosis.calibrating.report import began
from diagnosis.recording import read_recording


@pytest.mark.parametrize(
    ("units", "date", "begun"),
    [
        ("seconds since 2022-01-03 00:00:00", "2022-01-03T00:00:00", "2022-01-03 00:00"),
        ("s", "2001-01-01T00:00:00", "2001-01-01 00:00"),
    ],
)
def test_a_recording_knows_the_calendar(default_system, tmp_path, units, date, begun):
    simulate(default_system, hours=3.0, seed=1, out=tmp_path / "one.nc")
    data = xr.load_dataset(tmp_path / "one.nc", decode_times=False)
    data["time"].attrs["units"] = units
    data.to_netcdf(tmp_path / "other.nc")
    found = read_recording(tmp_path / "other.nc", default_system)
    assert str(found.zero) == date
    done = SimpleNamespace(problem=SimpleNamespace(recording=found), report=SimpleNamespace(start=found.start))
    assert began(done) == begun
