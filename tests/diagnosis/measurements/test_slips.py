"""Slips in the file, the mapping and the call: the sentence names what was meant."""

import pandas as pd
import pytest

from diagnosis.measurements.importer import import_recording
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
    expected = r"rows have \d+ fields under 1 column names; .*; is file.separator ';' \(and file.decimal ','\)\?$"
    with pytest.raises(RecordingError, match=expected):
        text(content)
    with pytest.raises(RecordingError, match=r"no column 'when'; .*is file.separator '\\t'.*\?$"):
        text(measured(days=2)[0].to_csv(index=False, sep="\t"))
    commas = measured(days=2)[0].to_csv(index=False)
    with pytest.raises(RecordingError, match=r"separator ';'\); is file.separator ','\?$"):
        text(commas, MAPPING.replace("[time]", '[file]\nseparator = ";"\n[time]'))


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


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        (
            MAPPING.replace("[variables.gas]", "[variable.gas]"),
            r"variable: unknown field .*expected one of schema_version, system, .*, weather, given; did you mean"
            r" variables\?",
        ),
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


def test_mapping_and_measurements_in_the_wrong_order(tmp_path):
    (tmp_path / "log.csv").write_text(measured(days=2)[0].to_csv(index=False))
    (tmp_path / "map.toml").write_text(MAPPING)
    with pytest.raises(
        RecordingError, match=r"log.csv, .*map.toml: expected a mapping \(TOML\) and its measurements in"
    ):
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
    expected = rf"the row below the column names has no time and no numbers but '{stamp}', .*: units\?.*below = 1"
    with pytest.raises(RecordingError, match=expected):
        text("\n".join([names, units, *rows]))
