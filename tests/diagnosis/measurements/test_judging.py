"""Readings that are fewer than the steps of the grid, that were lost, or that may be means or instants."""

import numpy as np
import pytest
import xarray as xr

from diagnosis.measurements.grid import as_read
from diagnosis.measurements.signal import Signal
from shared.errors import RecordingError
from shared.schema import FLAGS
from tests.diagnosis.measurements.house_cases import HOURLY, HOUSE, MAPPING, measured, warmth


def variables(report):
    return {one.name: one for one in report.variables}


@pytest.mark.parametrize(
    ("few", "found"),
    [("room", r"warmth: column 'room': its readings are 3600 s"), ("kilowatts", r"gas: .*are means over 3600 s")],
)
def test_one_reading_is_not_taken_for_several(house, tmp_path, few, found):
    """Instants joined by lines and means cut into parts count as often as there are steps, as if each had been read."""
    frame, hours = measured()
    seldom = frame.assign(**{few: frame[few].where(hours % 1 == 0)})
    with pytest.raises(RecordingError, match=rf"variables.{found}.*a step is 1800 s.*expected .*grid.step = 3600 "):
        house(seldom)
    assert not (tmp_path / "out").exists()
    assert house(seldom, HOURLY).steps == 144


def test_inputs_and_states_may_be_read_less_often_than_steps(house):
    frame, hours = measured()
    seldom = frame.assign(outside=frame["outside"].where(hours % 1 == 0))
    assert house(seldom, out="weather.nc").steps == 288
    held = MAPPING.replace('unit = "degC"\ncompare', 'unit = "degC"\nreading = "hold"\ncompare', 1)
    assert house(frame.assign(room=frame["room"].where(hours % 1 == 0)), held, out="held.nc").steps == 288


@pytest.mark.parametrize("unit", ["W/m2", "W.m-2"])
def test_the_same_irradiance_is_left_out_in_every_spelling(house, tmp_path, unit):
    (tmp_path / "sun.toml").write_text(HOUSE.replace('"sunshine", unit = "W/m2"', f'"sunshine", unit = "{unit}"'))
    frame, hours = measured()
    frame["sun"] = np.where((hours >= 50) & (hours < 52), 5000.0, frame["sun"])
    mapping = MAPPING.replace("[weather.ghi]", "[variables.sunshine]")
    report = house(frame, mapping, system=tmp_path / "sun.toml")
    wrong = int((frame["sun"] == 5000.0).sum())
    (note,) = [one for one in report.notes if one.startswith("column sun") and "left out" in one]
    assert note.startswith(f"column sun: {wrong} of {len(frame)} readings are left out: not -20 to 1500 W/m2")


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


def instants(times, max_gap):
    return Signal(times, times, 0.01 * times, np.zeros(len(times), dtype=np.int8), "point", max_gap, "1")


def test_no_more_readings_come_out_than_went_in(house, tmp_path):
    frame, hours = measured(minutes=30)
    lost = np.arange(len(frame)) % 4 == 3
    report = house(frame.assign(room=frame["room"].where(~lost)))
    with xr.open_dataset(tmp_path / "out" / "house.nc") as found:
        warm, flags = found["warmth"].values, found["warmth_flag"].values
    there = np.isfinite(warm)
    # a step ends at each row, of which every fourth lost its reading
    np.testing.assert_array_equal(there, ~lost)
    np.testing.assert_allclose(warm[there], warmth(hours)[there] + 273.15, atol=1e-5)
    np.testing.assert_array_equal(flags == FLAGS["missing"], ~there)
    assert variables(report)["warmth"].missing == lost.sum()


def test_a_mean_over_a_lost_reading_is_partly_covered(house):
    """Ten-minute instants to hourly means: one lost of six leaves lines over two thirds of the hour."""
    frame, hours = measured()
    joined = HOURLY.replace('unit = "kW"\nreading = "mean"', 'unit = "kW"\nreading = "point"')
    gone = np.isclose(hours % 24, 10.5)
    about = variables(house(frame.assign(kilowatts=frame["kilowatts"].where(~gone)), joined))["gas"]
    assert (about.partly, about.missing) == (gone.sum(), 0)
    assert variables(house(frame, joined, out="whole.nc"))["gas"].partly == 0


@pytest.mark.parametrize(("apart", "late"), [(900.0, 420.0), (60.0, 0.0), (1800.0, 0.0)])
@pytest.mark.parametrize("method", ["point", "mean"])
def test_other_cadences_than_the_steps_lose_nothing(apart, late, method):
    """A logger that is late, faster or slower than steps of 900 s, or now and then by a fifth of its spacing."""
    edges = 900.0 * np.arange(97)
    regular = np.arange(-2 * apart, edges[-1] + 2 * apart, apart) + late
    jittered = regular + 0.2 * apart * np.random.default_rng(1).uniform(-1, 1, len(regular))
    for times in (regular, jittered):
        values, flags = as_read(instants(times, 2.5 * apart), edges, method, 0.5, bridges=False)
        expected = 0.01 * (edges[1:] if method == "point" else edges[1:] - 450.0)
        np.testing.assert_allclose(values, expected, atol=1e-9)
        assert not flags.any()
