"""Measurements that are no text: Excel, Parquet and NetCDF files, as tables of text beside what their cells were.

A file's first bytes say what it is, whatever its name. None is unpacked before its size is known: a few kilobytes may
hold gigabytes of zeros.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import date, datetime, time
from importlib import import_module
from itertools import islice
from numbers import Number
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from diagnosis.measurements.cells import bare
from diagnosis.measurements.mapping import File
from shared.errors import RecordingError
from shared.reading import MIB, MOST_COLUMNS, listed, shown, why

MOST_CELLS = 50_000_000
"""Of a table: as text they take some gigabytes."""
MOST_UNPACKED = 1024 * MIB
"""Bytes of a file's parts when unpacked: as many as a CSV may have."""
_PACKED, _SMALL = 100, 16 * MIB
"""What is more than so many times smaller packed, and not small, is no log: its cells' addresses differ, and so a sheet
is packed ten to twenty times."""
_KINDS = (
    (b"PK\x03\x04", "excel"),
    (b"PAR1", "parquet"),
    (b"\x89HDF", "netcdf"),
    (b"CDF\x01", "netcdf"),
    (b"CDF\x02", "netcdf"),
    (b"CDF\x05", "netcdf"),
    (b"\xd0\xcf\x11\xe0", "xls"),
    (b"\x1f\x8b", "gzip"),
)
_REFUSED = {
    "xls": "is an Excel file of before 2007; expected it saved as .xlsx",
    "gzip": "is compressed; expected it unpacked",
}


@dataclass
class Rows:
    """A table as text.

    Attributes
    ----------
    frame
        The cells as text under the column names, empty where there is nothing.
    names
        The column names as in the file, which may occur twice.
    numeric
        Columns of the frame whose cells are numbers, written with a dot.
    units
        In which unit the cells of a column ended, which is gone from them.
    notes, hint
        Sentences on what was understood, and the end of one on what may be wrong if a column is missing.
    """

    frame: pd.DataFrame
    names: list[str]
    numeric: frozenset[str] = frozenset()
    notes: list[str] = field(default_factory=list)
    hint: str = ""
    units: dict[str, str] = field(default_factory=dict)

    def without_units(self, settings: File) -> None:
        """Take the units off that cells end in."""
        for k, name in enumerate(self.frame.columns):
            if name not in self.numeric:
                column, unit = bare(self.frame.iloc[:, k], settings.decimal, settings.missing)
                if unit:
                    self.frame.isetitem(k, column.to_numpy())
                    self.units[str(name)] = unit


def spread(rows: Rows, names: str, values: str, path: Path) -> Rows:
    """A table with a row for each reading, with a column for each text in ``names`` that holds what is in ``values``.

    Raises RecordingError if it has no such columns, or too many texts.
    """
    if wrong := [one for one in (names, values) if rows.names.count(one) != 1]:
        raise RecordingError(
            f"{path}: file.names and file.values: no column {' and no column '.join(map(repr, wrong))}, or several;"
            f" found {listed(rows.names)}{rows.hint}"
        )
    named = rows.frame[names].fillna("").str.strip()
    rest = rows.frame.drop(columns=[names, values])
    found = [one for one in named.unique() if one]
    if taken := [one for one in found if one in rest.columns]:
        raise RecordingError(f"{path}: file.names: column {names!r} holds {taken[0]!r}, which is a column, too")
    check_cells(len(rest), len(found) + rest.shape[1], path)
    made = {one: rows.frame[values].where(named == one, "") for one in found}
    frame = pd.concat([rest, pd.DataFrame(made, index=rest.index)], axis=1)
    numeric = rows.numeric & {*rest.columns} | (frozenset(found) if values in rows.numeric else frozenset())
    return Rows(frame, [*map(str, frame.columns)], numeric, rows.notes, rows.hint)


def kind_of(path: Path) -> str:
    """What a file is by its first bytes: ``excel``, ``parquet``, ``netcdf``, or else ``text``.

    Raises RecordingError if it is of a kind that is not read.
    """
    try:
        with open(path, "rb") as file:
            begin = file.read(4)
            end = b""
            if begin == b"PAR1":  # which may be a column's name, too
                file.seek(-4, 2)
                end = file.read(4)
    except OSError:  # whoever reads it says why
        return "text"
    found = next((kind for mark, kind in _KINDS if begin.startswith(mark)), "text")
    if found == "parquet" and end != begin:
        found = "text"
    if found in _REFUSED:
        raise RecordingError(f"{path}: {_REFUSED[found]}, or measurements as CSV, .xlsx, Parquet or NetCDF")
    return found


def read_rows(path: Path, data: bytes, kind: str, settings: File) -> Rows:
    """A table of a kind that :func:`kind_of` tells.

    Raises RecordingError if it cannot be read, is too large, or a package for it is missing.
    """
    if kind == "excel":
        return _of_columns(*_excel_columns(path, data, settings), settings, path)
    frame = _parquet(path, data) if kind == "parquet" else _netcdf(path)
    return _of_columns(
        [str(one) for one in frame.columns], [frame.iloc[:, k] for k in range(frame.shape[1])], settings, path
    )


def _of_columns(names: list[str], columns: list[pd.Series], settings: File, path: Path) -> Rows:
    if len(set(names)) < len(names):
        seen: dict[str, int] = {}
        unique = []
        for name in names:
            seen[name] = seen.get(name, 0) + 1
            unique.append(name if seen[name] == 1 else f"{name}.{seen[name] - 1}")
    else:
        unique = names
    texts, numeric = {}, set()
    for name, column in zip(unique, columns, strict=True):
        texts[name], numbers = _texts(column, settings.decimal)
        if numbers:
            numeric.add(name)
    return Rows(pd.DataFrame(texts), names, frozenset(numeric))


def _texts(column: pd.Series, decimal: str) -> tuple[pd.Series, bool]:
    """A column as text, and whether all its cells are numbers; beside text they have the decimal sign of the text."""
    there = column.notna()
    if isinstance(column.dtype, pd.CategoricalDtype):
        column = column.astype(object)
    kind = getattr(column.dtype, "kind", "O")
    if kind == "b":
        return column.astype(str).astype(object), True
    if kind in "iuf":
        return column.astype(str).astype(object).where(there, ""), True
    if kind == "M":
        return column.astype(str).astype(object).where(there, ""), False
    cells = column.to_numpy(dtype=object)
    numbers = all(isinstance(one, Number) for one in cells[there.to_numpy()]) and bool(there.any())
    sign = "." if numbers else decimal
    texts = [_text(one, sign) if ok else "" for one, ok in zip(cells, there, strict=True)]
    return pd.Series(_dates_only(texts, cells[there.to_numpy()]), dtype=object), numbers


def _text(cell: Any, sign: str) -> str:
    if isinstance(cell, datetime):  # Excel's days in binary hold no whole second
        moment = pd.Timestamp(cell).round("ms")
        return str(moment)
    if isinstance(cell, time):
        return cell.isoformat(timespec="seconds")
    if isinstance(cell, Number):
        return str(cell).replace(".", sign)
    return str(cell)


def _dates_only(texts: list[str], cells: np.ndarray) -> list[str]:
    """Dates without their midnights, of a column that holds no other time: its times are in another column."""
    if len(cells) and all(
        isinstance(one, date) and not (isinstance(one, datetime) and one.time() != time()) for one in cells
    ):
        return [one[:10] for one in texts]
    return texts


def check_cells(rows: int, columns: int, path: Path) -> None:
    """Refuse a table that is too large: a RecordingError that says how large it is."""
    if columns > MOST_COLUMNS or rows * columns > MOST_CELLS:
        raise RecordingError(
            f"{path}: has {rows} rows of {columns} columns; expected a table of at most {MOST_COLUMNS} columns and"
            f" {MOST_CELLS / 1e6:g} million cells"
        )


def needed(name: str, path: Path, kind: str) -> Any:
    """A package that only some files need.

    Raises RecordingError that says what to install, if it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise RecordingError(
            f"{path}: is {kind} file, and {name.partition('.')[0]} is not installed, which reads it; expected pip"
            " install 'zeroshot-fmu[tables]', or the measurements as CSV"
        ) from None


def _excel_columns(path: Path, data: bytes, settings: File) -> tuple[list[str], list[pd.Series]]:
    """Names and cells of a sheet's columns."""
    rows = [list(one) for one in islice(sheet_rows(path, data, settings.sheet), settings.skip, None)]
    first = next((k for k, one in enumerate(rows) if any(cell is not None for cell in one)), None)
    if first is None:
        raise RecordingError(f"{path}: has no column names in row {settings.skip + 1} or below (file.skip?)")
    names, rows = ["" if one is None else str(one) for one in rows[first]], rows[first + 1 :]
    width = max([len(names), *map(len, rows)])
    check_cells(len(rows), width, path)
    names = [one or f"Unnamed: {k}" for k, one in enumerate(names + [""] * (width - len(names)))]
    padded = [one + [None] * (width - len(one)) for one in rows]
    return names, [pd.Series([row[k] for row in padded], dtype=object) for k in range(width)]


@contextmanager
def _book(path: Path, data: bytes) -> Iterator[Any]:
    """An Excel file; whatever openpyxl meets in it while this lasts is a sentence."""
    _check_archive(path, data)
    openpyxl = needed("openpyxl", path, "an Excel")
    try:
        yield openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
    except RecordingError:
        raise
    except Exception as error:  # openpyxl raises what it meets in a file that is damaged
        raise RecordingError(f"{path}: cannot be read as an Excel file ({why(error)}); expected an .xlsx") from None


def sheet_rows(path: Path, data: bytes, sheet: str | None) -> Iterator[tuple[Any, ...]]:
    """The rows of an Excel file's sheet, without the empty cells at their ends.

    Raises RecordingError if it is no such file, holds more than a log would, or several sheets have cells and none is
    named.
    """
    with _book(path, data) as book:
        sheets = {one.title: one for one in book.worksheets}
        if sheet is not None and sheet not in sheets:
            raise RecordingError(f"{path}: has no sheet {sheet!r}; expected file.sheet as one of {listed(sheets)}")
        if sheet is None:
            filled = [one.title for one in sheets.values() if next(_cells(one, path), None) is not None]
            if len(filled) > 1:
                raise RecordingError(
                    f"{path}: has several sheets with cells, {listed(filled)}; expected one of them as file.sheet"
                )
            sheet = filled[0] if filled else next(iter(sheets))
        yield from _cells(sheets[sheet], path)


def sheets_of(path: Path, data: bytes, most: int) -> dict[str, list[list[str]]]:
    """The first rows of each sheet of an Excel file, as text.

    Raises RecordingError if it cannot be read.
    """
    with _book(path, data) as book:
        return {
            one.title: [
                ["" if cell is None else _text(cell, ".") for cell in row] for row in islice(_cells(one, path), most)
            ]
            for one in book.worksheets
        }


def _cells(sheet: Any, path: Path) -> Iterator[tuple[Any, ...]]:
    if hasattr(sheet, "reset_dimensions"):
        sheet.reset_dimensions()  # what the file says of its size need not be so
    count = width = 0
    empty = 0
    for row in sheet.iter_rows(values_only=True):
        last = len(row)
        while last and (row[last - 1] is None or row[last - 1] == ""):
            last -= 1
        if not last:
            empty += 1
            continue
        yield from ((),) * min(empty, MOST_COLUMNS)  # rows that are empty count as lines, but not without end
        count, width, empty = count + empty + 1, max(width, last), 0
        check_cells(count, width, path)
        yield row[:last]


def _check_archive(path: Path, data: bytes) -> None:
    """Refuse an archive that is no Excel file, unpacks to more than a log holds, or declares entities of XML."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = archive.infolist()
            unpacked, packed = sum(one.file_size for one in parts), sum(one.compress_size for one in parts)
            if unpacked > MOST_UNPACKED or unpacked > max(_SMALL, _PACKED * packed):
                raise RecordingError(
                    f"{path}: unpacks from {packed / MIB:.3g} to {unpacked / MIB:.4g} MiB; expected a log, of at most"
                    f" {MOST_UNPACKED / MIB:.0f} MiB and {_PACKED} times its size"
                )
            names = {one.filename for one in parts}
            if "xl/workbook.xml" not in names:
                raise RecordingError(
                    f"{path}: is an archive of {listed(sorted(names))}; expected an Excel file (.xlsx), or the"
                    " measurements unpacked"
                )
            for one in parts:
                if one.filename.endswith((".xml", ".rels")):
                    with archive.open(one) as part:
                        if b"<!DOCTYPE" in part.read(4096).upper():
                            raise RecordingError(
                                f"{path}: {one.filename} declares a DOCTYPE; expected an .xlsx without"
                            )
    except (zipfile.BadZipFile, OSError, EOFError, ValueError, NotImplementedError, RuntimeError) as error:
        raise RecordingError(f"{path}: cannot be unpacked ({why(error)}); expected an Excel file (.xlsx)") from None


def _parquet(path: Path, data: bytes) -> pd.DataFrame:
    parquet = needed("pyarrow.parquet", path, "a Parquet")
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        about = file.metadata
        check_cells(about.num_rows, about.num_columns, path)
        schema = file.schema_arrow
        texts = [one.name for one in schema if str(one.type) in ("string", "large_string", "binary", "large_binary")]
        # texts stay codes: a long one that is repeated may be a few bytes in the file
        file = parquet.ParquetFile(io.BytesIO(data), read_dictionary=texts)
        flat = [one.name for one in schema if not str(one.type).startswith(("list", "struct", "map", "large_list"))]
        table = file.read(columns=flat)
        if table.nbytes > MOST_UNPACKED:
            raise RecordingError(f"{path}: unpacks to {table.nbytes / MIB:.4g} MiB; expected a log")
        frame: pd.DataFrame = table.to_pandas(ignore_metadata=True)
    except RecordingError:
        raise
    except Exception as error:  # pyarrow raises its own kinds
        raise RecordingError(f"{path}: cannot be read as Parquet ({why(error)}); expected measurements") from None
    for name in frame:
        if isinstance(frame[name].dtype, pd.CategoricalDtype):
            lengths = np.array([len(str(one)) for one in frame[name].cat.categories] or [0])
            codes = frame[name].cat.codes.to_numpy()
            _check_text(int(lengths[codes[codes >= 0]].sum()), path)
    return frame


def _check_text(length: int, path: Path) -> None:
    if length > MOST_UNPACKED:
        raise RecordingError(f"{path}: holds {length / MIB:.4g} MiB of text; expected a log")


def _netcdf(path: Path) -> pd.DataFrame:
    """The variables of a NetCDF file that lie along its longest dimension alone."""
    try:
        with xr.open_dataset(path, decode_timedelta=False) as data:
            squeezed = data.squeeze(drop=True)
            sizes = squeezed.sizes
            along = max(sizes, key=lambda name: sizes[name]) if sizes else None
            names = [str(one) for one in squeezed.variables if squeezed[one].dims == (along,)]
            if along is None or not names:
                raise RecordingError(f"{path}: has no variables along a dimension; expected measurements along time")
            check_cells(sizes[along], len(names), path)
            for one in names:
                _check_text(sizes[along] * max(squeezed[one].dtype.itemsize, 1), path)
            return pd.DataFrame({one: _plain(squeezed[one].to_numpy(), one, path) for one in names})
    except RecordingError:
        raise
    except Exception as error:  # the libraries below raise what they meet in a file that is damaged
        raise RecordingError(f"{path}: cannot be read as NetCDF ({why(error)}); expected measurements") from None


def _plain(values: np.ndarray, name: str, path: Path) -> np.ndarray:
    """Values as pandas takes them; dates of other calendars are refused."""
    first: Iterable[Any] = values[:1] if values.dtype == object else ()
    if any(type(one).__module__.startswith("cftime") for one in first):
        raise RecordingError(
            f"{path}: {name} has dates of another calendar such as {shown(str(values[0]))}; expected today's"
        )
    return values
