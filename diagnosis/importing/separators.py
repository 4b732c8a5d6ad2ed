"""Dots and commas in numbers: of thousands, or of decimals. What can be either is refused."""

from __future__ import annotations

import pandas as pd

from shared.errors import RecordingError
from shared.reading import shown

_GROUPED = r"[+-]?\d+([.,'\u2019\s\u00a0\u202f]\d+)+"
"""Digits with a sign between them that is not read as the decimal one."""


def with_dots(text: pd.Series, decimal: str, where: str) -> tuple[pd.Series, list[str]]:
    """Texts of numbers with a dot as decimal sign, and sentences on what was understood.

    Dots beside a decimal comma are of thousands where each of them can be and something says so: a comma, or whole
    numbers as large as those before a thousand.

    Raises
    ------
    RecordingError
        If a sign may be of thousands or of decimals, or a number has one that is neither.
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
