"""A meter's register: the energy that it counts is that of the recording, through resets and lost readings."""

import tomllib

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.measurements.draft import draft_mapping
from diagnosis.measurements.register import between, is_register
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import MAPPING, measured

REGISTER = MAPPING.replace('unit = "kW"\nreading = "mean"', 'unit = "kWh"\nreading = "register"')


def counted(hours, every=0.0):
    """What a register shows that counts the heat of ``measured`` [kWh], in steps of ``every``."""
    total = 4711.0 + hours + 24 / (2 * np.pi) * np.sin(2 * np.pi * hours / 24)
    return np.floor(total / every) * every if every else total


def heat(report):
    return xr.load_dataset(report.recording)["gas"].values


@given(st.lists(st.tuples(st.floats(1.0, 5000.0), st.floats(0.0, 50.0)), min_size=1, max_size=30))
def test_what_is_counted_is_the_rate_times_the_time(steps):
    apart, rises = np.array(steps).T
    time, counts = np.append(0.0, np.cumsum(apart)), np.append(7.0, 7.0 + np.cumsum(rises))
    begin, end, rate = between(time, counts, np.inf)
    np.testing.assert_allclose(rate @ (end - begin), counts[-1] - counts[0], atol=1e-9 * counts[-1])


def test_heat_counted_by_a_register_is_that_of_a_meter_of_power(house):
    frame, hours = measured()
    exact = 1000.0 * (1.0 + np.cos(2 * np.pi * hours / 24))
    plain = heat(house(frame))
    register = heat(house(frame.assign(kilowatts=counted(hours)), REGISTER, out="register.nc"))
    assert register.shape == plain.shape
    np.testing.assert_allclose(register, plain, atol=60.0)  # a mean of ten minutes against an instant at their end
    assert np.nanmean(register) == pytest.approx(exact.mean(), rel=0.01)


def test_a_reset_and_lost_readings_cost_no_more_than_their_steps(house):
    frame, hours = measured()
    plain = heat(house(frame.assign(kilowatts=counted(hours)), REGISTER))
    shown = counted(hours)
    shown[hours > 60.0] -= shown[hours > 60.0][0]  # reset
    shown[(hours > 30.0) & (hours < 30.5)] = 0.0  # two readings are lost as zero
    shown[400] = np.nan
    report = house(frame.assign(kilowatts=shown), REGISTER, out="reset.nc")
    found = heat(report)
    lost = ~np.isfinite(found)
    assert lost.sum() <= 2
    np.testing.assert_allclose(found[~lost], plain[~lost], atol=60.0)
    assert any("column kilowatts: 1 of" in one and "left out" in one for one in report.notes)


def test_a_register_that_writes_each_count_keeps_its_energy(house):
    """A row for each kWh: between two rows hours may pass."""
    frame, hours = measured()
    shown = counted(hours, every=1.0)
    written = np.append(True, np.diff(shown) > 0)
    found = heat(house(frame.assign(kilowatts=np.where(written, shown, np.nan)), REGISTER))
    covered = np.isfinite(found)
    assert covered.mean() > 0.9
    assert np.sum(found[covered]) / covered.sum() == pytest.approx(1000.0, rel=0.05)


def test_coarse_counts_are_told(house):
    frame, hours = measured()
    report = house(frame.assign(kilowatts=counted(hours, every=1.0)), REGISTER)
    assert any("one count of the register is 2e+03 W over a step of 1800 s, and its mean is 1e+03 W" in one
               for one in report.notes), report.notes  # fmt: skip


def test_a_register_of_no_energy_is_refused(house):
    frame, _ = measured()
    with pytest.raises(RecordingError, match=r"variables.gas: reading is register with unit 'kW'; expected .*: kWh, "):
        house(frame, MAPPING.replace('"kW"\nreading = "mean"', '"kW"\nreading = "register"'))


def test_a_power_is_no_register():
    rng = np.random.default_rng(0)
    assert is_register(np.cumsum(rng.uniform(0, 1, 500)))
    assert not is_register(np.cumsum(rng.standard_normal(500)))
    assert not is_register(np.repeat([1.0, 2.0, 3.0], 100))


def test_a_draft_reads_a_register_that_was_reset(house, tmp_path):
    frame, hours = measured()
    shown = counted(hours)
    shown[hours > 60.0] -= shown[hours > 60.0][0]
    data = pd.DataFrame({"when": frame["when"], "room temperature [degC]": frame["room"], "heating meter [kWh]": shown})
    data.to_csv(tmp_path / "log.csv", index=False)
    draft_mapping(tmp_path / "log.csv", out=tmp_path / "drafted.toml")
    drafted = tomllib.loads((tmp_path / "drafted.toml").read_text())["variables"]["QHea"]
    assert drafted == {"column": "heating meter [kWh]", "unit": "kWh", "reading": "register"}
