"""Recordings of a blind set have the noise that the truth says, and are written whole or not at all."""

import sys
from types import SimpleNamespace

import netCDF4
import numpy as np
import pytest
import xarray as xr

from diagnosis.blind.generator import measured, write
from shared.errors import RecordingError
from shared.variables import Noise
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


def test_noise_has_the_size_and_the_colour_that_the_truth_says():
    """Of a variance of 4, three tenths with a memory of five steps: correlation 0.3 exp(-1/5) from step to step."""
    steps = 50_000
    rng = np.random.default_rng(3)
    made = SimpleNamespace(
        clean=np.zeros((1, steps)), time=3600.0 * np.arange(steps), case=SimpleNamespace(rng=lambda purpose: rng)
    )
    system = SimpleNamespace(outputs=[SimpleNamespace(name="T", noise={"good": Noise(sd=2.0)})])
    truth = SimpleNamespace(measuring=SimpleNamespace(noise="good", slow=0.3, hours=(5.0, 5.0)))
    ((shown,), noises) = measured(made, system, truth)
    assert shown.std() == pytest.approx(2.0, rel=0.01)
    assert np.corrcoef(shown[1:], shown[:-1])[0, 1] == pytest.approx(0.2456, abs=0.015)
    assert noises == {"T": {"sd": 2.0, "slow_share": 0.3, "hours": pytest.approx(5.0)}}
