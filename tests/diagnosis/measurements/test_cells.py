"""Cells that end in a unit: the same recording as from numbers."""

import tomllib

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.measurements.cells import bare
from diagnosis.measurements.draft import draft_mapping
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import MAPPING, measured

ENDS = {"room": " °C", "kilowatts": " kW"}


def with_units(frame):
    """Cells as a dashboard shows them; of a power below one kilowatt in watts."""
    made = frame.copy()
    for name, unit in ENDS.items():
        made[name] = [f"{one:.6g}{unit}" for one in frame[name]]
    small = frame["kilowatts"] < 1.0
    made.loc[small, "kilowatts"] = [f"{1000 * one:.6g} W" for one in frame["kilowatts"][small]]
    return made


def test_the_recording_is_that_of_numbers(house):
    frame, _ = measured()
    apart = xr.load_dataset(house(frame).recording)
    found = xr.load_dataset(house(with_units(frame), out="units.nc").recording)
    assert (frame["kilowatts"] < 1.0).mean() > 0.05
    for name in ("warmth", "gas", "outdoors", "people"):
        np.testing.assert_allclose(found[name].values, apart[name].values, rtol=1e-4, atol=1e-6)


def test_a_mapping_that_says_another_unit_is_refused(house):
    frame, _ = measured()
    wrong = MAPPING.replace('column = "room"\nunit = "degC"', 'column = "room"\nunit = "degF"')
    assert wrong != MAPPING
    with pytest.raises(RecordingError, match=r"variables\.warmth: column 'room': unit is 'degF'.*unit = 'degC'"):
        house(with_units(frame), wrong)


def test_a_draft_takes_the_unit_from_the_cells(tmp_path):
    frame, _ = measured()
    names = {"room": "room temperature", "kilowatts": "heating power"}
    made = with_units(frame)[["when", *names]].rename(columns=names)
    made.to_csv(tmp_path / "log.csv", index=False)
    drafted = draft_mapping(tmp_path / "log.csv", out=tmp_path / "drafted.toml")
    text = (tmp_path / "drafted.toml").read_text()
    assert tomllib.loads(text)["variables"]["TRoo"]["unit"] == "degC"
    assert "as its cells say" in text
    assert drafted


@given(st.lists(st.floats(-1e6, 1e6).map(lambda one: f"{one:.3f}"), min_size=3), st.sampled_from(["W/m²", "%", "ppm"]))
def test_numbers_keep_every_digit(texts, unit):
    column, found = bare(pd.Series([f"{one} {unit}" for one in texts]), ".", [])
    assert (column.tolist(), found) == (texts, {"W/m²": "W/m2", "%": "percent", "ppm": "ppm"}[unit])


@pytest.mark.parametrize(
    "cells", [["10 PM", "11 PM"], ["12 h", "3 h"], ["1 Feb", "2 Feb"], ["20 °C", "500 ppm", "3 °C"], ["1.2E3", "4"]]
)
def test_what_is_no_unit_of_one_quantity_stays(cells):
    column, unit = bare(pd.Series(cells), ".", [])
    assert (column.tolist(), unit) == (cells, "")
