"""Files as loggers, spreadsheets and power cuts leave them: read as they were meant, or refused with their name."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from diagnosis.measurements.mapping import Mapping
from diagnosis.measurements.table import Measurements, read_measurements
from shared.errors import RecordingError

TEXT = 'when,room,note\n2022-03-01 00:00,20.5,"a, b"\n2022-03-01 01:00,-21.25,c\n2022-03-01 02:00,22,\n'


@pytest.fixture
def read(tmp_path):
    """Read bytes as measurements; the table ``[file]`` is given by its fields."""

    def run(content, **file):
        (tmp_path / "log.csv").write_bytes(content)
        raw = {
            "schema_version": 1,
            "file": file,
            "time": {"column": "when", "zone": "UTC"},
            "variables": {"warmth": {"column": "room", "unit": "degC"}},
        }
        return read_measurements(tmp_path / "log.csv", Mapping.model_validate(raw))

    return run


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_line_ends_and_marks_of_any_system(read, end, encoding):
    declared = {} if encoding.startswith("utf-8") else {"encoding": encoding}
    found = read(TEXT.replace("\n", end).encode(encoding), **declared)
    np.testing.assert_array_equal(found.numbers("room", "here"), [20.5, -21.25, 22.0])
    np.testing.assert_array_equal(np.diff(found.utc), [3600.0, 3600.0])
    assert list(found.columns["note"]) == ["a, b", "c", ""]


def test_a_file_whose_newest_row_comes_first_is_read_from_its_end(read):
    names, *rows = TEXT.strip().split("\n")
    found = read("\n".join([names, *rows[::-1]]).encode())
    np.testing.assert_array_equal(found.numbers("room", "here"), [20.5, -21.25, 22.0])
    assert list(found.columns["note"]) == ["a, b", "c", ""]
    counted = [row.replace(row[:16], str(44621 + k / 24)) for k, row in enumerate(rows)]
    serial = read("\n".join([names, *counted[::-1]]).encode())
    np.testing.assert_array_equal(serial.numbers("room", "here"), [20.5, -21.25, 22.0])
    assert found.notes == ["rows are newest first, and are read from the last one on"]
    with pytest.raises(RecordingError, match=r"time runs backwards from row 2 .* sort them, or remove the rows that"):
        read("\n".join([names, *rows[1:], rows[0]]).encode())


@pytest.mark.parametrize(
    ("content", "file", "said"),
    [
        (TEXT.encode("utf-16"), {}, r"cannot be read as text in 'utf-8-sig' .*file\.encoding; is it 'utf-16'\?"),
        (TEXT.encode("utf-16-le"), {}, r"line 1 has a null character.*file\.encoding \('utf-16-le'\?\)"),
        (TEXT.encode() + bytes(99), {}, "line 5 has a null character"),
        (TEXT.replace("note", "°C").encode("latin-1"), {}, r"expected .* file\.encoding, such as 'utf-16' or 'cp1252'"),
        (TEXT.encode(), {"encoding": "a\0b"}, "cannot be read as text in 'a.x00b'"),
        (TEXT.replace("note", "x" * 200_000).encode(), {}, "line of column names: .*; expected the names"),
        (
            TEXT.replace(",c\n", ',"c\n').replace("22,\n", '22,\n2022-03-01 03:00,22,d"\n').encode(),
            {},
            r"row 2: column 'note': a cell goes on over 3 lines, which are rows of the table; .* not closed\?",
        ),
        (TEXT.replace(",c\n", ',"c\n').encode(), {}, "a quotation mark in line 3 is not closed until the end"),
        (
            TEXT.encode() + b"2022-03-01 03:00,22,d,\n",
            {},
            "line 5 has 4 fields, separated by ',', and lines before it 3",
        ),
        (TEXT.encode() + b"2022-1", {}, r"row 4 \('2022-1'\) .*; it is the last one and shorter .*cut off there\?"),
        (b"\n", {}, "is empty; expected a line of column names"),
        (TEXT.splitlines()[0].encode(), {}, "has 0 rows; expected at least a day"),
    ],
)
def test_what_is_no_such_text_is_refused(read, content, file, said):
    with pytest.raises(RecordingError, match=rf"log\.csv: .*{said}"):
        read(content, **file)


@pytest.mark.parametrize(
    "content",
    [
        TEXT + ' , ," "\n\x1a',
        TEXT.replace("when,room,note", '"when", "room", "note"').replace(",20.5,", ', "20.5",'),
        TEXT.replace("when,room", "\u200bwhen,room"),
        "when,room,note\n" + "\n".join(f"{k},{line}" for k, line in enumerate(TEXT.splitlines()[1:], 1)),
    ],
)
def test_what_programs_add_to_a_table_is_no_part_of_it(read, content):
    """Rows without a cell, blanks before quotation marks, blanks that do not break, numbers of rows without a name."""
    found = read(content.encode())
    np.testing.assert_array_equal(found.numbers("room", "here"), [20.5, -21.25, 22.0])


def test_all_columns_that_are_not_there_are_named(tmp_path):
    (tmp_path / "log.csv").write_text(TEXT)
    raw = {"schema_version": 1, "time": {"column": "wen", "zone": "UTC"}}
    raw["variables"] = {"warmth": {"column": "rooms", "unit": "degC", "compare": {"column": "x", "unit": "degC"}}}
    with pytest.raises(
        RecordingError,
        match=r"time.column: no column 'wen'; did you mean when\?; variables.warmth: no column 'rooms'; did you mean"
        r" room\?; variables.warmth.compare: no column 'x'; found when, room, note",
    ):
        read_measurements(tmp_path / "log.csv", Mapping.model_validate(raw))


def test_a_row_without_a_stamp_that_holds_a_reading_is_refused(read):
    with pytest.raises(RecordingError, match="row 4 has no time stamp; expected one in each row that holds something"):
        read((TEXT + ",23,\n").encode())
    assert read((TEXT + ",,mean of all\n").encode()).notes == [
        "1 rows without a time stamp hold nothing that is mapped, and are left out"
    ]


def test_units_below_the_names(read):
    names, *rows = TEXT.splitlines()
    found = read("\n".join([names, ",°C,-", *rows]).encode(), below=1)
    np.testing.assert_array_equal(found.numbers("room", "here"), [20.5, -21.25, 22.0])


def numbers_of(texts, decimal):
    data = Measurements(
        Path("log.csv"), np.arange(float(len(texts))), "UTC", pd.DataFrame({"heat": texts}), decimal, {""}
    )
    return data.numbers("heat", "here"), data.notes


@pytest.mark.parametrize(
    ("texts", "decimal", "numbers"),
    [
        (["1.523,5", "12", "0,25", "-1.234.567"], ",", [1523.5, 12.0, 0.25, -1234567.0]),
        (["985", "1.020", "", "12.400"], ",", [985.0, 1020.0, np.nan, 12400.0]),
        (["21.5", "3.4", "0.125"], ",", [21.5, 3.4, 0.125]),
        (["985.25", "1020.5", "1e3"], ".", [985.25, 1020.5, 1000.0]),
    ],
)
def test_what_can_only_be_one_thing_is_read_as_it(texts, decimal, numbers):
    found, notes = numbers_of(texts, decimal)
    np.testing.assert_array_equal(found, numbers)
    assert bool(notes) == any("of thousands" in note for note in notes)
    assert bool(notes) == (decimal == "," and np.nanmax(np.abs(found)) > 1000)


@pytest.mark.parametrize(
    ("texts", "decimal"),
    [
        (["1.532", "2.140", "1.875"], ","),
        (["985", "1,020", "930"], ","),
    ],
)
def test_what_can_be_either_is_refused(texts, decimal):
    with pytest.raises(RecordingError, match="may be of thousands or of decimals"):
        numbers_of(texts, decimal)
