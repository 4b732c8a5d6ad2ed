"""The measurement file: its rows in the order of time, its columns as numbers."""

from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from diagnosis.measurements.clock import read_naive, read_stamps, runs_backwards
from diagnosis.measurements.formats import Rows, kind_of, read_rows, spread
from diagnosis.measurements.mapping import File, Mapping, missing_columns
from diagnosis.measurements.units import LARGEST
from shared.errors import RecordingError
from shared.reading import MIB, check_columns, listed, read_bytes, shown, why

_GROUPED = r"[+-]?\d+([.,'\u2019\s\u00a0\u202f]\d+)+"
"""Digits with a sign between them that is not read as the decimal one."""


def with_dots(text: pd.Series, decimal: str, where: str) -> tuple[pd.Series, list[str]]:
    """Texts of numbers with a dot as decimal sign, and sentences on what was understood.

    Dots beside a decimal comma are of thousands where each of them can be and something says so: a comma, or whole
    numbers as large as those before a thousand. Raises RecordingError if a sign may be of thousands or of decimals, or
    a number has one that is neither.
    """
    notes = []
    whole = text.str.fullmatch(r"[+-]?\d+").fillna(False).astype(bool)
    large = bool((whole & (text.str.lstrip("+-").str.len() == 3)).any())
    if decimal == ",":
        dotted = text.str.fullmatch(r"[+-]?\d+(\.\d+)+(,\d*)?").fillna(False).astype(bool)
        thousands = text.str.fullmatch(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?").fillna(False).astype(bool)
        if thousands.any():
            said = bool(text.str.contains(",", regex=False).fillna(False).any()) or large
            if not said or (dotted & ~thousands).any():
                raise _either(text, dotted, where, decimal)
            count = int(thousands.sum())
            notes.append(f"dots of {count} numbers such as {shown(text[thousands].iloc[0])} are taken as of thousands")
        text = text.where(~thousands, text.str.replace(".", "", regex=False))
    parted = text.str.contains(decimal, regex=False).fillna(False).astype(bool)
    alike = text.str.fullmatch(rf"[+-]?[1-9]\d{{0,2}}\{decimal}\d{{3}}").fillna(False).astype(bool)
    small = whole & (text.str.lstrip("+-").str.len() <= 3)
    if parted.any() and (parted == alike).all() and (parted | small | text.isna()).all():
        if large:
            raise _either(text, parted, where, decimal)
        if whole.any() and (text[whole].str.strip("+-0") == "").all():
            notes.append(
                f"numbers such as {shown(text[parted].iloc[0])} are taken as with three decimals, not thousands"
            )
    if decimal == ",":
        text = text.str.replace(",", ".", regex=False)
    odd = text.str.fullmatch(_GROUPED).fillna(False).astype(bool) & ~text.str.fullmatch(r"[+-]?\d+\.\d+").fillna(False)
    if odd.any():
        row = int(odd.to_numpy().argmax())
        raise RecordingError(
            f"{where} holds {shown(text.iloc[row])} in row {row + 1}, a number with a separator of thousands or another"
            f" decimal sign than {decimal!r}; expected none (file.decimal?)"
        )
    return text, notes


def _either(text: pd.Series, which: pd.Series, where: str, decimal: str) -> RecordingError:
    return RecordingError(
        f"{where} holds numbers such as {shown(text[which].iloc[0])}, whose sign may be of thousands or of decimals;"
        f" expected numbers without separators of thousands, with decimals after {decimal!r} (file.decimal)"
    )


_LOOKED_AT = 200
"""Lines among which the column names are looked for."""


def skipped(text: str, settings: File, column: str) -> str:
    """What to skip so that the names are read, of a file in whose first lines ``column`` is named; else empty."""
    for number, line in enumerate(islice(io.StringIO(text), _LOOKED_AT)):
        try:
            names = next(csv.reader([line], delimiter=settings.separator, skipinitialspace=True), [])
        except (csv.Error, ValueError, TypeError):  # what csv does not take stands in no line of names
            continue
        if number != settings.skip and plain_name(column) in map(plain_name, names):
            return f"; the column names are in line {number + 1}: expected file.skip = {number}"
    return ""


def check_first_row(frame: pd.DataFrame, stamps: pd.Series, used: list[str], path: Path) -> None:
    """Refuse a first row that has neither a time nor numbers where the second has a time: units stand there.

    ``frame`` has rows as text, ``stamps`` are their time stamps, and ``used`` the columns that are mapped. Raises
    RecordingError naming what the row holds.
    """
    first, second = (str(one).strip() for one in stamps.iloc[:2])
    columns = [one for one in dict.fromkeys(used) if one in frame]
    cells = [str(frame[one].iloc[0]).strip() for one in columns if isinstance(frame[one], pd.Series)]
    if re.search(r"\d", first) or not re.search(r"\d", second) or any(re.match(r"[+-]?[.,]?\d", one) for one in cells):
        return
    found = ", ".join(shown(one) for one in [first, *cells[:3]])
    raise RecordingError(
        f"{path}: the row below the column names has no time and no numbers but {found}: units? expected readings, or"
        " below = 1 in [file] of the mapping"
    )


MOST = 1024 * MIB
"""Bytes of a file of measurements."""
SEPARATORS = (";", "\t", ",", "|")
"""What loggers write between columns."""
MARKS = ((codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
"""What files in other encodings begin with; that of UTF-32 begins with one of UTF-16."""
_MINUS = "\u2212"
"""The sign that some languages' programs write before negative numbers."""
OFF = {"false": "0", "no": "0", "off": "0"}
"""Words for nothing of whatever a column is in, but a temperature."""
STATES = {"true": "1", "yes": "1", "on": "1", **OFF}
"""Words for a state."""


@dataclass
class Measurements:
    """A file of measurements.

    Attributes
    ----------
    utc
        Time stamps, strictly increasing, shape (rows,) [s since 1970].
    zone
        The place's clock.
    columns
        The file's columns as text, without those of the time stamps.
    numeric
        Columns whose cells are numbers, with a dot as decimal sign, and not text.
    units
        In which unit the cells of a column ended, which is gone from them.
    repeated
        Rows whose time stamp another row had before: they only fill what that row has not.
    notes
        Sentences on what was understood and what was left out.
    """

    path: Path
    utc: np.ndarray
    zone: str
    columns: pd.DataFrame
    decimal: str
    missing: set[str]
    numeric: frozenset[str] = frozenset()
    units: dict[str, str] = field(default_factory=dict)
    repeated: int = 0
    twice: frozenset[str] = frozenset()
    notes: list[str] = field(default_factory=list)

    def numbers(self, name: str, where: str, words: dict[str, str] = STATES) -> np.ndarray:
        """A column as numbers, NaN where there is none, shape (rows,) [as in the file].

        ``words`` in lower case are numbers, too. Raises RecordingError if the file has no such column, or most of it is
        text or nothing.
        """
        if name in self.twice:
            raise RecordingError(f"{where}: {self.path} has several columns {name!r}; expected a name for each")
        if name not in self.columns:
            raise RecordingError(f"{where}: {self.path} has no column {name!r}; found {listed(self.columns.columns)}")
        text = self.columns[name].str.strip().str.replace(_MINUS, "-", regex=False)
        text = text.where(~text.isin(self.missing))
        notes: list[str] = []
        if name not in self.numeric:
            text, notes = with_dots(text, self.decimal, f"{where}: column {name!r} of {self.path}")
        self.notes += [f"column {name}: {one}" for one in notes]
        text = text.str.lower()
        said = Counter(text[text.isin([*words])])
        if 0 < said.total() < text.notna().sum():
            taken = listed(f"{one!r} ({count} times) as {words[one]}" for one, count in said.items())
            self.notes.append(f"column {name}: {taken} among its numbers")
        text = text.replace(words)
        values = pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64)
        values = np.where(np.abs(values) <= LARGEST, values, np.nan)
        odd = text.notna().to_numpy() & np.isnan(values)
        switched = bool(odd.any()) and text.dropna().isin([*STATES, "0"]).all()
        if switched or odd.sum() > 0.5 * text.notna().sum() or not np.isfinite(values).any():
            example = self.columns[name].iloc[int(np.flatnonzero(odd)[0])] if odd.any() else None
            found = "is empty" if example is None else f"holds text such as {shown(example)} in {int(odd.sum())} rows"
            remedy = "(scale = what ON stands for, in the unit, as scale = 2.5)" if switched else "(file.decimal?)"
            raise RecordingError(f"{where}: column {name!r} of {self.path} {found}; expected numbers {remedy}")
        if odd.any():
            example = self.columns[name].iloc[int(np.flatnonzero(odd)[0])]
            self.notes.append(f"column {name}: {int(odd.sum())} texts such as {example!r} are taken as missing")
        return values


def read_measurements(path: Path, mapping: Mapping) -> Measurements:
    """Read a file of measurements as a mapping says.

    Raises RecordingError if the file cannot be read, or its time stamps cannot be understood.
    """
    settings = mapping.file
    rows = read_file(path, settings, mapping.time.columns[0])
    names = find_names(rows, [*mapping.time.columns, *_mapped(mapping)])
    frame, notes = rows.frame, rows.notes
    for name in mapping.time.columns:
        if names[name] > 1:
            raise RecordingError(f"{mapping.path}: time.column: {path} has several columns {name!r}; expected one")
    if wrong := missing_columns(mapping, list(frame.columns)):
        raise RecordingError(
            f"{mapping.path}: {path} has not all columns that the mapping names: {'; '.join(wrong)}; found"
            f" {listed(frame.columns)}{rows.hint}"
        )
    if len(frame) < 2:
        raise RecordingError(f"{path}: has {len(frame)} rows; expected at least a day of measurements")
    frame, dropped = _without_empty(frame, mapping)
    notes += dropped
    stamps = joined(frame, mapping.time.columns)
    if settings.names is not None:  # each sensor's rows may stand in a block
        times = read_naive(stamps, mapping.time.format)
        if (np.diff(times) < -3600.0).any():  # less may be the hour that the end of daylight saving repeats
            order = np.argsort(times, kind="stable")
            frame, stamps = frame.iloc[order].reset_index(drop=True), stamps.iloc[order].reset_index(drop=True)
    if runs_backwards(stamps, mapping.time.format):
        notes.append("rows are newest first, and are read from the last one on")
        frame, stamps = frame[::-1].reset_index(drop=True), stamps[::-1].reset_index(drop=True)
    check_first_row(frame, stamps, [one for one in _mapped(mapping) if one not in mapping.time.columns], path)
    read = partial(_read, frame, mapping)
    where = f"{path}: column {' and '.join(repr(one) for one in mapping.time.columns)}"
    found = read_stamps(stamps, mapping.time, where, read)
    notes += found.notes
    frame, utc = frame[np.isfinite(found.utc)].reset_index(drop=True), found.utc[np.isfinite(found.utc)]
    keep = np.concatenate([[True], np.diff(utc) > 0])
    columns = frame.drop(columns=mapping.time.columns).fillna("")
    if not keep.all():  # a logger may write a row for each of its sensors
        columns, told = _once_each(columns, keep, mapping, names)
        notes.append(told)
    return Measurements(
        path=path,
        utc=utc[keep],
        zone=found.zone,
        columns=columns.reset_index(drop=True),
        decimal=settings.decimal,
        missing=set(settings.missing),
        numeric=rows.numeric,
        units=rows.units,
        repeated=int((~keep).sum()),
        twice=frozenset(one for one, count in names.items() if count > 1),
        notes=notes,
    )


def _once_each(
    columns: pd.DataFrame, keep: np.ndarray, mapping: Mapping, names: Counter[str]
) -> tuple[pd.DataFrame, str]:
    """Rows of one time stamp made one, of which ``keep`` (rows,) names the first, and a sentence on it."""
    settings = mapping.file
    there = columns.apply(lambda one: one.where(~one.str.strip().isin(settings.missing)))
    rows = np.cumsum(keep) - 1
    columns, held = there.groupby(rows).first(), ""
    holding = [one for one in _mapped(mapping, "hold") if one in columns and names[one] == 1]
    if holding:  # of changes within one stamp what the last one made holds
        columns[holding] = there[holding].groupby(rows).last()
        held = f" (the last of {', '.join(holding)}, which hold{'s' if len(holding) == 1 else ''})"
    used = [one for one in _mapped(mapping) if names[one] == 1 and one in columns]
    unlike = _unlike(there[used], columns[used].iloc[rows], settings)
    return columns, (
        f"{int((~keep).sum())} of {len(keep)} rows repeat the time stamp of the row before, and are counted with"
        f" it: the first reading of each column is used{held}{unlike}"
    )


def joined(frame: pd.DataFrame, columns: Sequence[str]) -> pd.Series:
    """The texts of some columns, joined by a blank, shape (rows,)."""
    texts = frame[columns[0]].fillna("").str.strip()
    for one in columns[1:]:
        texts = texts + " " + frame[one].fillna("").str.strip()
    return texts.str.strip()


def _without_empty(frame: pd.DataFrame, mapping: Mapping) -> tuple[pd.DataFrame, list[str]]:
    """Rows but those that have no time stamp and hold nothing of what is mapped, and a sentence on these."""
    stampless = np.flatnonzero((joined(frame, mapping.time.columns) == "").to_numpy())
    if not stampless.size:
        return frame, []
    rows = frame.iloc[stampless]
    empty = stampless[~_read(rows, mapping).any(axis=1)]
    if not empty.size:
        return frame, []
    blank = (rows.loc[frame.index[empty]].fillna("").apply(lambda one: one.str.strip()) == "").all(axis=1)
    told = int((~blank).sum())
    notes = [f"{told} rows without a time stamp hold nothing that is mapped, and are left out"] if told else []
    return frame.drop(index=frame.index[empty]).reset_index(drop=True), notes


_UNSEEN = re.compile("[\u200b\u200c\u200d\u2060\ufeff]")
"""Characters of no width."""


def plain_name(name: str) -> str:
    """A column's name with composed letters, single blanks, and nothing that is not seen."""
    return " ".join(unicodedata.normalize("NFC", _UNSEEN.sub("", name)).split())


def find_names(rows: Rows, wanted: Sequence[str]) -> Counter[str]:
    """Rename a table's columns as ``wanted`` spells them; how often each name occurs.

    Names are the same whichever way their letters are composed and their blanks written, and those of other capitals
    where no second column would do, which is told.
    """
    plain = {plain_name(one): one for one in wanted}
    names = [plain.get(plain_name(one), plain_name(one)) for one in rows.names]
    columns = [plain.get(plain_name(str(one)), plain_name(str(one))) for one in rows.frame.columns]
    folded = Counter(one.casefold() for one in names)
    for one in dict.fromkeys(wanted):
        key = plain_name(one).casefold()
        if one not in names and folded[key] == 1 and sum(plain_name(w).casefold() == key for w in {*wanted}) == 1:
            other = next(name for name in names if name.casefold() == key)
            names = [one if name == other else name for name in names]
            columns = [one if name == other else name for name in columns]
            rows.notes.append(f"column {other!r} is taken for {one!r}")
    renamed = dict(zip(map(str, rows.frame.columns), columns, strict=True))
    rows.frame.columns = pd.Index(columns)
    rows.numeric = frozenset(renamed[one] for one in rows.numeric)
    rows.units = {renamed[one]: unit for one, unit in rows.units.items()}
    return Counter(names)


def read_file(path: Path, settings: File, name: str) -> Rows:
    """A file's rows as text; ``name`` is a column that its names should hold.

    Raises RecordingError if it cannot be read as a table.
    """
    kind = kind_of(path)
    if kind != "text":
        rows = read_rows(path, read_bytes(path, RecordingError, "measurements", MOST), kind, settings)
    else:
        text = _text(path, settings)
        if not text.strip():
            raise RecordingError(f"{path}: is empty; expected a line of column names and a row for each time")
        check_columns(text, settings.separator, f"{path}", RecordingError)
        frame, notes = _table(text, settings, path, name)
        notes += _broken_lines(frame, settings, path) if '"' in text else []
        hint = f" (separator {settings.separator!r}){skipped(text, settings, name) or _separated(text, settings)}"
        rows = Rows(frame, _names(text, settings, path), notes=notes, hint=hint)
    if settings.below and kind in ("text", "excel"):
        rows.frame = rows.frame.iloc[settings.below :].reset_index(drop=True)
    if settings.names is not None and settings.values is not None:
        rows = spread(rows, settings.names, settings.values, path)
    rows.without_units(settings)
    return rows


def _text(path: Path, settings: File) -> str:
    """The file's text, its lines ended by line feeds only."""
    data = read_bytes(path, RecordingError, "measurements (CSV)", MOST)
    found = next((name for mark, name in MARKS if data.startswith(mark)), "")
    hint = f"; is it {found!r}?" if found else ", such as 'utf-16' or 'cp1252'"
    try:
        text = data.decode(settings.encoding)
    except (ValueError, LookupError) as error:  # LookupError: no such encoding
        raise RecordingError(
            f"{path}: cannot be read as text in {shown(settings.encoding)} ({why(error)}); expected the one that it is"
            f" in, as file.encoding{hint}"
        ) from None
    if "\0" in text:  # pandas would end the field there
        line = text.count("\n", 0, text.index("\0")) + 1
        raise RecordingError(
            f"{path}: line {line} has a null character, read in {shown(settings.encoding)}; expected text: in another"
            " file.encoding ('utf-16-le'?), or without what a logger left that lost its power"
        )
    text = text.rstrip("\x1a")  # what some programs end a file with
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _mapped(mapping: Mapping, reading: str = "") -> list[str]:
    """The columns that a mapping names, each once; only those that are read in one way if ``reading`` is given."""
    sources = [
        one
        for one in [*mapping.variables.values(), *mapping.weather.values()]
        if reading in ("", one.reading or mapping.defaults.reading)
    ]
    named = [one.column for one in sources] + [one.compare.column for one in sources if one.compare is not None]
    return [one for one in dict.fromkeys(named) if one is not None]


def _unlike(texts: pd.DataFrame, first: pd.DataFrame, settings: File) -> str:
    """How many readings are not those that are used in their place, and by how much; both (rows, columns) of text."""
    said = []
    for name in texts:
        one, used = texts[name].str.strip(), first[name].str.strip().set_axis(texts.index)
        apart = (_plain(one, settings) - _plain(used, settings)).abs()
        other = one.notna() & (one != used) & ~(apart == 0)
        if other.any():
            most = apart[other].max()
            said.append(f"{name} in {int(other.sum())}" + (f" by up to {most:.4g}" if np.isfinite(most) else ""))
    return f"; other readings of the same time differ from it: {listed(said)} (as in the file)" if said else ""


def _plain(texts: pd.Series, settings: File) -> pd.Series:
    """Texts as numbers where they are plain ones, NaN elsewhere."""
    return pd.to_numeric(texts.str.replace(settings.decimal, ".", regex=False), errors="coerce")


def _read(frame: pd.DataFrame, mapping: Mapping) -> np.ndarray:
    """Which of the mapped columns hold something in each row, shape (rows, columns)."""
    mapped = set(_mapped(mapping))
    columns = [frame.iloc[:, k] for k, one in enumerate(frame.columns) if one in mapped]  # a name may occur twice
    there = [~one.fillna("").str.strip().isin(mapping.file.missing).to_numpy() for one in columns]
    return np.stack(there, axis=1) if there else np.empty((len(frame), 0), dtype=bool)


def _header(text: str, settings: File) -> str:
    """The line of column names."""
    return next((line for line in islice(io.StringIO(text), settings.skip, None) if line.strip()), "")


def _names(text: str, settings: File, path: Path) -> list[str]:
    """The columns' names, which may occur twice; pandas would call the second of a name something else."""
    lines = (line for line in islice(io.StringIO(text), settings.skip, None))
    records = csv.reader(lines, delimiter=settings.separator, skipinitialspace=settings.separator != " ")
    try:
        return next((one for one in records if any(cell.strip() for cell in one)), [])
    except (csv.Error, ValueError, TypeError) as error:  # names of any length, separators that csv does not take
        raise RecordingError(
            f"{path}: line of column names: {why(error)}; expected the names of a CSV's columns"
        ) from None


def _separated(text: str, settings: File) -> str:
    """What else may separate the columns, of a header that has it; empty if nothing does."""
    header = _header(text, settings)
    found = [one for one in SEPARATORS if one != settings.separator and one in header.strip()]
    if not found or settings.separator in header:
        return ""
    comma = " (and file.decimal ',')" if settings.separator == "," and settings.decimal == "." else ""
    return f"; is file.separator {found[0]!r}{comma}?"


def _broken_lines(frame: pd.DataFrame, settings: File, path: Path) -> list[str]:
    """Sentences on cells of several lines; refused where these are rows, lost between two stray quotation marks."""
    notes = []
    for k, name in enumerate(frame.columns):
        column = frame.iloc[:, k].fillna("")
        breaks = column.str.count("\n")
        if not breaks.any():
            continue
        # from one cell of a column to the one below it there are as many separators as in a line
        rows = column.str.count(re.escape(settings.separator)) >= breaks * max(frame.shape[1] - 1, 1)
        lost = np.flatnonzero((breaks > 0) & rows)
        if lost.size:
            at = int(lost[0])
            raise RecordingError(
                f"{path}: row {at + 1}: column {name!r}: a cell goes on over {breaks.iloc[at] + 1} lines, which are"
                " rows of the table; expected a cell to end in its line: a quotation mark that is not closed?"
            )
        notes.append(f"column {name}: {int((breaks > 0).sum())} cells hold line breaks")
    return notes


def _why_no_table(error: Exception, settings: File) -> str:
    """What is wrong with a text that pandas does not take for a table."""
    if found := re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error)):
        fields, line, saw = found.groups()
        return (
            f"line {line} has {saw} fields, separated by {settings.separator!r}, and lines before it {fields}; expected"
            " as many in every line, and quotation marks around text that holds the separator"
        )
    if found := re.search(r"EOF inside string starting at row (\d+)", str(error)):
        return (
            f"a quotation mark in line {int(found[1]) + 1} is not closed until the end; expected two of them, or none"
        )
    return f"not readable as CSV ({why(error)})"


def _table(text: str, settings: File, path: Path, name: str) -> tuple[pd.DataFrame, list[str]]:
    """A CSV's rows as text under its column names, and sentences on what was left out.

    A separator that ends every row but the header's makes no column, and numbers of rows without a name are none.
    """

    def read(**more: Any) -> pd.DataFrame:
        with warnings.catch_warnings():
            # of separators beyond ASCII, and of empty fields that are lost, as they should be
            warnings.simplefilter("ignore", pd.errors.ParserWarning)
            return pd.read_csv(
                io.StringIO(text),
                sep=settings.separator,
                skiprows=settings.skip,
                dtype=str,
                keep_default_na=False,
                skip_blank_lines=True,
                skipinitialspace=settings.separator != " ",  # a quotation mark may come after a blank
                **more,
            )

    try:
        frame = read()
        if isinstance(frame.index, pd.RangeIndex):
            return frame, []
        # rows are longer than the header: pandas would take their first fields for names of the rows
        if frame.iloc[:, -1].str.strip().eq("").all():
            return read(index_col=False), []
        if frame.index.nlevels == 1 and _are_row_numbers(frame.index):
            return frame.reset_index(drop=True), ["the first field of each row, a number of the row, has no name"]
        raise RecordingError(
            f"{path}: rows have {frame.index.nlevels + frame.shape[1]} fields under {frame.shape[1]} column names;"
            f" expected as many names as fields{skipped(text, settings, name) or _separated(text, settings)}"
        )
    except (ValueError, ArithmeticError, LookupError, MemoryError) as error:  # what pandas meets in text that is no CSV
        raise RecordingError(f"{path}: {_why_no_table(error, settings)}{skipped(text, settings, name)}") from None


def _are_row_numbers(index: pd.Index) -> bool:
    """Whether the names of rows count them from 0 or 1."""
    numbers = pd.to_numeric(pd.Series(index), errors="coerce").to_numpy(dtype=np.float64)
    return len(numbers) > 1 and numbers[0] in (0.0, 1.0) and bool((np.diff(numbers) == 1).all())
