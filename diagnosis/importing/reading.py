"""The measurement file: its rows in the order of time, its columns as numbers."""

from __future__ import annotations

import csv
import io
import warnings
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from diagnosis.importing.clock import read_stamps
from diagnosis.importing.mapping import File, Mapping
from diagnosis.importing.separators import with_dots
from shared.errors import RecordingError
from shared.reading import MIB, check_columns, listed, read_text, shown, why

MOST = 1024 * MIB
"""Bytes of a file of measurements."""
_TRUE = {"true": "1", "yes": "1", "on": "1", "false": "0", "no": "0", "off": "0"}


@dataclass
class Measurements:
    """A file of measurements.

    Attributes
    ----------
    utc
        Time stamps, strictly increasing, shape (rows,) [s since 1970].
    columns
        The file's columns as text, without that of the time stamps.
    repeated
        Rows whose time stamp another row had before: they only fill what that row has not.
    notes
        Sentences on what was understood and what was left out.
    """

    path: Path
    utc: np.ndarray
    columns: pd.DataFrame
    decimal: str
    missing: set[str]
    repeated: int = 0
    twice: frozenset[str] = frozenset()
    notes: list[str] = field(default_factory=list)

    def numbers(self, name: str, where: str) -> np.ndarray:
        """A column as numbers, NaN where there is none, shape (rows,) [as in the file].

        Raises
        ------
        RecordingError
            If the file has no such column, or most of it is text or nothing.
        """
        if name in self.twice:
            raise RecordingError(f"{where}: {self.path} has several columns {name!r}; expected a name for each")
        if name not in self.columns:
            raise RecordingError(f"{where}: {self.path} has no column {name!r}; found {listed(self.columns.columns)}")
        text = self.columns[name].str.strip()
        text = text.where(~text.isin(self.missing))
        text, notes = with_dots(text, self.decimal, f"{where}: column {name!r} of {self.path}")
        self.notes += [f"column {name}: {one}" for one in notes]
        text = text.str.lower().replace(_TRUE)
        values = pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64)
        values = np.where(np.isfinite(values), values, np.nan)
        odd = text.notna().to_numpy() & np.isnan(values)
        if odd.sum() > 0.5 * text.notna().sum() or not np.isfinite(values).any():
            example = self.columns[name].iloc[int(np.flatnonzero(odd)[0])] if odd.any() else None
            found = "is empty" if example is None else f"holds text such as {shown(example)} in {int(odd.sum())} rows"
            raise RecordingError(f"{where}: column {name!r} of {self.path} {found}; expected numbers (file.decimal?)")
        if odd.any():
            example = self.columns[name].iloc[int(np.flatnonzero(odd)[0])]
            self.notes.append(f"column {name}: {int(odd.sum())} texts such as {example!r} are taken as missing")
        return values


def read_measurements(path: Path, mapping: Mapping) -> Measurements:
    """Read a CSV as a mapping says.

    Raises
    ------
    RecordingError
        If the file cannot be read, or its time stamps cannot be understood.
    """
    settings = mapping.file
    text = read_text(path, RecordingError, "measurements (CSV)", most=MOST, encoding=settings.encoding)
    check_columns(text, settings.separator, f"{path}", RecordingError)
    frame = _table(text, settings, path)
    names = _names(text, settings)
    frame.columns = frame.columns.str.strip()
    name = mapping.time.column
    if names[name] > 1:
        raise RecordingError(f"{mapping.path}: time.column: {path} has several columns {name!r}; expected one")
    if name not in frame:
        raise RecordingError(
            f"{mapping.path}: time.column: {path} has no column {name!r}; found {listed(frame.columns)} "
            f"(separator {settings.separator!r})"
        )
    if len(frame) < 2:
        raise RecordingError(f"{path}: has {len(frame)} rows; expected at least a day of measurements")
    where = f"{path}: column {name!r}"
    utc, notes = read_stamps(frame[name].fillna(""), mapping.time, where, partial(_read, frame, mapping))
    keep = np.concatenate([[True], np.diff(utc) > 0])
    if not keep.all():
        notes.append(
            f"{int((~keep).sum())} rows repeat the time stamp of the row before: the first reading of each column is"
            " used"
        )
    columns = frame.drop(columns=name).fillna("")
    if not keep.all():  # a logger may write a row for each of its sensors
        there = columns.apply(lambda one: one.where(~one.str.strip().isin(settings.missing)))
        columns = there.groupby(np.cumsum(keep) - 1).first()
    return Measurements(
        path=path,
        utc=utc[keep],
        columns=columns.reset_index(drop=True),
        decimal=settings.decimal,
        missing=set(settings.missing),
        repeated=int((~keep).sum()),
        twice=frozenset(one for one, count in names.items() if count > 1),
        notes=notes,
    )


def _read(frame: pd.DataFrame, mapping: Mapping) -> np.ndarray:
    """Which of the mapped columns hold something in each row, shape (rows, columns)."""
    sources = [*mapping.variables.values(), *mapping.weather.values()]
    mapped = {one.column for one in sources} | {one.compare.column for one in sources if one.compare is not None}
    columns = [frame.iloc[:, k] for k, one in enumerate(frame.columns) if one in mapped]  # a name may occur twice
    there = [~one.fillna("").str.strip().isin(mapping.file.missing).to_numpy() for one in columns]
    return np.stack(there, axis=1) if there else np.empty((len(frame), 0), dtype=bool)


def _names(text: str, settings: File) -> Counter[str]:
    """How often each column is named; pandas would call the second of a name something else."""
    header = next((line for line in islice(io.StringIO(text), settings.skip, None) if line.strip()), "")
    return Counter(one.strip() for one in next(csv.reader([header], delimiter=settings.separator), []))


def _table(text: str, settings: File, path: Path) -> pd.DataFrame:
    """A CSV's rows as text under its column names; a separator that ends every row but the header's makes no column."""

    def read(**more: Any) -> pd.DataFrame:
        return pd.read_csv(
            io.StringIO(text),
            sep=settings.separator,
            skiprows=settings.skip,
            dtype=str,
            keep_default_na=False,
            skip_blank_lines=True,
            **more,
        )

    try:
        frame = read()
        if isinstance(frame.index, pd.RangeIndex):
            return frame
        # rows are longer than the header: pandas would take their first fields for names of the rows
        if frame.index.nlevels > 1 or frame.iloc[:, -1].str.strip().ne("").any():
            raise RecordingError(
                f"{path}: rows have {frame.index.nlevels + frame.shape[1]} fields under {frame.shape[1]} column names;"
                " expected as many names as fields"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.ParserWarning)  # the empty fields are lost, as they should be
            return read(index_col=False)
    except (ValueError, ArithmeticError, LookupError, MemoryError) as error:  # what pandas meets in text that is no CSV
        raise RecordingError(f"{path}: not readable as CSV ({why(error)})") from None
