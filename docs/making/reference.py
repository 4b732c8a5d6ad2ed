"""Write the pages of ``docs/reference`` that are made from the code: system.toml, the mapping, the commands.

    python docs/making/reference.py

A test holds the pages to what this makes.
"""

from __future__ import annotations

import json
import re
import sys
import types
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin
from unittest.mock import patch

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from datagen.cli import app as datagen_app
from datagen.driving.weather import UNITS
from diagnosis.cli import app as diagnosis_app
from diagnosis.measurements import mapping
from diagnosis.measurements.mapping import MEASURABLE
from shared import effects, given, signals, system, variables
from trainer.cli import app as trainer_app

FOLDER = Path(__file__).resolve().parents[1] / "reference"
MADE = "<!-- Written from the code by make reference: change that, and run it again. -->\n"
WEATHER = {
    "temp_air": "air outdoors, dry bulb",
    "temp_dew": "dew point",
    "temp_sky": "sky as a black body, from infrared radiation, or from dew point and cloud cover",
    "wind_speed": "wind",
    "wind_direction": "where the wind comes from, clockwise from north",
    "pressure": "air",
    "ghi": "sun on the horizontal plane, in all",
    "dni": "sun on a plane that faces it, direct",
    "dhi": "sun on the horizontal plane, diffuse",
    "poa_global": "sun on the plane of [weather], in all",
}
"""What each column of the weather is."""
Part = tuple[str, type[BaseModel], str]
"""A heading, the table that it is about, and an example."""

SYSTEM_HEAD = """# The system description

One TOML file says what an FMU is used for. `datagen describe mine.fmu --out system.toml` drafts one. A whole one with
comments: [the default room](../../fmus/MixedAirCO2/system.toml); a short one: [a
house](../gallery/house/system.toml). How to go about it: [my FMU](../own-fmu.md).

- `[name]` is a table and stands once; `[[name]]` is one of a list.
- Needed are the top, `[estimator]`, one of `[[parameters]]` and one of `[[outputs]]`; the other tables where
  something names them.
- Unknown fields are refused, and all mistakes of a file are named at once.
- **Units** are spelled as in FMI: `K`, `degC`, `W/m2`, `kg/s`, `ppm`. They may differ from the FMU's if they are of
  one kind. **A signal without a unit is `"1"`**: a pure number, such as persons or a share. Where the FMU states no
  unit but computes in one, `fmu_unit` names it.
- Times of records are hours from Monday, 1 January, 0:00.
"""
SYSTEM: tuple[Part, ...] = (
    (
        "The top of the file",
        system.System,
        'schema_version = 1\nname = "House"\nfmu = "House.fmu"\n\n'
        '[fixed]\n"window.open" = false\n\n[replay]\nreplayed = true',
    ),
    (
        "[experiment]",
        system.Experiment,
        "[experiment]\nstep = 3600.0\nhours = 720.0\nstart = [0.0, 8040.0]\nwarm_up_hours = 240.0",
    ),
    ("[estimator]", system.Estimator, '[estimator]\nchannels = ["TAir", "TOut"]\ncontext_hours = 168.0'),
    ("[presets.NAME]", system.Preset, "[presets.january]\nsystems = 500\nhours = 336.0\nstart = [0.0, 408.0]"),
    (
        "[[parameters]]",
        variables.Parameter,
        '[[parameters]]\nname = "rw"\nunit = "K/W"\nmin = 3e-3\nmax = 2e-2\nscale = "log"\n\n'
        '[[parameters]]          # a range through zero is linear\nname = "offset"\nunit = "K"\nmin = -2.0\nmax = 2.0',
    ),
    (
        '[[inputs]] with source = "weather"',
        variables.WeatherInput,
        '[[inputs]]\nname = "TOut"\nunit = "degC"\nsource = "weather"\ncolumn = "temp_air"',
    ),
    (
        '[[inputs]] with source = "occupancy"',
        variables.OccupancyInput,
        '[[inputs]]\nname = "nPer"\nunit = "1"\nsource = "occupancy"',
    ),
    (
        '[[inputs]] with source = "schedule"',
        variables.ScheduleInput,
        '[[inputs]]\nname = "TSet"\nunit = "degC"\nsource = "schedule"\nschedule = "set_point"',
    ),
    (
        '[[inputs]] with source = "excitation"',
        variables.ExcitationInput,
        '[[inputs]]\nname = "uExc"\nunit = "1"\nsource = "excitation"\nexcitation = "waves"',
    ),
    (
        '[[inputs]] with source = "constant"',
        variables.ConstantInput,
        '[[inputs]]\nname = "pAtm"\nunit = "Pa"\nsource = "constant"\nvalue = 101325.0',
    ),
    (
        '[[inputs]] with source = "measured"',
        variables.MeasuredInput,
        '[[inputs]]\nname = "QHea"\nunit = "W"\nsource = "measured"\ncolumn = "heater"\ninterpolation = "previous"',
    ),
    (
        "[[outputs]]",
        variables.Output,
        '[[outputs]]\nname = "TAir"\nvariable = "room.air.T"\nunit = "degC"\naccuracy = 0.01\n\n'
        '[[outputs]]             # a meter adds up: the mean over each step\nname = "heater"\nunit = "W"\n'
        'method = "mean"\naccuracy = 1.0',
    ),
    (
        "[outputs.noise.PRESET]",
        variables.Noise,
        "[outputs.noise.sensor]  # of the output above\nsd = 20.0\nquantum = 1.0",
    ),
    (
        "[weather]",
        signals.Weather,
        '[weather]\nfiles = ["pvlib:723170TYA.CSV"]\nsurface_tilt = 90.0\nsurface_azimuth = 180.0',
    ),
    (
        "[occupancy]",
        signals.Occupancy,
        "[occupancy]\nheadcount = [1, 10]\narrival = [7.0, 9.5]\nduration = [7.0, 10.0]\njitter = 0.5\n"
        "attendance = [0.4, 1.0]\ngaps = [1, 3]\ngap_duration = [0.4, 1.5]\ngap_share = [0.3, 1.0]\nabsence = 0.05\n"
        "weekend = 0.15",
    ),
    (
        "[schedules.NAME]",
        signals.Schedule,
        "[schedules.set_point]\nweekday = [[0.0, 17.0], [6.0, 21.0], [22.0, 17.0]]\nweekend = [[0.0, 17.0]]",
    ),
    (
        "[schedules.NAME.drawn]",
        signals.DrawnSchedule,
        "[schedules.set_point.drawn]\nlow = [15.0, 18.0]\nhigh = [20.0, 22.0]\nbegin = [5.0, 8.0]\nend = [16.0, 22.0]",
    ),
    (
        "[excitations.NAME]",
        signals.Excitation,
        "[excitations.waves]\ncomponents = [{ amplitude = 0.05, period = 7.3 }, { amplitude = 0.05, period = 3.1 }]",
    ),
    ("One of its components", signals.Sinusoid, ""),
    (
        "[[given]]",
        given.Given,
        '[[given]]\nname = "window share"\nunit = "1"\nmin = 0.2\nmax = 0.6\nparameters = ["window.share"]',
    ),
    ("[[ratios]]", given.Ratio, '[[ratios]]\nover = "offset"\nunder = "rw"\nmin = 0.0\nmax = 1000.0'),
    (
        "[[uncertain]]",
        variables.Uncertain,
        '[[uncertain]]\nname = "floor"\nparameters = ["floor.c"]\nrelative = 0.3',
    ),
    (
        "[[sources]]",
        variables.Source,
        '[[sources]]\nname = "heat"\ndescription = "missing heat"\nunit = "W"\ninput = "QHea"',
    ),
    (
        '[[effects]] with kind = "parameter"',
        effects.ParameterEffect,
        '[[effects]]\nname = "infiltration"\nkind = "parameter"\nunit = "1/h"\nscale = 0.2\nlower = 0.0\nupper = 2.0\n'
        "parameters = { leak = 1.0 }",
    ),
    (
        '[[effects]] with kind = "shaped"',
        effects.ShapedEffect,
        '[[effects]]\nname = "night cooling"\nkind = "shaped"\nunit = "kg/s"\nscale = 0.05\nlower = 0.0\nupper = 0.5\n'
        'parameters = { flow = 1.0 }\ninput = "open"\nshape = [{ form = "timetable", hours = [[22.0, 6.0]] }]',
    ),
    (
        '[[effects]] with kind = "input"',
        effects.InputEffect,
        '[[effects]]\nname = "blinds"\nkind = "input"\nunit = "1"\nscale = 0.3\nlower = -0.9\nupper = 0.5\n'
        'input = "HSol"\noperation = "gain"',
    ),
    (
        '[[effects]] with kind = "sensor"',
        effects.SensorEffect,
        '[[effects]]\nname = "thermometer"\nkind = "sensor"\nunit = "K"\nscale = 0.5\nlower = -3.0\nupper = 3.0\n'
        'outputs = ["TAir"]\noperation = "bias"',
    ),
    (
        'A shape with form = "timetable"',
        effects.TimetableShape,
        'shape = [{ form = "timetable", hours = [[8.0, 17.0]], days = "weekday" }]',
    ),
    ('A shape with form = "diurnal"', effects.DiurnalShape, 'shape = [{ form = "diurnal", peak = 15.0 }]'),
    (
        'A shape with form = "threshold"',
        effects.ThresholdShape,
        'shape = [{ form = "threshold", series = "TAir", threshold = 24.0, width = 0.5 }]',
    ),
    (
        'A shape with form = "presence"',
        effects.PresenceShape,
        'shape = [{ form = "presence", series = "nPer", half = 1.0 }]',
    ),
    (
        'A shape with form = "series"',
        effects.SeriesShape,
        'shape = [{ form = "series", series = "TOut", reference = 10.0 }]',
    ),
)

MAPPING_HEAD = """# The mapping

One TOML file says which column of a log is which variable. `diagnosis import --draft log.csv` writes one with a
reason for each guess; [mapping.toml](../example/mapping.toml) is one by hand. How to go about it: [my
measurements](../own-measurements.md).

- A column's name counts whichever way its letters are composed and its blanks written; other capitals where no second
  would do.
- Where the stamps carry an offset from UTC that is not UTC's own, `time.zone` may be left out: the clock is theirs.
- Numbers of 25 000 to 60 000 as stamps are Excel's days; `format = "unix"` reads seconds since 1970 and parts of
  them.
- `"?"` stands where somebody has to fill something in: the import names each.
- Units are spelled as in a [system description](system.md); a column without one is `"1"`.
"""
_SOURCE = (
    '[variables.TAir]\ncolumn = "Room temperature"\nunit = "degC"\n\n'
    '[variables.heater]\ncolumn = "Heat"\nunit = "kW"\nreading = "mean"'
)
MAPPING: tuple[Part, ...] = (
    ("The top of the file", mapping.Mapping, 'schema_version = 1\nsystem = "system.toml"\nsource = "our own logger"'),
    ("[file]", mapping.File, '[file]\nseparator = ";"\ndecimal = ","'),
    ("[time]", mapping.Time, '[time]\ncolumn = "Time"\nzone = "Europe/Berlin"'),
    ("[place]", mapping.Place, "[place]\nlatitude = 52.5\nlongitude = 13.4\naltitude = 40.0"),
    ("[grid]", mapping.Grid, "[grid]\nstep = 900.0"),
    ("[defaults]", mapping.Defaults, '[defaults]\nreading = "point"'),
    ("[variables.NAME] and [weather.NAME]", mapping.Source, _SOURCE),
    (
        "[variables.NAME.compare]",
        mapping.Meter,
        '[variables.TAir.compare]\ncolumn = "Second thermometer"\nunit = "degC"',
    ),
)

COMMANDS_HEAD = """# The commands

Every command and every option. Exit codes, and how to stop and resume: [long runs](../running.md). Each command that
takes time has these, too:

* `--quiet`: Only warnings and errors; no progress bar.
* `--verbose`: Every step, as a line on standard error.
* `--log PATH`: Append every step to this file, one JSON object a line.
"""
EXAMPLES = {
    "datagen describe": "mine.fmu --out system.toml",
    "datagen run": "system.toml --systems 500 --out data",
    "datagen simulate": "system.toml --hours 336 --out one.nc",
    "datagen info": "data",
    "datagen verify": "data --repair",
    "datagen copy": "data elsewhere",
    "datagen merge": "data more --out both",
    "datagen identifiability": "system.toml --context 24 168 --noise sensor",
    "datagen compare": "system.toml other.toml --systems 5 --out apart",
    "trainer info": "run",
    "trainer fit": "data --model ridge --noise sensor --out run",
    "trainer tune": "data --model lstm --out tuned",
    "trainer evaluate": "run data",
    "trainer predict": "run week.nc --json",
    "trainer posterior": "run data",
    "trainer calibration": "run data",
    "trainer benchmark": "data --out bench",
    "diagnosis import": "mapping.toml log.csv --out week.nc",
    "diagnosis residuals": "system.toml week.nc --run run",
    "diagnosis calibrate": "system.toml week.nc --out calibrated",
    "diagnosis forecast": "system.toml weeks.nc --out forecast",
    "diagnosis run": "system.toml week.nc --out gap",
    "diagnosis farm": "system.toml --recordings 200 --out farmed",
    "diagnosis app": "my-room --system Room",
}
"""Arguments of an example of each command; the others have none."""


def main() -> None:
    """Write the pages."""
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")


def pages() -> dict[str, str]:
    """The pages by their names."""
    weather = _columns("Columns of the weather", UNITS, "By pvlib's names, for `column` of an input.")
    mapped = _columns(
        "Quantities of the weather", MEASURABLE, "For `[weather.NAME]`, and the unit to which each is brought."
    )
    return {
        "system.md": MADE + SYSTEM_HEAD + "".join(_section(*part) for part in SYSTEM) + weather,
        "mapping.md": MADE + MAPPING_HEAD + "".join(_section(*part) for part in MAPPING) + mapped,
        "commands.md": MADE
        + COMMANDS_HEAD
        + "".join(_commands(one) for one in (datagen_app, trainer_app, diagnosis_app)),
    }


def _section(heading: str, table: type[BaseModel], example: str) -> str:
    fields = sorted(
        table.model_fields.items(), key=lambda one: one[0] != "name"
    )  # of those that are alike the name first
    rows = [_row(name, field) for name, field in fields if name != "path"]
    heading = f"`{heading}`" if heading.startswith("[") and heading.endswith("]") else heading
    lines = [f"\n## {heading}\n\n{_plain(table.__doc__ or '')}\n\n| field | what it takes | if not given | meaning |"]
    lines += ["|---|---|---|---|", *(row for row in rows if row)]
    return "\n".join(lines) + "\n" + (f"\n```toml\n{example}\n```\n" if example else "")


def _row(name: str, field: FieldInfo) -> str:
    """A row of a table of fields; none of a field that is a table, which has a section of its own."""
    if _holds_tables(field.annotation) and not field.description:
        return ""
    default = "required" if field.is_required() else _value(field.get_default(call_default_factory=True))
    meaning = _plain(field.description or "which kind this is")
    cells = (f"`{name}`", _kind(field.annotation) + _limits(field.metadata), default, meaning)
    return f"| {' | '.join(one.replace('|', chr(92) + '|') for one in cells)} |"


def _holds_tables(kind: Any) -> bool:
    if isinstance(kind, type):
        return issubclass(kind, BaseModel)
    return any(_holds_tables(one) for one in get_args(kind))


def _kind(kind: Any) -> str:
    """What a field takes, in words."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _kind(inner[0])
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_kind(one) for one in inner if one is not type(None)))
    if origin is Literal:
        return ", ".join(f"`{json.dumps(one)}`" for one in inner)
    if origin is list:
        return f"list: {_kind(inner[0])}, ..."
    if origin is tuple:
        return f"two {_kind(inner[0])}s"
    if origin is dict:
        return f"table: name = {_kind(inner[1])}"
    names = {str: "text", float: "number", int: "whole number", bool: "true or false"}
    return names.get(kind, "table")


def _limits(metadata: Iterable[Any]) -> str:
    signs = {Ge: ("≥", "ge"), Gt: (">", "gt"), Le: ("≤", "le"), Lt: ("<", "lt")}
    found = [
        f"{sign} {getattr(one, name):g}"
        for one in metadata
        for kind, (sign, name) in signs.items()
        if isinstance(one, kind)
    ]
    return f", {' and '.join(found)}" if found else ""


def _value(value: Any) -> str:
    if value in (None, "", [], {}):
        return "nothing"
    if isinstance(value, BaseModel):
        return "its defaults"
    return f"`{json.dumps(value)}`"


def _plain(text: str) -> str:
    """A docstring as Markdown: one line a paragraph, roles and double ticks as code."""
    text = re.sub(r" ?(Load|Build) one with :\w+:`[^`]*`\.?", "", text)
    text = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text).replace("``", "`")
    return "\n\n".join(" ".join(one.split()) for one in re.split(r"\n\s*\n", text.strip()))


def _columns(heading: str, units: Mapping[str, str], about: str) -> str:
    more = {
        "opaque_cover": "share of the sky under opaque clouds",
        "relative_humidity": "of the air, for the dew point",
    }
    rows = [f"| `{name}` | `{unit}` | {(WEATHER | more)[name]} |" for name, unit in units.items()]
    return "\n".join([f"\n## {heading}\n\n{about}\n\n| name | unit | what it is |\n|---|---|---|", *rows]) + "\n"


def _commands(app: Any) -> str:
    """The commands of a program: usage, what each does, its options, and an example."""
    with patch.object(sys, "argv", [app.name[0]]):  # a usage begins with the program that runs, which is this script
        text = app.generate_docs(output_format="markdown", heading_level=2)
    text = re.sub(r"## Table of Contents\n.*?(?=\n\*\*|\n#)", "", text, flags=re.DOTALL)
    text = re.sub(r"\*\*Commands\*\*:\n\n(\* .*\n)+", "", text)
    text = re.sub(r"\*\*Reporting\*\*:\n\n(\* .*\n)+", "", text)  # the head of the page says them once
    text = text.replace("```console\n", "```text\n")
    text = re.sub(r"\n {4}(?=\S)", " ", text)  # an item is one line
    for name, words in EXAMPLES.items():
        usage = re.compile(rf"(^#+ {name}\n\n```text\n.*?\n)(```)", re.MULTILINE | re.DOTALL)
        text = usage.sub(rf"\1\n{name} {words}\n\2", text, count=1)
    return "\n" + re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


if __name__ == "__main__":
    main()
