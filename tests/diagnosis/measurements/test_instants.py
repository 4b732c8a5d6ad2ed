"""Means over steps of readings of which nothing says whether they are means or instants."""

import numpy as np
import pytest
import xarray as xr

from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import MAPPING, measured

SILENT = MAPPING.replace('unit = "kW"\nreading = "mean"', 'unit = "kW"')


def told(report, name):
    return [note for note in report.notes if note.startswith(f"{name}: instants")]


def burst(minutes=30):
    """A heater that was on for one reading of each day."""
    frame, hours = measured(minutes=minutes)
    return frame.assign(kilowatts=np.where(hours % 24 == 6.5, 10.0, 0.0))


def test_readings_a_step_apart_that_may_be_means_are_refused(house, tmp_path):
    with pytest.raises(
        RecordingError,
        match=r"mapping.toml: variables.gas: column 'kilowatts': nothing says whether its readings, 1800 s apart, are"
        r" means or instants, and gas is a mean over each step of 1800 s; expected reading = 'mean' if",
    ):
        house(burst(), SILENT)
    assert not (tmp_path / "out").exists()


def test_who_says_how_they_were_read_is_believed(house):
    mean = house(burst(), MAPPING, out="mean.nc")
    point = house(burst(), MAPPING.replace('unit = "kW"\nreading = "mean"', 'unit = "kW"\nreading = "point"'))
    default = house(burst(), SILENT.replace("[place]", '[defaults]\nreading = "point"\n[place]'), out="default.nc")
    found = [float(xr.load_dataset(one.recording)["gas"].max()) for one in (mean, point, default)]
    assert found == pytest.approx([10000.0, 5000.0, 5000.0])
    assert not any(told(one, "gas") for one in (mean, point, default))
