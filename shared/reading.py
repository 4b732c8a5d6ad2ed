"""Files from elsewhere: read whole but never without end, and refused with a sentence.

A file may be missing, cut off, changed by chance or on purpose, or no file at all. Whoever reads one says what was
expected there and which of the project's errors it is; nothing else comes out. Numbers beyond what a machine can hold,
nesting without end and text without end are refused before anything is done with them.
"""

from __future__ import annotations

import io
import json
import re
import reprlib
import stat
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from shared.errors import ZeroshotError

MIB = 1 << 20
MOST_JSON = 64 * MIB
MOST_TOML = MIB
"""Python's TOML parser reads about a mebibyte a second; the largest description here has 20 KiB."""
DEEPEST = 100
"""Tables and lists within each other."""
MOST_SAID = 600
"""Characters of a sentence that come from a file."""
MOST_COLUMNS = 5_000
"""Of a table: pandas takes a time that grows with their square."""
_LONG_KEY = re.compile(r"""(?<![\w"'.-])(?>[\w"'-]++[ \t]*+\.[ \t]*+){64}""")
"""Python's TOML parser takes a time that grows with the square of a dotted key's parts."""

M = TypeVar("M", bound=BaseModel)


def read_bytes(path: Path, error: type[ZeroshotError], expected: str, most: int = 4096 * MIB) -> bytes:
    """Content of a regular file of at most ``most`` bytes.

    Raises ``error`` if it is missing, no regular file (a pipe would be waited for, a device has no end), larger, or
    cannot be read.
    """
    size = size_of(path, error, expected)
    if size > most:
        raise error(f"{path}: has {size / MIB:.0f} MiB; expected {expected}, of at most {most / MIB:.0f} MiB")
    try:
        with open(path, "rb") as file:
            return file.read(size)  # a number beyond the size would be made room for
    except OSError as cause:
        raise error(f"{path}: cannot be read ({cause.strerror or cause}); expected {expected}") from None


def size_of(path: Path, error: type[ZeroshotError], expected: str) -> int:
    """Size of a regular file [bytes].

    Raises ``error`` if there is none.
    """
    name = short(f"{path}")  # a damaged file may name another of any length
    try:
        found = path.stat()
    except FileNotFoundError:
        raise error(f"{name}: no such file; expected {expected}") from None
    except (OSError, ValueError) as cause:  # ValueError: a path with a null character
        raise error(
            f"{name}: cannot be read ({getattr(cause, 'strerror', None) or cause}); expected {expected}"
        ) from None
    if not stat.S_ISREG(found.st_mode):
        raise error(f"{name}: cannot be read: it is {_kind(found.st_mode)}; expected {expected}")
    return found.st_size


def _kind(mode: int) -> str:
    return "a folder" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"


def read_text(
    path: Path, error: type[ZeroshotError], expected: str, *, most: int = MOST_JSON, encoding: str = "utf-8"
) -> str:
    """Content of a text file.

    Raises ``error`` as :func:`read_bytes`, or if it is not text in this encoding.
    """
    data = read_bytes(path, error, expected, most)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as cause:
        line = data[: cause.start].count(b"\n") + 1
        raise error(
            f"{path}: line {line}: the byte 0x{data[cause.start]:02x} is no text in {cause.encoding}; save the file as"
            f" UTF-8 (expected {expected})"
        ) from None
    except (UnicodeError, LookupError) as cause:  # LookupError: no such encoding
        raise error(f"{path}: cannot be read as text: {why(cause)}; expected {expected}") from None


def read_json(path: Path, error: type[ZeroshotError], expected: str, *, most: int = MOST_JSON) -> Any:
    """Content of a JSON file of at most ``most`` bytes.

    Raises ``error`` as :func:`read_text`, or if it is not JSON, or nested too deep.
    """
    return parse_json(read_text(path, error, expected, most=most), f"{path}", error, expected)


def parse_json(text: str, where: str, error: type[ZeroshotError], expected: str) -> Any:
    """What a JSON text says; ``error``, which names ``where``, if it is not JSON, or nested too deep."""
    try:
        found = json.loads(text)
        _check_depth(found)
    except (ValueError, RecursionError) as cause:  # ValueError: also a number of thousands of digits
        raise error(f"{where}: not valid JSON: {why(cause)}; expected {expected}") from None
    return found


def parse_toml(text: str, where: str, error: type[ZeroshotError]) -> dict[str, Any]:
    """What a TOML text says; ``where`` is what the error names.

    Raises ``error`` if it is not TOML, nested too deep, or has a key of too many parts.
    """
    try:
        if _LONG_KEY.search(text):
            raise ValueError("a key has 64 parts or more")
        found = tomllib.loads(text)
        _check_depth(found)
        _check_integers(found)
    except (ValueError, RecursionError) as cause:
        raise error(f"{where}: not valid TOML: {why(cause)}{_line_of(text, str(cause))}") from None
    return found


def _line_of(text: str, cause: str) -> str:
    """The line at which TOML is not read on, and what to write for a number with a comma; empty where none is named."""
    place = re.search(r"at line (\d+)", cause)
    lines = text.splitlines()
    if place is None or not 0 < int(place[1]) <= len(lines):
        return ""
    line = lines[int(place[1]) - 1].strip()
    comma = re.search(r"=\s*([-+]?\d+),(\d+)\s*(#|$)", line)
    return f": {shown(line)}{f'; write {comma[1]}.{comma[2]}, with a point' if comma else ''}"


def read_toml(path: Path, error: type[ZeroshotError], expected: str) -> dict[str, Any]:
    """Content of a TOML file.

    Raises ``error`` as :func:`read_text` and :func:`parse_toml`.
    """
    return parse_toml(read_text(path, error, expected, most=MOST_TOML), f"{path}", error)


def _check_depth(found: Any) -> None:
    """Refuse what cannot be written out again: that recurses where reading it need not."""
    level = [found]
    for _ in range(DEEPEST):
        level = [
            inner
            for one in level
            if isinstance(one, dict | list)
            for inner in (one.values() if isinstance(one, dict) else one)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise ValueError(f"nested more than {DEEPEST} levels deep")


def _check_integers(found: Any) -> None:
    """Refuse integers of more than the 64 bits that TOML has: hexadecimal ones may be too long to be said."""
    left = [found]
    while left:
        one = left.pop()
        if isinstance(one, dict | list):
            left += one.values() if isinstance(one, dict) else one
        elif isinstance(one, int) and one.bit_length() > 63:
            raise ValueError(f"an integer has {one.bit_length()} bits; expected 63 at most and a sign")


def check_columns(text: str, separator: str, where: str, error: type[ZeroshotError]) -> None:
    """Refuse a table that is too wide: the ``error`` names the line."""
    for number, line in enumerate(io.StringIO(text), 1):
        if line.count(separator) >= MOST_COLUMNS:
            found = line.count(separator) + 1
            raise error(f"{where}: line {number} has {found} columns; expected a table of at most {MOST_COLUMNS}")


def validated(kind: type[M], raw: Any, where: str, error: type[ZeroshotError], expected: str = "") -> M:
    """What was read, as a model.

    Raises ``error`` naming the first field that is wrong, what was found, and ``expected``.
    """
    try:
        return kind.model_validate(raw)
    except ValidationError as cause:
        raise error(f"{where}: {said(cause)}{f'; expected {expected}' if expected else ''}") from None


def said(error: ValidationError) -> str:
    """What a model's validation found wrong first: the field, the trouble, and what was found."""
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] not in ("missing", "value_error"):
        what += f" (found {shown(first['input'])})"
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"{short(where)}: {short(what)}{more}" if where else f"{short(what)}{more}"


def newer(found: object, ours: int) -> str:
    """Why a file cannot be read whose schema is not one up to ``ours``, to follow its name; empty if it is one.

    ``found`` is what the file says: a whole number, or one before a dot, as of 3 in ``3.1``.
    """
    major = str(found).partition(".")[0]
    if not isinstance(found, bool) and major.isdecimal() and len(major) < 10 and int(major) <= ours:
        return ""
    return f"schema version is {shown(found)}; this version of zeroshot-fmu reads up to {ours}: update it"


def shown(value: Any) -> str:
    """A value for a sentence, however long or deep it is."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # Python writes no whole number of thousands of digits
        return f"a number of {value.bit_length()} bits" if isinstance(value, int) else f"a {type(value).__name__}"


def why(cause: BaseException) -> str:
    """What an exception says, for a sentence: its first line, or its kind, and not the file's content once more."""
    return short((str(cause).strip().splitlines() or [type(cause).__name__])[0])


def short(text: str, most: int = MOST_SAID) -> str:
    """A text of at most ``most`` characters, no fewer than 200: its beginning and its end."""
    return text if len(text) <= most else f"{text[: most - 100]} ... {text[-90:]}"


def listed(names: Iterable[object]) -> str:
    """Names for a sentence, however many and long they are."""
    words = [text if len(text) <= 80 else f"{text[:77]}..." for text in map(str, names)]
    return ", ".join(words[:30]) + (f" and {len(words) - 30} more" if len(words) > 30 else "")


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 200
_SHORT.maxlist = _SHORT.maxdict = _SHORT.maxtuple = 20
