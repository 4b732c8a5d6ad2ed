"""How a file of measurements is written: encoding, separator, decimal sign, lines above the readings, time stamps."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd

from diagnosis.measurements.clock import formats_of, read_naive
from diagnosis.measurements.formats import Rows, kind_of, sheets_of, spread
from diagnosis.measurements.mapping import File
from diagnosis.measurements.table import MARKS, MOST, SEPARATORS, joined, plain_name, read_file
from diagnosis.measurements.vocabulary import meaning_of, unit_in
from shared.errors import RecordingError
from shared.reading import MIB, MOST_COLUMNS, listed, read_bytes

LINES = 500
"""From which encoding aside the layout is read."""
ROWS = 100_000
"""From which all else is read, so that a year of minutes takes seconds: ten weeks of minutes, eleven years of hours."""
TWICE = 0.5
"""Share of the rows of which texts are fewer that say what a row is of."""
ALIKE = 0.9
"""Share of the lines that have as many fields as most of them, of a table."""
_TIME_OF_DAY = r"\d{1,2}:\d{2}(:\d{2})?([.,]\d+)?(\s*[AaPp][Mm])?"
_NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?")


@dataclass
class Layout:
    """How a file is written.

    Attributes
    ----------
    path, file, rows
        Where it is, the mapping's table ``[file]``, and what is read with it.
    columns, form
        Columns of the time stamps, and their format; empty if several read them all: ``forms`` then.
    wall
        The stamps as they read, without their zone, shape (rows,) [s]; NaN where they cannot be read.
    offset
        Whether the stamps carry their own offset from UTC that is not UTC's.
    units
        What a row below the names, or the cells, say of columns' units.
    why
        Reasons, by the field.
    """

    path: Path
    file: File
    rows: Rows
    columns: list[str]
    form: str
    forms: list[str]
    wall: np.ndarray
    offset: bool
    units: dict[str, str]
    why: dict[str, str] = field(default_factory=dict)

    @property
    def interval(self) -> float:
        """Usual spacing of the rows [s]; of several rows of one time stamp that of the stamps."""
        apart = np.abs(np.diff(self.wall[np.isfinite(self.wall)]))
        apart = apart[apart > 0]
        return float(np.median(apart)) if apart.size else 0.0


def layout_of(path: Path) -> Layout:
    """How a file is written.

    Raises RecordingError if it cannot be read, has no line of column names, or no column of times.
    """
    why: dict[str, str] = {}
    if kind_of(path) == "text":
        fields, names_at, below = _of_text(path, why)
    else:
        fields, names_at, below = _of_sheet(path, why)
    file = File(**fields, skip=names_at, below=below)
    rows = read_file(path, file, "")
    columns, forms = _time_columns(rows.frame.head(ROWS), path)
    if long := _long(rows.frame, columns):
        names, values = long
        file = file.model_copy(update={"names": names, "values": values})
        why["names"] = "each row holds one reading, and this column says of what"
        rows = spread(rows, names, values, path)
        order = np.argsort(read_naive(joined(rows.frame, columns), forms[0]), kind="stable")
        rows.frame = rows.frame.iloc[order].reset_index(drop=True)
        rows.without_units(file)
    rows.frame = rows.frame.head(ROWS)
    rows.frame.columns = pd.Index([plain_name(str(one)) for one in rows.frame.columns])
    rows.numeric = frozenset(plain_name(one) for one in rows.numeric)
    columns = [plain_name(one) for one in columns]
    frame = rows.frame
    units = _units_below(path, file, rows) if below and not long else {}
    units |= {plain_name(name): unit for name, unit in rows.units.items()}
    stamps = pd.Series([""] * len(frame), index=frame.index)
    for one in columns:
        stamps = (stamps + " " + frame[one].fillna("")).str.strip()
    there = stamps != ""
    wall = np.full(len(frame), np.nan)
    wall[there.to_numpy()] = read_naive(stamps[there], forms[0])
    offset = bool(stamps[there].str.contains(r":\d{2}.*[+-]\d{2}:?\d{2}$", regex=True).mean() > ALIKE)
    offset &= not stamps[there].str.contains(r"[+-]00:?00$", regex=True).all()
    decimal = _decimal(frame.drop(columns=columns), file, rows.numeric)
    if decimal == ",":
        why["decimal"] = "numbers such as " + _example(frame, r"[+-]?\d+,\d+")
    missing = _texts_for_nothing(frame.drop(columns=columns), decimal, file)
    if missing:
        why["missing"] = f"columns of numbers hold {listed(repr(one) for one in missing)}"
    file = file.model_copy(update={"decimal": decimal, "missing": [*file.missing, *missing]})
    form = forms[0] if len(forms) == 1 else ""
    return Layout(path, file, rows, columns, form, forms, wall, offset, units, why)


def _of_text(path: Path, why: dict[str, str]) -> tuple[dict[str, str], int, int]:
    """Encoding and separator of a text file, the line of its column names, and how many come before the readings."""
    data = read_bytes(path, RecordingError, "measurements", MOST)
    encoding = _encoding(data, why)
    text = data[: 4 * MIB].decode(encoding, errors="ignore").replace("\r\n", "\n").replace("\r", "\n")
    lines = list(islice(io.StringIO(text), LINES))
    if not text.strip():
        raise RecordingError(f"{path}: is empty; expected a line of column names and a row for each time")
    separator, width = _separator(lines, path)
    why["separator"] = f"most lines have {width} fields"
    records: list[tuple[int, list[str]]] = []
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    begin = 0
    try:
        for one in reader:
            if any(cell.strip() for cell in one):
                records.append((begin, [cell.strip() for cell in one]))
            begin = reader.line_num
    except csv.Error as error:
        raise RecordingError(f"{path}: line {begin + 1} is none of a CSV ({error}); expected measurements") from None
    names, below = _names_at(records, width, path, why)
    return {"encoding": encoding, "separator": separator}, names, below


def _encoding(data: bytes, why: dict[str, str]) -> str:
    for mark, name in MARKS:
        if data.startswith(mark):
            why["encoding"] = "the mark at its beginning"
            return name
    if data[:4096].count(0) > len(data[:4096]) / 4:
        why["encoding"] = "every other byte is zero"
        return "utf-16-le" if data[1:2] == b"\0" else "utf-16-be"
    for name in ("utf-8-sig", "cp1252"):
        try:
            data.decode(name)
        except UnicodeDecodeError:
            continue
        if name != "utf-8-sig":
            why["encoding"] = "it is not UTF-8; Windows writes this one in western Europe"
        return name
    why["encoding"] = "it is neither UTF-8 nor what Windows writes in western Europe: look at its letters"
    return "latin-1"


def _separator(lines: Sequence[str], path: Path) -> tuple[str, int]:
    """What separates the fields of most lines, and how many they have."""
    for sign in SEPARATORS:
        try:
            counts = Counter(len(one) for one in csv.reader(lines, delimiter=sign, skipinitialspace=True) if one)
        except csv.Error:
            continue
        table = {width: count for width, count in counts.items() if width > 1}
        if table:
            width, count = max(table.items(), key=lambda one: one[1])
            if count >= ALIKE * sum(counts.values()) - 10:  # lines above the table are few
                return sign, width
    raise RecordingError(
        f"{path}: lines have no fields separated by one of {', '.join(map(repr, SEPARATORS))}; expected a table"
    )


def _of_sheet(path: Path, why: dict[str, str]) -> tuple[dict[str, str], int, int]:
    """The sheet of an Excel file with most rows, the row of its names, and how many follow before readings."""
    if kind_of(path) != "excel":
        return {}, 0, 0
    sheets = sheets_of(path, read_bytes(path, RecordingError, "measurements", MOST), LINES)
    if not any(sheets.values()):
        raise RecordingError(f"{path}: has no sheet with cells; expected measurements")
    name = max(sheets, key=lambda one: sum(len(row) > 1 for row in sheets[one]))
    if sum(bool(rows) for rows in sheets.values()) > 1:
        why["sheet"] = f"of {listed(sheets)} the one with most rows of several cells"
    records = [(k, [*row]) for k, row in enumerate(sheets[name]) if any(row)]
    width = Counter(len(row) for _, row in records).most_common(1)[0][0]
    names, below = _names_at(records, width, path, why)
    return ({"sheet": name} if "sheet" in why else {}), names, below


def _names_at(records: Sequence[tuple[int, list[str]]], width: int, path: Path, why: dict[str, str]) -> tuple[int, int]:
    """Which line holds the column names, and how many lines follow it before the readings."""
    timed = [k for k, (_, row) in enumerate(records) if len(row) >= min(width, 2) and _has_time(row)]
    # a line above the table, as of its period, may hold a date: of readings the first comes below names or units
    below_names = [k for k in timed if k and k - 1 not in timed and len(records[k - 1][1]) >= max(2, width - 1)]
    first = next(iter([*below_names, *timed]), None)
    if first is None:
        raise RecordingError(
            f"{path}: no line begins like measurements: none of the first {len(records)} holds a date and time;"
            " expected a column of time stamps, as 2022-10-30 02:15"
        )
    wide = [k for k in range(first) if len(records[k][1]) >= max(2, width - 1)]
    if not wide:
        raise RecordingError(
            f"{path}: has no line of column names above its first readings, in line {records[first][0] + 1}; expected"
            " one: write it as the file's first line"
        )
    last = wide[-1]
    units = len(wide) > 1 and last == first - 1 and wide[-2] == last - 1 and _are_units(records[last][1])
    names = last - 1 if units else last
    below = first - names - 1
    if records[names][0]:
        why["skip"] = f"the names stand in line {records[names][0] + 1}"
    if below:
        why["below"] = "units, and no readings, stand below the names"
    return records[names][0], below


def _has_time(row: Sequence[str]) -> bool:
    """Whether a row holds a date, or a number that counts time: no column names do."""
    return any(bool(formats_of(pd.Series([cell]))) for cell in row)


def _are_units(row: Sequence[str]) -> bool:
    """Whether the cells of a row, but those that are empty, are mostly units."""
    cells = [one.strip("[]() ") for one in row]
    words = [one for one in cells if one and one != "-"]
    known = [one for one in words if unit_in("x", one)[0]]
    return not any(map(_NUMBER.fullmatch, words)) and (not words or len(known) >= 0.5 * max(len(words) - 1, 1))


def _units_below(path: Path, file: File, rows: Rows) -> dict[str, str]:
    above = read_file(path, file.model_copy(update={"below": 0}), "").frame
    return {str(name): str(above.iloc[0, k]).strip("[]() ") for k, name in enumerate(rows.frame.columns)}


def _time_columns(frame: pd.DataFrame, path: Path) -> tuple[list[str], list[str]]:
    """The columns of the time stamps, and the formats that read them all."""
    counted: list[tuple[str, list[str]]] = []
    for k, name in enumerate(map(str, frame.columns)):
        texts = frame.iloc[:, k].fillna("").str.strip()
        texts = texts[texts != ""]
        if len(texts) < 0.5 * len(frame) or not len(texts) or not (begin := formats_of(texts.head(50))):
            continue
        forms = formats_of(texts) or begin  # the import says which row of a later one cannot be read
        if forms in (["unix"], ["excel"]):
            counted.append((name, forms))
        elif forms:
            beside = _time_of_day(frame, k)
            if beside is not None and not texts.str.contains(":", regex=False).any():
                both = (texts + " " + frame[beside].reindex(texts.index).fillna("").str.strip()).str.strip()
                return [name, beside], formats_of(both) or formats_of(both.head(50))
            return [name], forms
    for name, forms in counted:
        texts = frame[name].fillna("").str.strip()
        apart = np.diff(read_naive(texts[texts != ""], forms[0]))
        # a register that rises through such numbers does so by uneven steps
        if (
            len(apart)
            and ((apart >= 0).all() or (apart <= 0).all())  # newest first
            and np.mean(np.abs(apart - np.median(apart)) <= 0.5 * np.abs(np.median(apart))) > 0.5
        ):
            return [name], forms
    raise RecordingError(
        f"{path}: no column holds times that can be read; found {listed(frame.columns)}; expected one as 2022-10-30"
        " 02:15, or in another format that date and time have in every row"
    )


def _long(frame: pd.DataFrame, columns: Sequence[str]) -> tuple[str, str] | None:
    """The column that says what each row's reading is, and that of the readings; None where a row has several.

    Most texts of the first are what people call measurements, and only one other column holds numbers.
    """
    others = [one for one in frame.columns if one not in columns and list(frame.columns).count(one) == 1]
    numbers = {one: float(frame[one].fillna("").str.strip().str.fullmatch(_NUMBER.pattern).mean()) for one in others}
    values = [one for one in others if numbers[one] > 0.5]
    if len(values) != 1:
        return None
    for one in others:
        if numbers[one] > 0:
            continue
        texts = frame[one].fillna("").str.strip()
        named = [text for text in texts.unique() if text]
        if not 2 <= len(named) <= MOST_COLUMNS or len(named) > TWICE * len(frame):
            continue
        if sum(bool(meaning_of(text).quantities) for text in named) >= 0.5 * len(named):
            return str(one), str(values[0])
    return None


def _time_of_day(frame: pd.DataFrame, beside: int) -> str | None:
    for k in (beside + 1, beside - 1):
        if 0 <= k < frame.shape[1]:
            texts = frame.iloc[:, k].fillna("").str.strip()
            texts = texts[texts != ""]
            if len(texts) and texts.str.fullmatch(_TIME_OF_DAY).all():
                return str(frame.columns[k])
    return None


def _decimal(frame: pd.DataFrame, file: File, numeric: frozenset[str]) -> str:
    """The decimal sign that more of the cells have."""
    commas = dots = 0
    for k, name in enumerate(frame.columns):
        if name in numeric:
            continue
        texts = frame.iloc[:, k].head(2000).fillna("").str.strip()
        commas += int(texts.str.fullmatch(r"[+-]?\d+,\d+").sum())
        dots += int(texts.str.fullmatch(r"[+-]?\d+\.\d+").sum())
    return "," if commas > dots else "."


def _example(frame: pd.DataFrame, pattern: str) -> str:
    for k in range(frame.shape[1]):
        texts = frame.iloc[:, k].fillna("").str.strip()
        found = texts[texts.str.fullmatch(pattern)]
        if len(found):
            return repr(str(found.iloc[0]))
    return "these"


def _texts_for_nothing(frame: pd.DataFrame, decimal: str, file: File) -> list[str]:
    """Short texts that stand in columns of numbers where there is no reading."""
    found: Counter[str] = Counter()
    for k in range(frame.shape[1]):
        texts = frame.iloc[:, k].fillna("").str.strip()
        texts = texts[~texts.isin(file.missing)]
        numbers = texts.str.replace(decimal, ".", regex=False).str.fullmatch(_NUMBER.pattern)
        if len(texts) and numbers.mean() > 0.5:
            found.update(one for one in texts[~numbers].unique() if 0 < len(one) <= 12 and not re.search(r"\d", one))
    return [one for one, _ in found.most_common(8) if one.lower() not in ("true", "false", "yes", "no", "on", "off")]
