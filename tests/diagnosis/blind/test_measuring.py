"""Recordings of a blind set are written whole or not at all."""

import sys

import netCDF4
import numpy as np
import pytest
import xarray as xr

from diagnosis.blind.measuring import write
from shared.errors import RecordingError
from tests.small_disk import SAID, small_disk


def recording(steps):
    about = {"units": "seconds since 2001-01-01 00:00:00", "calendar": "standard"}
    values = np.sin(np.arange(steps)).astype(np.float32)
    values[1] = np.nan
    return xr.Dataset({"T": ("time", values, {"units": "K"})}, {"time": ("time", 3600.0 * np.arange(steps), about)})


def test_a_file_is_read_by_the_c_library_as_it_was_written(tmp_path):
    write(tmp_path / "a.nc", recording(24))
    with netCDF4.Dataset(tmp_path / "a.nc") as found:
        assert found.data_model == "NETCDF3_64BIT_OFFSET"
        np.testing.assert_array_equal(found["T"][...].filled(np.nan), recording(24)["T"].values)
        assert found["T"].ncattrs() == ["units"]
        assert found["time"].units == "seconds since 2001-01-01 00:00:00"
    before = (tmp_path / "a.nc").read_bytes()
    write(tmp_path / "b.nc", recording(24))
    assert (tmp_path / "b.nc").read_bytes() == before


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size there")
def test_a_full_disk_is_a_sentence_and_leaves_all_as_it_was(tmp_path):
    path = tmp_path / "a.nc"
    write(path, recording(24))
    before = path.read_bytes()
    with small_disk(), pytest.raises(RecordingError, match=rf"a\.nc: cannot be written \({SAID}\); expected a place"):
        write(path, recording(8760))
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before
