"""Slips in the file, the mapping and the call: the sentence names what was meant."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from diagnosis.measurements import import_recording
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOURLY, HOUSE, MAPPING, measured


@pytest.fixture
def text(tmp_path):
    """Import a file of this text."""

    def run(content, mapping=MAPPING):
        (tmp_path / "house.toml").write_text(HOUSE)
        (tmp_path / "mapping.toml").write_text(mapping)
        (tmp_path / "data.csv").write_text(content)
        return import_recording(tmp_path / "mapping.toml", tmp_path / "data.csv", out=tmp_path / "out.nc")

    return run


def test_semicolons_and_decimal_commas(text):
    content = measured(days=2)[0].to_csv(index=False, sep=";", decimal=",")
    with pytest.raises(
        RecordingError,
        match=r"rows have \d+ fields under 1 column names; .*; is file.separator ';' \(and file.decimal ','\)\?$",
    ):
        text(content)
    with pytest.raises(RecordingError, match=r"no column 'when'; .*is file.separator '\\t'.*\?$"):
        text(measured(days=2)[0].to_csv(index=False, sep="\t"))
    commas = measured(days=2)[0].to_csv(index=False)
    with pytest.raises(RecordingError, match=r"separator ';'\); is file.separator ','\?$"):
        text(commas, MAPPING.replace("[time]", '[file]\nseparator = ";"\n[time]'))


def test_a_semicolon_in_a_name_is_no_separator(text):
    content = measured(days=2)[0].rename(columns={"when": "at; local"}).to_csv(index=False)
    with pytest.raises(RecordingError, match=r"no column 'when'.*separator ','\)$"):
        text(content)


@pytest.mark.parametrize(("written", "read"), [("%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M"), ("%m.%d.%y %H", "%d.%m.%y %H")])
def test_days_that_are_read_as_months(house, written, read):
    frame, _ = measured(days=8, minutes=60)
    days = pd.date_range("2022-03-01 00:00", periods=len(frame), freq="h")
    mapping = HOURLY.replace("[time]", f'[time]\nformat = "{read}"')
    with pytest.raises(
        RecordingError,
        match=r"column 'when': spans \d+ days, and jumps by about a month after each day, 8 times, as from row 24"
        r" .*time.format is .*, are day and month the other way round\?",
    ):
        house(frame.assign(when=days.strftime(written)), mapping)
    assert house(frame.assign(when=days.strftime(written)), mapping.replace(read, written)).steps > 150


def test_days_that_are_read_as_months_may_hit_an_hour_that_there_is_not(house):
    """The third of August, read as the eighth of March, when clocks in New York skip an hour."""
    frame, _ = measured(days=8, minutes=60)
    days = pd.date_range("2026-08-01 00:00", periods=len(frame), freq="h")
    mapping = HOURLY.replace("[time]", '[time]\nformat = "%m/%d/%Y %H:%M"').replace(
        "Europe/Amsterdam", "America/New_York"
    )
    with pytest.raises(RecordingError, match=r"jumps by about a month after each day, .* the other way round"):
        house(frame.assign(when=days.strftime("%d/%m/%Y %H:%M")), mapping)


def test_months_that_nobody_logged_are_no_slip(house):
    """A logger that was out for a month, twice, between weeks of readings."""
    frame, _ = measured(days=8, minutes=60)
    days = pd.date_range("2022-03-01 00:00", periods=len(frame), freq="h")
    late = days + pd.to_timedelta(np.array([0, 35, 70])[np.arange(len(frame)) // 72], unit="D")
    mapping = HOURLY.replace("[time]", '[time]\nformat = "%Y-%m-%d %H:%M"')
    assert house(frame.assign(when=late.strftime("%Y-%m-%d %H:%M")), mapping).steps > 50


def test_readings_that_cannot_be_are_named_where_they_shorten_the_recording(house, tmp_path):
    """The sun in the place of the wind: too strong for a wind at every noon, and its offset at night is no calm."""
    wind = '{ name = "wind", unit = "m/s", source = "weather", column = "wind_speed" },'
    (tmp_path / "windy.toml").write_text(HOUSE.replace("inputs = [", f"inputs = [\n  {wind}"))
    frame, _ = measured()
    frame["sun"] += 0.25
    mapping = MAPPING + '[weather.wind_speed]\ncolumn = "sun"\nunit = "m/s"\n'
    with pytest.raises(
        RecordingError,
        match=r"no inputs are missing \(wind in .*\) in no stretch of a day; expected at least one"
        r" \(wind \(sun \[m/s\]\): no value in .* stand still; stuck_after = 0.0 under \[weather.wind_speed\] would",
    ):
        house(frame, mapping, system=tmp_path / "windy.toml")


def test_rows_twice_with_other_readings_say_how_unlike_they_are(house):
    frame, hours = measured()
    again = frame[(hours >= 48) & (hours < 50)].assign(room=lambda one: one["room"] + 5.0)
    again.loc[again.index[0], "kilowatts"] += 0.25
    twice = pd.concat([frame, again]).sort_index(kind="stable")
    report = house(twice)
    (note,) = [one for one in report.notes if "repeat the time stamp" in one]
    assert note == (
        "12 of 877 rows repeat the time stamp of the row before, and are counted with it: the first reading of each"
        " column is used; other readings of the same time differ from it: room in 12 by up to 5, kilowatts in 1 by up"
        " to 0.25 (as in the file)"
    )
    assert report.rows == 865


def test_of_changes_in_one_stamp_what_the_last_one_made_holds(house, tmp_path):
    """The last two persons leave within a minute: nobody is there, not one of them all night."""
    frame, hours = measured()
    by_day = hours % 24
    frame["presence"] = np.where(np.isclose(by_day, 8.0), "2", "")
    frame.loc[np.isclose(by_day, 17.0), "presence"] = "1"
    leaving = frame[np.isclose(by_day, 17.0)].assign(presence="0")
    both = pd.concat([frame, leaving]).sort_index(kind="stable")
    held = 'unit = "1"\nreading = "hold"\nmax_gap = 24.0'
    report = house(both, MAPPING.replace('unit = "presence"\npersons = 2.0\nreading = "mean"', held))
    (note,) = [one for one in report.notes if "repeat the time stamp" in one]
    assert "the first reading of each column is used (the last of presence, which holds); " in note
    with xr.open_dataset(tmp_path / "out" / "house.nc", decode_times=False) as data:
        persons = data["people"].values
    assert {0.0, 2.0} <= set(np.unique(persons)) and not ((persons > 0.9) & (persons < 1.1)).any()


@pytest.mark.parametrize("field", ["stamp = 'start'", "interval = 3600.0"])
def test_what_only_a_mean_has_is_refused_of_an_instant(house, field):
    """It would be passed over, and hourly means stamped at their start would be half an hour early."""
    frame, _ = measured()
    mapping = MAPPING.replace('column = "room"\n', f'column = "room"\n{field}\n')
    with pytest.raises(RecordingError, match=r"column 'room': .*which only a mean has; expected reading = 'mean'"):
        house(frame, mapping)


def test_two_meters_that_read_the_same_do_not_differ(house):
    """Of an input's instants as of means, and not where a constant stands in the first one's gaps."""
    frame, hours = measured()
    frame["set"] = frame["set 2"] = 20.0 + np.arange(len(frame)) % 7
    frame["valve 2"] = frame["valve"]
    frame.loc[(hours > 48) & (hours < 60), "valve"] = np.nan
    second = 'compare = { column = "valve 2", unit = "m3/h", scale = 2.4 }'
    mapping = HOURLY.replace("fill = 0.0\n", f"fill = 0.0\n{second}\n")
    mapping += '[variables.wish]\ncolumn = "set"\nunit = "degC"\nreading = "point"\n'
    mapping += 'compare = { column = "set 2", unit = "degC" }\n'
    found = {one.name: one for one in house(frame, mapping).comparisons}
    for name in ("air", "wish"):
        assert (found[name].mean_difference, found[name].largest_difference) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_constant_in_the_gaps_of_the_air_s_temperature_is_none_of_the_sky_s(house, tmp_path):
    frame, hours = measured()
    frame.loc[(hours > 96) & (hours < 116), "outside"] = np.nan
    report = house(
        frame, MAPPING.replace('column = "outside"\nunit = "degC"\n', 'column = "outside"\nunit = "degC"\nfill = 8.0\n')
    )
    assert "sky: the fill of temp_air is not one of it; its gaps are left" in report.notes
    with xr.open_dataset(tmp_path / "out" / "house.nc", decode_times=False) as data:
        assert (data["outdoors"] - data["sky"]).min() > 5.0


def test_rows_that_are_the_same_twice_differ_in_nothing(house):
    frame, _ = measured(days=2)
    frame["outside"] = [f"{one:.2f}" for one in frame["outside"]]
    again = frame.assign(outside=[f" {one}0" for one in frame["outside"]])
    report = house(pd.concat([frame, again]).sort_index(kind="stable"))
    (note,) = [one for one in report.notes if "repeat the time stamp" in one]
    assert note.endswith("the first reading of each column is used")


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        (
            MAPPING.replace("[variables.gas]", "[variable.gas]"),
            r"variable: unknown field .*expected one of schema_version, system, .*, variables, weather; did you mean"
            r" variables\?",
        ),
        (MAPPING.replace("scale = 2.4", "skale = 2.4"), r"skale: unknown field .* did you mean scale\?"),
        (
            MAPPING.replace("zone =", 'zones = "x"\nzone ='),
            r"time.zones: .*expected fields column, zone, stamps, format; did you mean zone",
        ),
        (
            MAPPING.replace('unit = "degF" }', 'unit = "degF", valid = [0, 1] }'),
            r"compare.valid: .*expected fields column, unit, scale, offset, persons$",
        ),
    ],
)  # fmt: skip
def test_unknown_fields_name_what_was_expected(house, mapping, said):
    with pytest.raises(RecordingError, match=said):
        house(measured(days=2)[0], mapping)


@pytest.mark.parametrize("parts", [1, 1000, 10**9])
def test_parts_of_a_second_since_1970(house, parts):
    frame, _ = measured(days=2)
    unix = pd.date_range("2022-10-27", periods=len(frame), freq="10min").as_unit("s").asi8
    mapping = MAPPING.replace("[time]", '[time]\nformat = "unix"')
    report = house(frame.assign(when=unix * parts), mapping)
    assert report.begin == "2022-10-27 01:00" and report.interval == 600.0


def test_mapping_and_measurements_in_the_wrong_order(tmp_path):
    (tmp_path / "log.csv").write_text(measured(days=2)[0].to_csv(index=False))
    (tmp_path / "map.toml").write_text(MAPPING)
    with pytest.raises(RecordingError, match=r"expected the mapping \(TOML\) first and the measurements second"):
        import_recording(tmp_path / "log.csv", tmp_path / "map.toml", out=tmp_path / "out.nc")


def test_lines_above_the_column_names_are_named(text):
    content = measured(days=2)[0].to_csv(index=False)
    for above in ("Logger 7\nRoom 12\n", "Logger,7\n,\n", "Logger 7, Room 12, the house,,,,,,,,,\nfirst\n"):
        with pytest.raises(RecordingError, match=r"; the column names are in line 3: expected file\.skip = 2$"):
            text(above + content)
        skipping = MAPPING.replace("[time]", "[file]\nskip = 2\n[time]")
        assert text(above + content, skipping).rows == 289
    with pytest.raises(RecordingError, match=r"; the column names are in line 1: expected file\.skip = 0$"):
        text(content, MAPPING.replace("[time]", "[file]\nskip = 2\n[time]"))


@pytest.mark.parametrize("stamp", ["", "yyyy-mm-dd hh:mm:ss"])
def test_a_row_of_units_is_named(text, stamp):
    names, *rows = measured(days=2)[0].to_csv(index=False).splitlines()
    units = ",".join([stamp, *["degC"] * (names.count(","))])
    with pytest.raises(
        RecordingError,
        match=rf"the row below the column names has no time and no numbers but '{stamp}', .*: units\?.*below = 1",
    ):
        text("\n".join([names, units, *rows]))
