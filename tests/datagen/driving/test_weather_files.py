"""The forms of weather files, written here from numbers of our own, and what is said about bad ones."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pvlib
import pytest

from datagen.driving.weather import read_weather
from datagen.driving.weather_files import read_hourly
from datagen.driving.weather_sun import check_still, check_sun
from shared.errors import WeatherError
from shared.signals import Weather

HOURS = np.arange(1, 8761)
PLACE = (52.25, 13.5, 1.0, 40.0)
"""Latitude, longitude, time zone [h], altitude [m]."""


def height_of_sun(latitude, longitude, zone):
    """Mean over each hour of the year of the sine of the sun's height, zero below, after Cooper (1969) and Spencer."""
    hour = np.arange(8760 * 12) / 12 + 1 / 24
    day = 2 * np.pi * hour / 8760
    declination = np.radians(23.45) * np.sin(2 * np.pi * (284 + 1 + hour / 24) / 365)
    equation = 229.2 * (0.000075 + 0.001868 * np.cos(day) - 0.032077 * np.sin(day)) / 60
    equation += 229.2 * (-0.014615 * np.cos(2 * day) - 0.04089 * np.sin(2 * day)) / 60
    angle = np.radians(15 * (hour - 12 + longitude / 15 - zone + equation))
    phi = np.radians(latitude)
    height = np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(angle)
    return np.maximum(height, 0).reshape(8760, 12).mean(axis=1)


def year():
    """A synthetic year, rounded as files round: readings at the hours' ends, radiation of the hours before."""
    height = height_of_sun(*PLACE[:3])
    cloud = 0.5 + 0.5 * np.sin(HOURS / 40)
    dni, dhi = np.round(np.where(height > 0.1, 800 * cloud, 0)), np.round(150 * height + 150 * height * (1 - cloud))
    temp = 9 + 10 * np.sin(2 * np.pi * (HOURS / 8760 - 0.3)) + 4 * np.sin(2 * np.pi * (HOURS - 9) / 24)
    return {
        "temp": np.round(temp, 1),
        "dew": np.round(temp - 4, 1),
        "humidity": np.full(8760, 75),
        "pressure": 101000 + 100 * (HOURS % 7),
        "infrared": np.round(300 + temp, 0),
        "ghi": np.round(dhi + dni * height),
        "dni": dni,
        "dhi": dhi,
        "direction": (HOURS * 10) % 360,
        "speed": np.round(3 + np.sin(HOURS / 5), 1),
        "cover": HOURS % 11,
    }


def columns(data, *names):
    return np.stack([np.broadcast_to(data[n] if isinstance(n, str) else n, 8760) for n in names], axis=1)


def write_epw(path: Path, data, rows=8760):
    lines = [f"LOCATION,Nowhere,-,XXX,made,0,{PLACE[0]},{PLACE[1]},{PLACE[2]},{PLACE[3]}"]
    lines += ["DESIGN CONDITIONS,0", "TYPICAL/EXTREME PERIODS,0", "GROUND TEMPERATURES,0"]
    lines += ["HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,made", "COMMENTS 2,made"]
    lines += ["DATA PERIODS,1,1,Data,Monday,1/1,12/31"]
    body = columns(data, "temp", "dew", "humidity", "pressure", 0, 0, "infrared", "ghi", "dni", "dhi", 0, 0, 0, 0)
    tail = columns(
        data, "direction", "speed", "cover", "cover", 20, 9999, 9, 999999999, 10, 0.1, 0, 88, 0.2, 0, 1
    ).tolist()
    body, day = body.tolist(), datetime(2001, 1, 1)
    for k in range(rows):
        at = day + timedelta(hours=k % 8760)
        left = ",".join(map(str, body[k % 8760]))
        right = ",".join(map(str, tail[k % 8760]))
        lines.append(f"2001,{at.month},{at.day},{at.hour + 1},60,?9,{left},{right}")
    path.write_text("\n".join(lines) + "\n")
    return path


def write_mos(path: Path, data, form="start"):
    """``start``: time 0 repeats 3600 s and the year's last row is dropped; ``full``: time 0 to the year's end."""
    body = columns(data, "temp", "dew", "humidity", "pressure", 0, 0, "infrared", "ghi", "dni", "dhi", 0, 0, 0, 0)
    tail = columns(data, "direction", "speed", "cover", "cover", 20, 2000, 9, 99, 10, 0.1, 0, 88, 0.2, 0, 1)
    table = np.concatenate([HOURS[:, None] * 3600.0, body, tail], axis=1)
    first = np.concatenate([[0.0], table[0, 1:]])[None]
    table = np.concatenate([first, table])[:8760] if form == "start" else np.concatenate([first, table])
    head = ["#1", f"double tab1({len(table)},{table.shape[1]})"]
    head += [f"#LOCATION,Nowhere,-,XXX,made,0,{PLACE[0]},{PLACE[1]},{PLACE[2]},{PLACE[3]}", "#DESIGN CONDITIONS,0"]
    head += ["#C1 Time in seconds. Beginning of a year is 0s."]
    path.write_text("\n".join(head + ["\t".join(map(str, row)) for row in table.tolist()]))
    return path


TMY3_COLUMNS = (
    "Date (MM/DD/YYYY),Time (HH:MM),GHI (W/m^2),DNI (W/m^2),DHI (W/m^2),OpqCld (tenths),Dry-bulb (C),"
    "Dew-point (C),RHum (%),Pressure (mbar),Wdir (degrees),Wspd (m/s)"
)


def write_tmy3(path: Path, data, header=TMY3_COLUMNS, first_year=1988):
    body = columns(data, "ghi", "dni", "dhi", "cover", "temp", "dew", "humidity", data["pressure"] / 100)
    body, tail = body.tolist(), columns(data, "direction", "speed").tolist()
    lines = [f'0,"NOWHERE",XX,{PLACE[2]},{PLACE[0]},{PLACE[1]},{PLACE[3]}', header]
    for k in range(8760):
        at = datetime(2001, 1, 1) + timedelta(hours=k)
        values = ",".join(map(str, body[k] + tail[k]))
        # each month of a typical year comes from a year of its own
        lines.append(f"{at.month:02}/{at.day:02}/{first_year + at.month % 5},{at.hour + 1:02}:00,{values}")
    path.write_text("\n".join(lines) + "\n")
    return path


SAM_COLUMNS = "DHI,DNI,GHI,Dew Point,Surface Albedo,Wind Direction,Wind Speed,Temperature,Pressure"


def write_sam(path: Path, data, minute: int | None = 30, zone=PLACE[2], local=PLACE[2]):
    """``minute`` 30 as NSRDB writes it, None as SAM does, for whom a stamp names the hour's start."""
    stamp = "Year,Month,Day,Hour," + ("" if minute is None else "Minute,")
    lines = ["Source,Location ID,City,State,Country,Latitude,Longitude,Time Zone,Elevation,Local Time Zone"]
    lines += [f"{'NSRDB' if minute else 'IWEC'},1,-,-,-,{PLACE[0]},{PLACE[1]},{zone:g},{PLACE[3]:g},{local:g}"]
    lines += [stamp + SAM_COLUMNS]
    body = columns(data, "dhi", "dni", "ghi", "dew", 0.2, "direction", "speed", "temp", data["pressure"] / 100)
    for k, values in enumerate(np.roll(body, int(zone - local), axis=0).tolist()):
        at = datetime(2001, 1, 1) + timedelta(hours=k)
        when = f"1998,{at.month},{at.day},{at.hour}" + ("" if minute is None else f",{minute}")
        lines.append(f"{when},{','.join(map(str, values))}")
    path.write_text("\n".join(lines) + "\n")
    return path


def write_pvgis(path: Path, data):
    """Rows are of UTC, an hour before the place's; radiation is of half an hour after the stamp, in the next hour."""
    lines = [f"Latitude (decimal degrees): {PLACE[0]}", f"Longitude (decimal degrees): {PLACE[1]}"]
    lines += [f"Elevation (m): {PLACE[3]}", "Irradiance Time Offset (h): 0.5", "month,year"]
    lines += [f"{month},2007" for month in range(1, 13)]
    lines += ["time(UTC),T2m,RH,G(h),Gb(n),Gd(h),IR(h),WS10m,WD10m,SP"]
    sun = {name: np.roll(data[name], -1) for name in ("ghi", "dni", "dhi")}
    body = columns(data | sun, "temp", "humidity", "ghi", "dni", "dhi", "infrared", "speed", "direction", "pressure")
    for k, values in enumerate(body.tolist()):
        at = datetime(2001, 1, 1) + timedelta(hours=k)
        lines.append(f"2007{at:%m%d:%H}00,{','.join(map(str, values))}")
    path.write_bytes("\r\n".join([*lines, "", "T2m: 2-m air temperature (degree Celsius)", ""]).encode())
    return path


WRITERS = {
    "tmy3": (write_tmy3, "w.csv"),
    "epw": (write_epw, "w.epw"),
    "mos": (write_mos, "w.mos"),
    "full mos": (lambda path, data: write_mos(path, data, "full"), "w.mos"),
    "nsrdb": (write_sam, "w.csv"),
    "nsrdb in utc": (lambda path, data: write_sam(path, data, zone=0.0), "w.csv"),
    "sam": (lambda path, data: write_sam(path, data, None), "w.csv"),
    "pvgis": (write_pvgis, "w.csv"),
}
NOT_THERE = {"tmy3": ["infrared"], "nsrdb": ["infrared", "opaque_cover"], "pvgis": ["opaque_cover"]}
NOT_THERE |= {"sam": NOT_THERE["nsrdb"], "nsrdb in utc": NOT_THERE["nsrdb"]}


@pytest.mark.parametrize("form", WRITERS)
def test_every_form_gives_the_numbers_written(tmp_path, form):
    data = year()
    write, name = WRITERS[form]
    record = read_hourly(write(tmp_path / name, data))
    # a .mos that drops the year's end has the first hour there
    rows = slice(0, 8759) if form == "mos" else slice(None)
    got = record.columns
    assert sorted(record.absent) == NOT_THERE.get(form, [])
    np.testing.assert_allclose(got["temp_air"][rows], data["temp"][rows] + 273.15)
    if form != "pvgis":  # which has the humidity
        np.testing.assert_allclose(got["temp_dew"][rows], data["dew"][rows] + 273.15)
    np.testing.assert_allclose(got["pressure"][rows], data["pressure"][rows])
    for ours, theirs in (("ghi", "ghi"), ("dni", "dni"), ("dhi", "dhi"), ("wind_speed", "speed")):
        np.testing.assert_allclose(got[ours][rows], data[theirs][rows])
    np.testing.assert_allclose(got["wind_direction"][rows], data["direction"][rows])
    for ours, theirs in (("opaque_cover", "cover"), ("infrared", "infrared")):
        if ours in got:
            np.testing.assert_allclose(got[ours][rows], data[theirs][rows])
    if form == "mos":
        assert got["temp_air"][-1] == got["temp_air"][0]
    assert (record.latitude, record.longitude, record.utc_offset, record.altitude) == PLACE
    assert record.sun_later == 0.0
    check_sun(tmp_path / name, record)
    assert check_still(tmp_path / name, record).columns.keys() == got.keys()


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """An EPW file to the letter."""
    path = write_epw(tmp_path_factory.mktemp("plain") / "w.epw", year())
    return path.read_text(), read_hourly(path)


def test_a_far_place_under_greenwich_s_clock_is_moved_to_its_own(tmp_path, plain, caplog):
    text, expected = plain
    lines = text.replace(f"{PLACE[1]},{PLACE[2]},", "-80.0,0,").splitlines()
    (tmp_path / "w.epw").write_text("\n".join(lines))
    record = read_hourly(tmp_path / "w.epw")
    assert record.utc_offset == -5
    assert "stamps are of UTC+0 and its place at longitude -80: its rows are moved to UTC-5" in caplog.text
    # 1 o'clock of Greenwich is 20 o'clock of the day before
    for name, values in expected.columns.items():
        np.testing.assert_array_equal(record.columns[name], np.roll(values, -5))


def test_pvlib_s_readers_find_the_same_numbers(tmp_path):
    data = year()
    tools = pvlib.iotools
    nsrdb, _ = tools.read_nsrdb_psm4(write_sam(tmp_path / "n.csv", data))
    pvgis, _ = tools.read_pvgis_tmy(write_pvgis(tmp_path / "p.csv", data))
    epw, _ = tools.read_epw(write_epw(tmp_path / "w.epw", data))
    for path, theirs, radiation in (("n.csv", nsrdb, 0), ("p.csv", pvgis, 1), ("w.epw", epw, 0)):
        ours = read_hourly(tmp_path / path).columns
        np.testing.assert_allclose(ours["temp_air"], theirs["temp_air"] + 273.15)
        for name in ("ghi", "dni", "dhi"):
            np.testing.assert_allclose(ours[name], np.roll(theirs[name], radiation))


def test_instants_of_an_hour_s_end_bring_their_sun_with_them(tmp_path):
    """NSRDB's rows at minute 0: readings are of the stamp, radiation of the hour's first moment."""
    data = year()
    record = read_hourly(write_sam(tmp_path / "w.csv", data, 0))
    assert record.sun_later == 0.0  # SAM's, without a source that says instants
    (tmp_path / "n.csv").write_text((tmp_path / "w.csv").read_text().replace("IWEC", "NSRDB"))
    record = read_hourly(tmp_path / "n.csv")
    assert record.sun_later == -0.5
    np.testing.assert_allclose(record.columns["temp_air"], np.roll(data["temp"], -1) + 273.15)
    np.testing.assert_allclose(record.columns["ghi"], data["ghi"])


def test_what_is_not_there_is_worked_out(tmp_path, caplog):
    """Global of the two others, pressure of the altitude, and dew point of the humidity (Magnus: 75 % at 10 degC)."""
    data = year()
    data["temp"] = np.where(HOURS == 5, 10.0, data["temp"])
    text = write_sam(tmp_path / "w.csv", data).read_text()
    text = text.replace("DNI,GHI,Dew Point", "DNI,GH illum,x").replace("Pressure", "Alb")
    (tmp_path / "w.csv").write_text(text)
    record = read_hourly(tmp_path / "w.csv")
    assert np.abs(record.columns["ghi"] - data["ghi"]).mean() < 2
    assert record.columns["pressure"][0] == pytest.approx(101325 * (1 - 2.25577e-5 * 40) ** 5.25588, rel=1e-4)
    assert "has no global horizontal radiation: it is worked out" in caplog.text
    dew = read_hourly(write_pvgis(tmp_path / "p.csv", data)).columns["temp_dew"]
    assert dew[4] == pytest.approx(5.8 + 273.15, abs=0.1)


def test_optional_columns_may_be_missing(tmp_path):
    data = year()
    data["direction"] = np.where(HOURS == 100, 999, data["direction"])
    data["infrared"] = np.full(8760, 9999)
    table = read_weather(Weather(files=["x"]), write_epw(tmp_path / "w.epw", data).name, tmp_path)
    assert "temp_sky" in table.columns  # from the sky cover
    assert "wind_direction" not in table.units
    with pytest.raises(WeatherError, match=r"w\.epw: offers no wind_direction: wind direction is missing or out of"):
        table.signal("wind_direction", 0, 3600)
    data["cover"] = np.full(8760, 99)
    table = read_weather(Weather(files=["x"]), write_epw(tmp_path / "v.epw", data).name, tmp_path)
    with pytest.raises(
        WeatherError, match=r"offers no temp_sky: .*infrared.*; opaque sky cover .*expected infrared, or"
    ):
        table.values("temp_sky")


def test_a_short_gap_of_infrared_leaves_the_sky_of_all_other_hours(tmp_path, caplog):
    first, hours = 100, 12
    data = year()
    whole = read_weather(Weather(files=["x"]), write_epw(tmp_path / "w.epw", data).name, tmp_path).values("temp_sky")
    gap = np.isin(HOURS, (np.arange(first, first + hours) - 1) % 8760 + 1)
    data["infrared"] = np.where(gap, 9999, data["infrared"])
    with caplog.at_level("WARNING", logger="zeroshot"):
        table = read_weather(Weather(files=["x"]), write_epw(tmp_path / "v.epw", data).name, tmp_path)
    found = table.values("temp_sky")[1:]
    np.testing.assert_array_equal(found[~gap], whole[1:][~gap])
    # 1 W/m2 and K of the air are 0.2 K; the air changes by 4 K in six hours
    assert np.abs(found[gap] - whole[1:][gap]).max() < 2.0
    assert f"missing or out of range in {hours} of 8760 hours" in caplog.text
    assert f"at most {hours} in a row: it is interpolated" in caplog.text


def _edit(path, number, text):
    lines = path.read_text().splitlines()
    lines[number] = text if text is not None else ""
    path.write_text("\n".join(line for line in lines if line))
    return path


def _cut(path, lines):
    path.write_text("\n".join(path.read_text().splitlines()[:lines]))
    return path


def _replaced(name, hour, value):
    data = year()
    data[name] = np.where(hour == HOURS, value, data[name])
    return data


BAD = {
    "no such file": (lambda d: d / "none.epw", r"none\.epw: no such weather file; expected EPW, TMY3"),
    "half hours": (
        lambda d: write_epw(d / "w.epw", year(), 17520),
        r"found 17520 hourly rows, 30 min apart: keep or average to one row an hour; expected 8760",
    ),
    "a day too many": (
        lambda d: write_epw(d / "w.epw", year(), 8784),
        r"line 1425 is of 3/1 1 h \(month/day, hour\); expected the hour after that of line 1424",
    ),
    "missing code": (
        lambda d: write_epw(d / "w.epw", _replaced("temp", 7, 99.9)),
        r"dry-bulb temperature is missing or out of range in 1 of 8760 hours, first in hour 7 "
        r"\(373\.05, expected 190 to 340 in SI\); expected a value in every hour",
    ),
    "column missing": (
        lambda d: write_tmy3(d / "w.csv", year(), TMY3_COLUMNS.replace("DNI (W/m^2)", "Beam")),
        r"w\.csv: direct normal radiation is not there; expected a value in every hour",
    ),
    "another csv": (
        lambda d: (d / "w.csv").write_text("a,b\n1,2\n") and d / "w.csv",
        r"w\.csv: begins with 'a,b', as no weather file does .*; expected EPW, TMY3, .*PVGIS's CSV$",
    ),
    "json": (
        lambda d: (d / "w.json").write_text("{}") and d / "w.json",
        r"is JSON, so download the same as CSV or EPW",
    ),
    "no rows": (lambda d: _cut(write_epw(d / "w.epw", year(), 1), 8), r"has no rows below the header of EPW"),
    "no place": (
        lambda d: _edit(write_epw(d / "w.epw", year()), 0, "LOCATION,a,b,c,d,e,north,1,2,3"),
        r"line 1 is 'LOCATION,a.*; expected latitude, longitude, time zone, altitude as numbers in a row",
    ),
    "nsrdb without place": (
        lambda d: _edit(write_sam(d / "w.csv", year()), 1, "NSRDB,1,-,-,-,x,13.5,1,40,1"),
        r"latitude is 'x'; expected a number on line 2 under its name on line 1",
    ),
    "place off the earth": (
        lambda d: _edit(write_mos(d / "w.mos", year()), 2, "#LOCATION,a,b,c,d,e,100,1,2,3"),
        r"place is latitude 100, longitude 1, time zone 2, altitude 3; expected degrees north",
    ),
    "row cut short": (
        lambda d: _edit(write_mos(d / "w.mos", year()), 50, "3600 1 2 3"),
        r"w\.mos: rows have 4, 30 columns; expected 30 in every row",
    ),
    "hour missing": (
        lambda d: _edit(write_mos(d / "w.mos", year()), 50, None),
        r"w\.mos: found 8759 rows from 0 to 3\.15324e\+07 s; expected hourly rows over one common year, 0 to 31536000",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_in_one_sentence(tmp_path, case):
    make, text = BAD[case]
    with pytest.raises(WeatherError, match=text) as caught:
        read_hourly(make(tmp_path))
    assert "\n" not in str(caught.value)
