"""One system's record is written whole or not at all."""

import sys

import netCDF4
import numpy as np
import pytest

from datagen import simulate
from datagen.simulating import recording
from shared.errors import DatasetError, SystemDescriptionError
from tests.small_disk import SAID, small_disk


def onto_a_small_disk(*given):
    with small_disk():
        return write(*given)


write = recording.write_shard


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size there")
def test_a_full_disk_is_a_sentence_and_no_file(default_system, tmp_path, monkeypatch):
    """NetCDF itself says no more than "HDF error", and not as an error of the operating system."""
    monkeypatch.setattr(recording, "write_shard", onto_a_small_disk)
    with pytest.raises(DatasetError, match=rf"a\.nc: cannot be written \({SAID}\); expected a place"):
        simulate(default_system, hours=240, out=tmp_path / "a.nc")
    assert list(tmp_path.iterdir()) == []


def test_a_parameter_beyond_its_range_and_a_slip_in_a_name_are_told(default_system, caplog):
    with caplog.at_level("WARNING", logger="zeroshot"):
        simulate(default_system, parameters={"roo.V": 150.0, "roo.hRoo": 4.0}, hours=2)
        assert not caplog.records
        simulate(default_system, parameters={"roo.V": 10000.0}, hours=2)
    (record,) = caplog.records
    assert record.getMessage().startswith("roo.V is set to 10000 m3, beyond its range of 40 to 300: no estimator")
    with pytest.raises(SystemDescriptionError, match=r"'roo\.v' is not a parameter .*; did you mean roo\.V\?$"):
        simulate(default_system, parameters={"roo.v": 100.0})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"index": 10**20}, "index is 100000000000000000000; expected at most 9223372036854775807"),
        ({"index": -1}, "index is -1; expected at least 0"),
    ],
)
def test_a_system_that_no_record_can_name_is_not_simulated(default_system, monkeypatch, given, said):
    monkeypatch.setattr(recording, "simulate_system", lambda *_, **__: pytest.fail("simulated"))
    with pytest.raises(DatasetError, match=said):
        simulate(default_system, hours=24, **given)


def test_sensors_read_as_their_preset_says(default_system):
    exact = simulate(default_system, hours=2000, seed=3)
    read = simulate(default_system, hours=2000, seed=3, noise="sensor")
    for output in default_system.outputs:
        sensor = output.noise["sensor"]
        error = (read[output.name] - exact[output.name]).values.astype(float)
        known = np.isfinite(error)
        assert error[known].std() == pytest.approx(np.hypot(sensor.sd, sensor.quantum / 12**0.5), rel=0.06)
        assert abs(error[known].mean()) < 4 * sensor.sd / known.sum() ** 0.5
        assert abs((~known).mean() - sensor.dropout) <= 4 * (sensor.dropout / known.size) ** 0.5
    again = simulate(default_system, hours=2000, seed=3, noise="sensor")
    assert read.identical(again)
    with pytest.raises(SystemDescriptionError, match=r"noise 'loud' is not a preset of .*; found none"):
        simulate(default_system, hours=24, noise="loud")


@pytest.mark.parametrize("factor", [0.5, 1.2])
def test_a_parameter_beyond_its_prior_is_not_missing_to_readers_that_follow_cf(default_system, tmp_path, factor):
    """Within the prior its bounds are told; without, netCDF4 would mask the value that they exclude."""
    one = default_system.parameters[1]
    value = factor * one.max
    simulate(default_system, parameters={one.name: value}, hours=24, out=tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc") as data:
        read = data[one.name][...]
        assert not np.ma.is_masked(read) and float(read) == value
        assert hasattr(data[one.name], "valid_max") == (one.min <= value <= one.max)
