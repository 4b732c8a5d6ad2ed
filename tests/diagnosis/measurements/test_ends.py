"""A forecast of the weather below a log: which input ends the recording is said, and what keeps all of it."""

import numpy as np
import xarray as xr

from tests.diagnosis.measurements.house_cases import MAPPING, measured


def ends(report):
    return [note for note in report.notes if "the recording ends there" in note]


def coarser(days=4):
    """Ten-minute rows, and then hourly ones without outputs."""
    frame, hours = measured(days=6)
    frame.loc[hours > 24 * days, ["room", "room 2", "kilowatts"]] = np.nan
    return frame[(hours <= 24 * days) | (hours % 1 == 0)]


def test_what_ends_a_recording_is_named_with_its_spacing(house):
    report = house(coarser(), ahead=True)
    assert report.steps < 4 * 48 + 4
    assert ends(report) == [
        "people, presence [presence], has no value in the step after, and so the recording ends there: its readings are"
        " 3600 s apart from there on, and usually 600 s; expected the same spacing throughout, or interval = 3600"
    ]
    advised = MAPPING.replace("persons = 2.0\n", "persons = 2.0\ninterval = 3600\n")
    whole = house(coarser(), advised, out="whole.nc", ahead=True)
    assert whole.steps >= 6 * 48 - 1 and not ends(whole)
    even = house(measured(days=6)[0], out="even.nc")
    found, same = (xr.load_dataset(one.recording)["people"] for one in (whole, even))
    np.testing.assert_allclose(found.sel(time=same["time"][: 4 * 48 - 2]), same[: 4 * 48 - 2])
