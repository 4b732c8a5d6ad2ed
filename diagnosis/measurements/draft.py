"""A draft of a mapping: :func:`draft_mapping` looks at a log and writes down what its columns are, and why."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.measurements.guess import Column, guess
from diagnosis.measurements.layout import Layout, layout_of
from diagnosis.measurements.mapping import OPEN, File, unfilled
from shared.errors import RecordingError
from shared.places import check_folder
from shared.reading import MOST_TOML, parse_toml
from shared.results import Result
from shared.shipped import USUAL
from shared.system import System, load_system

if TYPE_CHECKING:
    import pandas as pd

_STUCK = 12.0
"""Hours that a reading may stand still before the import leaves it out as stuck."""
_DAY = 24.0
"""Hours within which whatever has to do with the sun or with people moves."""


@dataclass(frozen=True)
class Guess:
    """What a column was taken for: ``to`` is its place in the mapping, empty where it is left open; and why."""

    column: str
    to: str
    unit: str
    why: str


@dataclass(frozen=True, repr=False)
class Draft(Result):
    """A draft: its file and text, what its columns were taken for, and which fields somebody has to fill in.

    ``columns`` are the file's but those of its times, with their readings, in the order of ``guesses``; rows are
    usually ``interval`` apart [s].
    """

    path: Path
    data: Path
    text: str
    guesses: list[Guess]
    to_fill_in: list[str] = field(default_factory=list)
    columns: list[Column] = field(default_factory=list)
    interval: float = 0.0

    @property
    def headline(self) -> str:
        """The file, how many columns have a place, and what is to be filled in."""
        used = sum(bool(one.to) for one in self.guesses)
        fill = f"; fill in {', '.join(self.to_fill_in)}" if self.to_fill_in else ""
        return f"{self.path.name}: {used} of {len(self.guesses)} columns placed{fill}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each column: its place in the mapping, its unit, and why."""
        import pandas as pd

        return pd.DataFrame([asdict(one) for one in self.guesses]).set_index("column")


def draft_mapping(data: Path | str, system: System | Path | str | None = None, *, out: Path | str) -> Draft:
    """Look at a file of measurements and write a mapping with what its columns seem to be, each with its reason.

    What cannot be known, such as the place, is left to be filled in; what a column's name does not tell is left open.

    Parameters
    ----------
    data
        The measurements: CSV, Excel, Parquet or NetCDF.
    system
        The description of what is measured; that of the paper's room, if not given.
    out
        The mapping to write.

    Raises
    ------
    RecordingError
        If the file cannot be read as a table with a time, or the mapping is there already.
    """
    data, out = Path(data), Path(out)
    if out.suffix.lower() != ".toml":
        raise RecordingError(f"{out}: ending is {out.suffix!r}; expected .toml")
    if out.exists():
        raise RecordingError(f"{out}: is there already; expected another name (--out), or that it is removed first")
    check_folder(out.parent, RecordingError)
    named = system or USUAL
    described = named if isinstance(named, System) else load_system(named)
    layout = layout_of(data)
    columns = guess(layout, described)
    text = "\n".join(_lines(layout, columns, described, _reference(named, out))) + "\n"
    if len(text.encode()) > MOST_TOML:
        raise RecordingError(f"{data}: has {len(columns)} columns; expected so few that a mapping can name them")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with open(out, "x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written ({error.strerror or error})") from None
    open_fields = list(unfilled(parse_toml(text, str(out), RecordingError)))
    return Draft(out, data, text, [_guess(one) for one in columns], open_fields, columns, layout.interval)


def _reference(system: System | Path | str, out: Path) -> str:
    """How a mapping at ``out`` names a system: as it came, or by a path from the mapping's folder."""
    path = Path(str(system.path)) if isinstance(system, System) else Path(system)
    if not path.exists():
        return str(path)
    return Path(os.path.relpath(path.resolve(), out.parent.resolve())).as_posix()


def _guess(column: Column) -> Guess:
    if column.target is None:
        return Guess(column.name, "", "", column.open)
    unit = str(column.fields["unit"])
    return Guess(column.name, f"{column.target.table}.{column.target.name}", unit, column.reasons["column"])


def _quoted(text: str) -> str:
    """A string of TOML."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else _quoted(name)


def _line(name: str, value: object, why: str = "") -> str:
    if isinstance(value, list):
        shown = "[" + ", ".join(_quoted(str(one)) for one in value) + "]"
    else:
        shown = _quoted(value) if isinstance(value, str) else f"{value!r}"
    return f"{name} = {shown}" + (f"  # {_comment(why)}" if why else "")


def _comment(text: str) -> str:
    """A text that stays within a comment's line."""
    return "".join(one if one.isprintable() else " " for one in text)


def _lines(layout: Layout, columns: Sequence[Column], system: System, reference: str) -> Iterator[str]:
    yield f"# Drafted from {_comment(layout.path.name)}. Each guess has its reason: read, and correct."
    yield f'# Fill in each "{OPEN}". All that a mapping may say: docs/reference/mapping.md'
    yield "schema_version = 1"
    yield _line("system", reference, "a path from this file's folder, or the name of one that comes with the package")
    yield ""
    yield from _file(layout)
    yield from _time(layout)
    used = {one.target.name for one in columns if one.target is not None}
    sun = bool(used & {"ghi", "dni", "dhi"})
    mark = "" if sun else "# "
    yield f"{mark}[place]  # where the building stands, from which the sun's height follows"
    yield f'{mark}latitude = "{OPEN}"  # degrees north of the equator, as 52.5'
    yield f'{mark}longitude = "{OPEN}"  # degrees east of Greenwich, as 13.4 (west of it below zero)'
    yield ""
    step = layout.interval
    yield "[grid]" if step > system.experiment.step else "# [grid]"
    yield ("" if step > system.experiment.step else "# ") + _line(
        "step",
        max(step, system.experiment.step),
        f"seconds; rows are {step:g} s apart, and the system's own step is {system.experiment.step:g} s",
    )
    yield ""
    for table in ("variables", "weather"):
        for one in columns:
            if one.target is not None and one.target.table == table:
                yield from _table(one)
    left = [one for one in columns if one.target is None and one.open and not one.open.startswith("compared with")]
    if left:
        yield "# Left open: take the # away from what you know, with the right name and unit."
        for one in left:
            yield "#"
            yield f"# {_comment(one.open)}"
            yield f"# [variables.{OPEN}]"
            yield "# " + _line("column", one.name)
            yield "# " + _line("unit", one.meaning.unit or OPEN)


def _file(layout: Layout) -> Iterator[str]:
    usual = File()
    fields = {
        name: getattr(layout.file, name)
        for name in ("encoding", "separator", "decimal", "skip", "below", "sheet", "missing", "names", "values")
        if getattr(layout.file, name) != getattr(usual, name)
    }
    if fields:
        yield "[file]"
        for name, value in fields.items():
            yield _line(name, value, layout.why.get(name, ""))
        yield ""


def _time(layout: Layout) -> Iterator[str]:
    yield "[time]"
    columns = layout.columns
    yield _line("column", columns[0] if len(columns) == 1 else columns)
    if not layout.form:
        yield _line("format", OPEN, f"both read all stamps: {' and '.join(layout.forms)}")
    elif layout.form != "ISO8601":
        yield _line("format", layout.form, "it reads all stamps")
    if layout.offset:
        yield "# " + _line(
            "zone", OPEN, "the stamps have their offset from UTC; a name as Europe/Berlin tells daylight saving, too"
        )
    else:
        yield _line("zone", OPEN, "the clock of the stamps: as Europe/Berlin, or +01:00 if it knows no daylight saving")
        if layout.form == "unix" or layout.form.startswith("ISO"):
            yield "# " + _line("stamps", "UTC", "if the stamps are in UTC; zone is then the place's")
    yield ""


def _table(column: Column) -> Iterator[str]:
    assert column.target is not None
    yield f"# {_comment(column.reasons['column'])}"
    yield f"[{column.target.table}.{_key(column.target.name)}]"
    for name, value in column.fields.items():
        yield _line(name, value, "" if name == "column" else column.reasons.get(name, ""))
    if "reading" not in column.fields:
        yield f"# {column.reasons['reading']}"
    if column.target.quantities <= {"temperature", "wind_speed", "co2"}:
        yield from _stuck_after(column)
    if column.second is not None:
        second = column.second
        inner = [_line("column", second.name), _line("unit", second.fields["unit"])]
        inner += [_line("scale", second.fields["scale"])] if "scale" in second.fields else []
        yield f"compare = {{ {', '.join(inner)} }}  # {_comment(second.looks)}; drawn beside it, never used"
    yield ""


def _stuck_after(column: Column) -> Iterator[str]:
    """A line on readings that stand still for so long that the import leaves them out as stuck.

    A sensor that was stuck comes back with a jump, because what it measures has moved on; calm weather goes on by the
    finest step of the readings, within the day.
    """
    wall, seen = column.wall[column.read], column.seen
    change = np.abs(np.diff(seen))
    ends = np.flatnonzero(change > 0)
    begins = np.concatenate([[0], ends + 1])
    hours = (wall[np.concatenate([ends, [len(seen) - 1]])] - wall[begins]) / 3600.0
    long = np.flatnonzero(hours > _STUCK)
    if not long.size or not ends.size:
        return
    longest, leaving = float(hours.max()), change[ends[long[long < len(ends)]]]
    calm = longest <= _DAY and bool((leaving <= 1.5 * float(np.diff(np.unique(seen)).min())).all())
    if calm:
        why = f"it stands still for up to {longest:.3g} h, and goes on by its finest step: no sensor that is stuck"
        yield _line("stuck_after", _DAY, why)
    else:
        yield f"# it stands still for up to {longest:.3g} h, which is left out as stuck; if it is not, give the hours:"
        yield "# " + _line("stuck_after", float(np.ceil(longest + 1)))
