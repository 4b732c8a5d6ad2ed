"""Measurements that are no text: the same numbers as from a CSV; what is no log, or hides its size, is refused."""

import zipfile

import numpy as np
import pandas as pd
import pytest

from diagnosis.measurements.mapping import Mapping
from diagnosis.measurements.table import read_measurements
from shared.errors import RecordingError

TIME = pd.date_range("2022-03-01", periods=50, freq="h")
FRAME = pd.DataFrame(
    {
        "when": TIME,
        "room": np.where(np.arange(50) == 7, np.nan, 20.0 + 0.125 * np.arange(50)),
        "heat": np.arange(50) + 1000.375,
        "on": np.arange(50) % 2 == 0,
        "note": ["fine"] * 50,
    }
)


def mapping(**file):
    variables = {name: {"column": name, "unit": "degC"} for name in ("room", "heat", "on")}
    raw = {"schema_version": 1, "file": file, "time": {"column": "when", "zone": "UTC"}, "variables": variables}
    return Mapping.model_validate(raw)


def write_excel(path, frame=FRAME):
    pytest.importorskip("openpyxl")
    frame.to_excel(path, index=False)


def write_parquet(path):
    pytest.importorskip("pyarrow")
    FRAME.set_index("when").to_parquet(path)


def write_netcdf(path):
    FRAME.drop(columns="note").assign(on=FRAME["on"].astype("int8")).set_index("when").to_xarray().to_netcdf(path)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("write", [write_excel, write_parquet, write_netcdf])
def test_the_numbers_of_a_csv(tmp_path, write, decimal):
    """Whatever the file is called; its numbers have no decimal sign and no thousands."""
    write(tmp_path / ("log.xlsx" if write is write_excel else "log"))
    FRAME.assign(on=FRAME["on"].astype(int)).to_csv(tmp_path / "log.csv", index=False)
    path = next(one for one in tmp_path.iterdir() if one.suffix != ".csv")
    found, text = read_measurements(path, mapping(decimal=decimal)), read_measurements(tmp_path / "log.csv", mapping())
    np.testing.assert_array_equal(found.utc, text.utc)
    for name in ("room", "heat", "on"):
        np.testing.assert_array_equal(found.numbers(name, ""), text.numbers(name, ""))


def test_excel_as_offices_write_it(tmp_path):
    """Title, names, units, dates apart from times of day, a formula's error, and text numbers with a decimal comma."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    for row in (["Plant 7"], [], ["Tag", "Zeit", "Raum\n(innen)"], [None, None, "°C"]):
        sheet.append(row)
    for k, time in enumerate(TIME):
        sheet.append([time.date(), time.time(), "#N/A" if k == 3 else f"{20 + k / 2:.1f}".replace(".", ",")])
    book.create_sheet("about").append(["made for a test"])
    book.save(tmp_path / "log.xlsx")
    raw = {
        "schema_version": 1,
        "file": {"sheet": "Sheet", "skip": 2, "below": 1, "decimal": ","},
        "time": {"column": ["Tag", "Zeit"], "zone": "UTC"},
        "variables": {"warmth": {"column": "Raum (innen)", "unit": "degC"}},
    }
    found = read_measurements(tmp_path / "log.xlsx", Mapping.model_validate(raw))
    np.testing.assert_array_equal(found.utc, (TIME - pd.Timestamp(0)) / pd.Timedelta(1, "s"))
    values = found.numbers("Raum (innen)", "")
    assert np.isnan(values[3]) and values[-1] == 44.5
    del raw["file"]["sheet"]
    with pytest.raises(RecordingError, match=r"several sheets with cells, Sheet, about; expected one of them as file"):
        read_measurements(tmp_path / "log.xlsx", Mapping.model_validate(raw))


def repacked(path, change):
    """An Excel file with its sheet changed."""
    write_excel(path)
    with zipfile.ZipFile(path) as archive:
        parts = {one.filename: archive.read(one) for one in archive.infolist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(name, change(data) if name.endswith("sheet1.xml") else data)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data + b" " * 40_000_000, r"unpacks from .* MiB; expected a log"),
        (lambda data: b'<!DOCTYPE a [<!ENTITY b "c">]>' + data, "declares a DOCTYPE"),
        (
            lambda data: data.replace(
                b"</sheetData>", b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>'
            ),
            "has 1048576 rows of 16384 columns; expected a table of at most",
        ),
        (lambda data: data[:-300], "cannot be read as an Excel file"),
    ],
)
def test_an_excel_file_that_hides_its_size_or_is_damaged(tmp_path, change, said):
    repacked(tmp_path / "log.xlsx", change)
    with pytest.raises(RecordingError, match=said):
        read_measurements(tmp_path / "log.xlsx", mapping())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xd0\xcf\x11\xe0" + bytes(99), "Excel file of before 2007; expected it saved as .xlsx"),
        (b"\x1f\x8b" + bytes(99), "is compressed; expected it unpacked"),
        (b"\x89HDF" + bytes(99), "cannot be read as NetCDF"),
    ],
)
def test_what_cannot_be_read_says_what_could(tmp_path, content, said):
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=said):
        read_measurements(tmp_path / "log.csv", mapping())
