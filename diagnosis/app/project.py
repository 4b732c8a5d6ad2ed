"""A project: one folder with a file of measurements and all that is made of it, step by step.

    measurements -> mapping.toml -> recording.nc -> calibration/, forecast/, diagnosis/
                    room.toml (what is known of the room) ----^

Every step is a file that the commands read as well, and a step that changes removes what was made from it. So the
folder is the whole state: a page that is loaded again, or another program, finds it there.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from datagen.driving.sampling import fmu_values
from diagnosis.measurements.draft import draft_mapping
from diagnosis.measurements.guess import targets_of
from diagnosis.measurements.importer import import_recording
from diagnosis.measurements.mapping import EXAMPLES, OPEN, unfilled
from diagnosis.measurements.output import ImportReport
from diagnosis.measurements.units import convert
from diagnosis.measurements.vocabulary import measured_in, words_for
from diagnosis.pages import WEATHER
from shared.errors import RecordingError, ZeroshotError
from shared.numbers import number
from shared.places import check_folder
from shared.reading import MIB, parse_toml, read_toml
from shared.shipped import estimator_beside, resolved
from shared.store import write_atomically
from shared.system import System, load_system, parse_system
from shared.variables import spaced

MOST = 256 * MIB
"""Bytes of a file of measurements that the page takes: ten years of minutes of twenty sensors."""
ENDINGS = (".csv", ".txt", ".tsv", ".xlsx", ".parquet", ".nc")
POINTS = 160
"""Points of a column's small picture: about as many as it has pixels."""
STEPS = {"calibration": "calibrate", "forecast": "forecast", "diagnosis": "diagnose"}
"""Folders of the answers, and the public functions that make them."""
PAGES = {"calibration": "calibration.html", "forecast": "forecast.html", "diagnosis": "report.html"}
READINGS = {"point": "instants", "mean": "means", "hold": "holds until the next"}
_UNITS = (
    "degC", "K", "degF", "ppm", "percent", "fraction", "W", "kW", "W/m2", "kW/m2", "m/s", "km/h", "m3/h", "m3/s",
    "l/s", "kg/s", "kg/h", "persons", "presence", "1",
)  # fmt: skip
_SETTINGS = "app.json"


@dataclass(frozen=True)
class Target:
    """What a column may be: ``key`` is its table and name in a mapping, ``units`` those that can become its own."""

    key: str
    label: str
    unit: str
    units: tuple[str, ...]


@dataclass(frozen=True)
class Column:
    """A column of the measurements: what it was taken for (empty: nothing), and why.

    ``points`` are some of its readings, for a small picture; ``looks`` its range in words; ``span`` its lowest and
    highest reading [``unit``].
    """

    name: str
    to: str
    unit: str
    reading: str
    why: str
    looks: str
    points: tuple[float, ...] = ()
    span: tuple[float, float] = (math.nan, math.nan)
    more: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


@dataclass(frozen=True)
class Fact:
    """What an engineer may know of a room: a parameter, a constant or given fact of the description, its facade."""

    key: str
    kind: Literal["parameters", "fixed", "given", "weather"]
    label: str
    unit: str
    usual: str


@dataclass(frozen=True)
class Look:
    """What a file of measurements seems to be: its columns, the mapping as a table, and what is to be filled in."""

    columns: list[Column]
    mapping: dict[str, Any]
    time: str
    rows: int
    interval: float

    @property
    def open(self) -> list[str]:
        """Fields that somebody has to fill in, but those of columns: these go with their choice."""
        return [one for one in unfilled(self.mapping) if one.split(".")[0] not in ("variables", "weather")]


class Project:
    """The folder and what is in it.

    Parameters
    ----------
    folder
        Where everything is kept; it is made if it is not there.
    system
        System description (TOML), its folder, or the name of one that comes with the package.

    Raises
    ------
    RecordingError
        If the folder cannot be written to.
    SystemDescriptionError
        If the description cannot be used.
    """

    def __init__(self, folder: Path | str, system: Path | str) -> None:
        self.folder = Path(folder).resolve()
        check_folder(self.folder, RecordingError)
        self.folder.mkdir(parents=True, exist_ok=True)
        shipped = resolved(system)
        self.reference = str(system) if not Path(system).exists() else str(shipped.resolve())
        self.described = load_system(system)

    # ------------------------------------------------------------ what there is

    @property
    def settings(self) -> dict[str, Any]:
        """Choices that stand in no file of their own: ``data``, ``facts``, ``replay``, ``minutes``."""
        path = self.folder / _SETTINGS
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):  # not there, or written by somebody else
            found = {}
        return {"data": "", "facts": {}, "replay": False, "minutes": None, **(found if isinstance(found, dict) else {})}

    def _set(self, **changes: Any) -> None:
        text = json.dumps({**self.settings, **changes}, indent=1, ensure_ascii=False)
        write_atomically(self.folder / _SETTINGS, text.encode())

    @property
    def data(self) -> Path | None:
        """The file of measurements, if there is one."""
        name = str(self.settings["data"])
        return self.folder / name if name and (self.folder / name).is_file() else None

    @property
    def mapping(self) -> Path:
        """The mapping of its columns."""
        return self.folder / "mapping.toml"

    @property
    def room(self) -> Path:
        """The description of this very room, if something is known of it."""
        return self.folder / "room.toml"

    @property
    def recording(self) -> Path:
        """The recording that was made of the measurements."""
        return self.folder / "recording.nc"

    @property
    def system(self) -> System:
        """The description that fits the room: with what is known of it, if anything is."""
        return load_system(self.room) if self.room.exists() else self.described

    @property
    def imported(self) -> ImportReport | None:
        """What the import said of the recording, if there is one."""
        try:
            return ImportReport.model_validate_json((self.folder / "import.json").read_bytes())
        except (OSError, ValidationError):  # not there, or of another version: imported again
            return None

    def done(self, step: str) -> bool:
        """Whether an answer is there, whole."""
        return (self.folder / step / PAGES[step]).is_file()

    def page(self, step: str) -> str:
        """An answer's own page as HTML."""
        return (self.folder / step / PAGES[step]).read_text(encoding="utf-8")

    # ------------------------------------------------------------ measurements

    def receive(self, name: str, content: bytes) -> Path:
        """Keep a file of measurements, and forget all that was made of another one.

        Raises
        ------
        RecordingError
            If it is too large, empty, or of a kind that no reader reads.
        """
        plain = re.sub(r"[^\w.\- ]", "_", Path(name.replace("\\", "/")).name).lstrip(".") or "measurements"
        stem, ending = Path(plain).stem, Path(plain).suffix
        if ending.lower() not in ENDINGS:
            raise RecordingError(f"{name}: ending is {ending!r}; expected one of {', '.join(ENDINGS)}")
        if len(content) > MOST:
            raise RecordingError(
                f"{name}: has {len(content) / MIB:.0f} MiB; expected at most {MOST // MIB} MiB: split it by years, or"
                " use the command `diagnosis import`"
            )
        if not content:
            raise RecordingError(f"{name}: is empty; expected a table with a column of times")
        self._forget(mapping=True)
        path = self.folder / f"{'measurements' if plain == self.recording.name else stem[:100]}{ending.lower()}"
        write_atomically(path, content)
        self._set(data=path.name)
        return path

    def look(self) -> Look:
        """What the columns seem to be; where a mapping was written already, what it says of them.

        Raises
        ------
        RecordingError
            If there is no file, or it cannot be read as a table with times.
        """
        if self.data is None:
            raise RecordingError(f"{self.folder}: has no measurements; expected a CSV, Excel, Parquet or NetCDF file")
        with tempfile.TemporaryDirectory(dir=self.folder, prefix=".draft-") as place:
            draft = draft_mapping(self.data, self.described, out=Path(place) / "mapping.toml")
        raw = parse_toml(draft.text, "the draft", RecordingError)
        raw["system"] = self.reference
        if self.mapping.exists():
            kept = read_toml(self.mapping, RecordingError, "a column mapping (TOML)")
            if _columns_of(kept) <= {one.name for one in draft.columns}:  # else somebody put another file there
                raw = kept
        placed = {
            fields["column"]: (f"{table}.{name}", fields)
            for table in ("variables", "weather")
            for name, fields in raw.get(table, {}).items()
            if "column" in fields
        }
        columns = []
        for one, guess in zip(draft.columns, draft.guesses, strict=True):
            to, fields = placed.get(one.name, ("", {}))
            more = {k: v for k, v in fields.items() if k not in ("column", "unit", "reading")}
            unit, reading = str(fields.get("unit", one.meaning.unit or "")), str(fields.get("reading", ""))
            seen = one.seen[:: max(len(one.seen) // POINTS, 1)] if one.seen.size else one.seen
            points = tuple(float(value) for value in seen)
            span = (float(one.seen.min()), float(one.seen.max())) if one.seen.size else (math.nan, math.nan)
            columns.append(Column(one.name, to, unit, reading, guess.why, one.looks, points, span, more))
        time = raw["time"]["column"]
        rows = len(draft.columns[0].values) if draft.columns else 0
        return Look(columns, raw, time if isinstance(time, str) else " and ".join(time), rows, draft.interval)

    def targets(self) -> list[Target]:
        """What columns may be, with the units that a column of it may have."""
        long = {one.name: one.long_name for one in self.described.outputs} | WEATHER
        found = []
        for one in targets_of(self.described):
            quantities = one.quantities - {"presence"} or one.quantities
            words = " ".join(words_for([name]) for name in [*sorted(one.places), *sorted(one.roles | quantities)])
            kinds = one.quantities & {kind for unit in _UNITS for kind in measured_in(unit)}
            fits = tuple(
                unit for unit in _UNITS if becomes(unit, one.unit) and (not kinds or kinds & {*measured_in(unit)})
            )
            found.append(
                Target(f"{one.table}.{one.name}", f"{long.get(one.name) or words} ({one.name})", one.unit, fits)
            )
        return found

    # ------------------------------------------------------------ mapping and recording

    def choose(self, look: Look, columns: list[Column], given: Mapping[str, str]) -> Path:
        """Write the mapping that was chosen.

        Parameters
        ----------
        look
            What the measurements seem to be, as :meth:`look` has it.
        columns
            Its columns, with what each is to be.
        given
            What was filled in, by the field's place in the mapping, as ``time.zone`` or ``place.latitude``.

        Raises
        ------
        RecordingError
            If two columns are to be the same, a unit is missing, or a number is none.
        """
        raw = {name: value for name, value in look.mapping.items() if name not in ("variables", "weather", "place")}
        raw["time"] = {name: value for name, value in raw["time"].items() if value != OPEN}
        place = {k: v for k, v in look.mapping.get("place", {}).items() if v != OPEN}
        for where, text in given.items():
            table, _, name = where.partition(".")
            if table == "place":
                place.pop(name, None)
                place |= {name: _number(text, where)} if text.strip() else {}
            elif text.strip():
                raw.setdefault(table, {})[name] = text.strip()
            elif where in look.open:
                raise RecordingError(f"{where}: is empty; expected a value{EXAMPLES.get(name, '')}")
        raw["place"] = place
        tables: dict[str, dict[str, Any]] = {
            table: {name: one for name, one in look.mapping.get(table, {}).items() if "column" not in one}
            for table in ("variables", "weather")
        }
        for one in columns:
            if not one.to:
                continue
            table, _, name = one.to.partition(".")
            if name in tables[table]:
                first = tables[table][name].get("column", "a constant")
                raise RecordingError(f"{first!r} and column {one.name!r} are both {name}; expected one of them")
            if one.unit in ("", "-", OPEN):
                raise RecordingError(f"column {one.name!r} has no unit; expected one, as degC")
            same = any(was.name == one.name and was.to == one.to for was in look.columns)
            more = one.more if same else {}
            reading = {"reading": one.reading} if one.reading else {}
            tables[table][name] = {"column": one.name, "unit": one.unit, **reading, **more}
        if not tables["variables"]:
            raise RecordingError(f"no column is an output of {self.described.name}; expected one, as the room's air")
        self._forget()
        text = as_toml({name: value for name, value in {**raw, **tables}.items() if value != {}})
        write_atomically(self.mapping, text.encode())
        return self.mapping

    def make_recording(self) -> ImportReport:
        """Import the measurements by the mapping, for the room as it is known.

        Raises
        ------
        RecordingError, SystemDescriptionError
            If measurements, mapping or description cannot be used.
        """
        self._forget()
        assert self.data is not None
        report = import_recording(self.mapping, self.data, out=self.recording, system=self.system)
        write_atomically(self.folder / "import.json", report.model_dump_json(indent=1).encode())
        return report

    def said_of(self, report: ImportReport) -> dict[str, list[tuple[str, bool]]]:
        """What the import found, by the column that it is about: sentences, and whether each is strong.

        What is about no column stands under the empty name.
        """
        behind = {one.name: one.origin for one in report.variables}
        columns = sorted(_columns_of(read_toml(self.mapping, RecordingError, "a mapping")), key=len, reverse=True)
        found: dict[str, list[tuple[str, bool]]] = {}
        for finding in report.physics:
            about = [one for one in columns if any(one in behind.get(name, "") for name in finding.names)]
            for name in about or [""]:
                found.setdefault(name, []).append((finding.text, finding.strong))
        for note in report.notes:
            subject = note.partition(":")[0]
            origin = behind.get(subject, "")
            about = [one for one in columns if one == subject or origin.startswith(f"{one} [")]
            found.setdefault(about[0] if about else "", []).append((note, False))
        return found

    # ------------------------------------------------------------ what is known of the room

    def facts(self) -> list[Fact]:
        """What an engineer may know: the description's parameters, its constants, and where the facade looks."""
        system = self.described
        found = [
            Fact(one.name, "parameters", one.description or one.name, one.unit, f"{one.min:g} to {one.max:g}")
            for one in system.parameters
        ]
        found += [
            Fact(name, "fixed", name, "", f"{value:g}")
            for name, value in system.fixed.items()
            if not isinstance(value, bool)
        ]
        for one in system.told:
            if one.parameters and one.of == "each":  # a sum is shared out by the FMU's own values
                per = f" per {one.per}" if one.per else ""
                found.append(Fact(one.name, "given", one.description, one.unit, f"{one.min:g} to {one.max:g}{per}"))
        if system.weather is not None:
            facade = {
                "surface_azimuth": "Facade looks to (90 east, 180 south)",
                "surface_tilt": "Facade's tilt (90 upright)",
            }
            found += [
                Fact(name, "weather", words, "deg", f"{getattr(system.weather, name):g}")
                for name, words in facade.items()
            ]
        return found

    def know(self, values: Mapping[str, str], *, replay: bool) -> None:
        """Write the description of this room, with what is known of it in place of ranges and usual constants.

        Parameters
        ----------
        values
            By the fact's key, as text; what is empty is not known.
        replay
            Whether the logged actuators drive the model in place of its own controllers.

        Raises
        ------
        RecordingError, SystemDescriptionError
            If a value is no number, or none that the description can have.
        """
        known = {key: _number(text, key) for key, text in values.items() if text.strip()}
        settings = self.settings
        if known != settings["facts"]:
            text = self._described_with(known)
            self._forget()
            self.room.unlink(missing_ok=True)
            if text:
                write_atomically(self.room, text.encode())
        elif replay != settings["replay"]:
            self._forget(recording=False)
        self._set(facts=known, replay=replay)

    def _described_with(self, known: Mapping[str, float]) -> str:
        """The room's description as TOML; empty where nothing is known."""
        if not known:
            return ""
        facts = {one.key: one.kind for one in self.facts()}
        constants = {key: value for key, value in known.items() if facts[key] in ("parameters", "fixed")}
        constants |= fmu_values(self.described, {k: v for k, v in known.items() if facts[k] == "given"}, {})
        if len(set(constants) & set(self.described.parameter_names)) == len(self.described.parameters):
            raise RecordingError("all parameters are known; expected one at least that is to be found")
        raw = self.described.with_known(constants).model_dump(mode="json", exclude={"path"})
        raw["parameters"] = [one for one in raw["parameters"] if one["name"] not in constants]
        for one in raw["sources"]:
            one["per"] = constants.get(one["per"], one["per"])
        for one in raw.get("given", []):
            if one["per"] in constants:
                factor, one["per"] = constants[one["per"]], ""
                one["min"], one["max"] = one["min"] * factor, one["max"] * factor
        crowd = raw["occupancy"] or {}
        if crowd.get("per") in constants:  # persons per unit of what is known now: so many at least and at most
            least, most = crowd["headcount"]
            headcount = [min(max(round(one * constants[crowd["per"]]), least), most) for one in crowd["density"]]
            raw["occupancy"] = {**crowd, "headcount": headcount, "density": None, "per": ""}
        raw["ratios"] = [one for one in raw.get("ratios", []) if not {one["over"], one["under"]} & {*constants}]
        home = self.described.path.parent
        raw["fmu"] = str(self.described.fmu_path)
        if raw["weather"] is not None:
            raw["weather"] |= {key: value for key, value in known.items() if facts[key] == "weather"}
            files = raw["weather"]["files"]
            raw["weather"]["files"] = [str((home / one).resolve()) if (home / one).exists() else one for one in files]
        text = as_toml(raw)
        parse_system(text, self.room)
        return text

    # ------------------------------------------------------------ answers

    def asked(self, step: str) -> dict[str, Any]:
        """Keyword arguments of the public function that makes an answer, but those of progress.

        Parameters of the forecast: two thirds of the recording in whole days, then the rest.
        """
        settings = self.settings
        asked: dict[str, Any] = {
            "system": self.room.name if self.room.exists() else self.reference,
            "recording": self.recording.name,
            "out": step,
        }
        beside = estimator_beside(self.system.path)
        if beside is not None and step != "diagnosis":  # a diagnosis finds it by itself
            asked["run"] = self.reference if resolved(self.reference).is_dir() else str(beside)
        if settings["replay"]:
            asked["replay"] = True
        if settings["minutes"] is not None:
            asked["minutes"] = float(settings["minutes"])
        report = self.imported
        if step == "forecast" and report is not None:
            hours = max((one.hours for one in report.stretches), default=0.0)
            context = max(24.0, 24.0 * (2 * hours // (3 * 24)))
            step_hours = report.step / 3600.0
            asked |= {"context": context, "ahead": math.floor((hours - context) / step_hours + 1e-6) * step_hours}
        return asked

    def begin(self, step: str, minutes: float | None = None) -> None:
        """Note the time that there is for an answer, and that there is none yet."""
        self._set(minutes=minutes)
        (self.folder / step / PAGES[step]).unlink(missing_ok=True)

    def commands(self) -> str:
        """The shell's lines that do the same."""
        lines = [f"cd {_quoted(str(self.folder))}"]
        data = "" if self.data is None else self.data.name
        room = " --system room.toml" if self.room.exists() else ""
        lines.append(f"diagnosis import mapping.toml {_quoted(data)}{room} --out recording.nc")
        for step, function in STEPS.items():
            asked = self.asked(step)
            words = [_quoted(str(asked.pop("system"))), asked.pop("recording")]
            for name, value in asked.items():
                words += [f"--{name}"] if value is True else [f"--{name}", _quoted(f"{value}")]
            lines.append(f"diagnosis {'run' if function == 'diagnose' else function} {' '.join(words)}")
        return "\n".join(lines)

    def python(self) -> str:
        """The same in Python."""
        data = "" if self.data is None else self.data.name
        room = ', system="room.toml"' if self.room.exists() else ""
        lines = ["import os", "import diagnosis", "", f"os.chdir({str(self.folder)!r})"]
        lines.append(f'diagnosis.import_recording("mapping.toml", {data!r}, out="recording.nc"{room})')
        for step, function in STEPS.items():
            asked = self.asked(step)
            first = f"{asked.pop('system')!r}, {asked.pop('recording')!r}"
            rest = ", ".join(f"{name}={value!r}" for name, value in asked.items())
            lines.append(f"{'answer' if step == 'diagnosis' else step} = diagnosis.{function}({first}, {rest})")
        return "\n".join(lines)

    def _forget(self, *, mapping: bool = False, recording: bool = True) -> None:
        """Remove what was made from what is about to change."""
        for step in STEPS:
            shutil.rmtree(self.folder / step, ignore_errors=True)
        names = ["recording.nc", "recording.png", "import.json"] if recording else []
        for name in [*names, *(["mapping.toml"] if mapping else [])]:
            (self.folder / name).unlink(missing_ok=True)


def combined(project: Project) -> str:
    """All answers that are there as one page: self-contained, as each is."""
    parts: list[str] = []
    head: dict[str, None] = {}
    for step in STEPS:
        if project.done(step):
            page = project.page(step)
            above, _, body = page.removesuffix("</body>\n</html>").partition("</head>\n<body>")
            head |= dict.fromkeys(re.findall(r"<style>.*?</style>|<script.*?</script>", above, flags=re.S))
            parts.append(f'<section id="{step}">{body}</section>')
    if not parts:
        raise RecordingError(f"{project.folder}: has no answer yet; expected a calibration, forecast or diagnosis")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><title>{project.described.name}</title>'
        f"{''.join(head)}<style>section + section {{ margin-top: 4rem; border-top: 2px solid #1b1f24; }}</style>"
        f"</head><body>{''.join(parts)}</body></html>"
    )


def in_target(column: Column, target: str) -> str:
    """The range of a column's readings in the unit of what it is to be, or why it has none; empty if it is the same."""
    target = "degC" if target == "K" else target
    if column.unit == target:
        return ""
    try:
        low, high = convert(np.array(column.span), column.unit, target, density=1.2, where=column.name)
    except RecordingError as error:
        return str(error)
    return f"{number(round(float(low), 9), 4)} to {number(round(float(high), 9), 4)}{spaced(target)}"


def as_toml(table: Mapping[str, Any]) -> str:
    """A table as TOML: scalars, then tables, then lists of tables; what lies deeper stands in one line."""
    lines = [f"{_key(k)} = {_value(v)}" for k, v in table.items() if v is not None and not _is_table(v)]
    for name, value in table.items():
        for one in value if isinstance(value, list) and _is_table(value) else [value] if _is_table(value) else []:
            head = f"[[{_key(name)}]]" if isinstance(value, list) else f"[{_key(name)}]"
            lines += ["", head, *(f"{_key(k)} = {_value(v)}" for k, v in one.items() if v is not None)]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)
    )


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def _columns_of(mapping: Mapping[str, Any]) -> set[str]:
    tables = [mapping.get(one) for one in ("variables", "weather")]
    fields = [one for table in tables if isinstance(table, dict) for one in table.values() if isinstance(one, dict)]
    return {str(one["column"]) for one in fields if "column" in one}


def becomes(unit: str, target: str) -> bool:
    """Whether readings in a unit can become those of another."""
    try:
        convert(0.0, unit, target, density=1.2, where="")
    except ZeroshotError:
        return False
    return True


def _number(text: str, where: str) -> float:
    try:
        value = float(text.strip().replace(",", "."))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(f"{where}: is {text.strip()!r}; expected a number, as 48.5")
    return value


def _quoted(word: str) -> str:
    return word if re.fullmatch(r"[\w./:+=-]+", word) else json.dumps(word, ensure_ascii=False)
