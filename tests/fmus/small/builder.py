"""Builds the small FMUs of this folder for the machine at hand."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from typing import NamedTuple

import fmpy

HERE = Path(__file__).resolve().parent
TOKEN = "{6d1f0b52-5b1a-4a5e-9f0e-2b8a3f7c9d10}"


class Variable(NamedTuple):
    """One variable; ``rate`` makes it a state and names its derivative in the model description."""

    name: str
    causality: str
    start: float
    variability: str = "continuous"
    rate: bool = False
    unit: str = ""


class Model(NamedTuple):
    """One C file of this folder: its variables, the length of its internal Co-Simulation step [s], and whether it is to
    be told of every completed step."""

    variables: tuple[Variable, ...]
    indicators: int = 0
    internal: float = 0.01
    history: bool = False


def _parameter(name: str, start: float) -> Variable:
    return Variable(name, "parameter", start, "tunable")


MODELS = {
    "ball": Model(
        (
            Variable("h", "output", 1.0, rate=True, unit="m"),
            Variable("v", "output", 0.0, rate=True, unit="m/s"),
            _parameter("g", 9.81),
            _parameter("e", 0.7),
            Variable("bounces", "output", 0.0, "discrete"),
            Variable("lying", "local", 0.0, "discrete"),
        ),
        indicators=1,
        internal=1e-4,
    ),
    "stair": Model(
        (Variable("count", "output", 1.0, "discrete"), _parameter("period", 1.0), _parameter("top", 1e9)), internal=0.1
    ),
    "meter": Model(
        (
            Variable("x", "output", 0.0, rate=True),
            Variable("closed", "output", 0.0, "discrete"),
            _parameter("rate", 1.0),
            _parameter("top", 3.0),
        ),
        indicators=1,
    ),
    "vanderpol": Model(
        (Variable("x", "output", 2.0, rate=True), Variable("y", "output", 0.0, rate=True), _parameter("mu", 1.0)),
        internal=1e-4,
    ),
    "dahlquist": Model((Variable("x", "output", 1.0, rate=True), _parameter("k", 1.0)), internal=0.1),
    "lag": Model(
        (
            Variable("x", "output", 0.0, rate=True),
            _parameter("tau", 1.0),
            Variable("u", "input", 0.0),
            Variable("y", "output", 0.0),
        ),
        internal=1e-3,
    ),
    "echo": Model((Variable("x", "output", 1.0, rate=True), _parameter("k", 1.0)), history=True),
    "odd": Model(
        (
            Variable("x", "local", 1.0, rate=True),
            _parameter("k", 1e-5),
            _parameter("offset", 0.0),
            Variable("y", "output", 1.0),
        ),
        internal=60.0,
    ),
    "house": Model(
        (
            Variable("T", "local", 18.0, rate=True, unit="degC"),
            Variable("ro", "parameter", 7.0, "tunable", unit="K/kW"),
            Variable("ri", "parameter", 0.6, "tunable", unit="K/kW"),
            Variable("c", "parameter", 4.0, "tunable", unit="kWh/K"),
            Variable("a", "parameter", 2.5, "tunable", unit="m2"),
            Variable("q", "parameter", 0.1, "tunable", unit="kW"),
            Variable("To", "input", 5.0, unit="degC"),
            Variable("S", "input", 0.0, unit="kW/m2"),
            Variable("N", "input", 0.0),
            Variable("P", "input", 0.0, unit="kW"),
            Variable("Y", "output", 18.0, unit="degC"),
        ),
        internal=60.0,
    ),
    "feedthrough": Model(
        (
            Variable("u", "input", 0.0),
            Variable("switch", "input", 0.0, "discrete"),
            Variable("y", "output", 0.0),
            Variable("stepped", "output", 0.0, "discrete"),
            _parameter("gain", 1.0),
        )
    ),
    "resource": Model(
        (Variable("y", "output", 0.0), _parameter("gain", 1.0), Variable("number", "local", 0.0)), internal=0.1
    ),
    "faulty": Model(
        (
            Variable("x", "output", 1.0, rate=True),
            _parameter("k", 1.0),
            _parameter("fault", 0.0),
            _parameter("when", 1.0),
        )
    ),
}


def build(
    name: str,
    fmi: int,
    kinds: tuple[str, ...],
    folder: Path,
    *,
    attributes: str = "",
    number: str = "42.5",
    absent: bool = False,
) -> Path:
    """Write one FMU.

    Parameters
    ----------
    kinds
        ``me``, ``cs`` or both.
    attributes
        XML attributes of the Co-Simulation element.
    number
        Content of the resource file.
    absent
        Whether the library needs another one, libabsent.so, that is not there.
    """
    place = folder / f"{name}{fmi}{'-absent' if absent else ''}"
    library = _library(name, fmi, place, absent)
    variant = f"-{zlib.crc32(f'{attributes}|{number}'.encode()):08x}{'-absent' if absent else ''}"
    path = folder / f"{name}-{fmi}-{'-'.join(kinds)}{variant}.fmu"
    place = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _description(name, fmi, kinds, attributes))
        archive.writestr(f"binaries/{place}/{library.name}", library.read_bytes())
        archive.writestr("resources/number.txt", number)
    return path


def _library(name: str, fmi: int, folder: Path, absent: bool) -> Path:
    out = folder / f"{name}{fmpy.sharedLibraryExtension}"
    if out.exists():
        return out
    folder.mkdir(parents=True)
    (folder / "variables.h").write_text(_header(MODELS[name]), encoding="utf-8")
    compiler = ["gcc"] if shutil.which("gcc") and os.name != "nt" else [sys.executable, "-m", "ziglang", "cc"]
    command = [*compiler, "-std=gnu99", "-O1", "-shared", "-fPIC", "-fvisibility=hidden", f"-DFMI={fmi}"]
    command += [f'-DMODEL_FILE="{(HERE / name).as_posix()}.c"', f"-I{folder}"]
    command += ["-o", str(out), str(HERE / "runtime.c")] + ([] if os.name == "nt" else ["-lm"])
    if absent:
        other = folder / "elsewhere/libabsent.so"
        other.parent.mkdir()
        subprocess.run([*compiler, "-shared", "-fPIC", "-x", "c", os.devnull, "-o", str(other)], check=True)
        command += ["-Wl,--no-as-needed", f"-L{other.parent}", "-labsent"]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{run.stderr[:4000]}")
    return out


def _header(model: Model) -> str:
    names = [v.name.upper() for v in model.variables]
    states = [v.name.upper() for v in model.variables if v.rate]
    discrete = ["1" if v.variability == "discrete" else "0" for v in model.variables]
    return "\n".join(
        [
            f"enum {{ {', '.join(names)}, VARIABLES }};",
            f"#define STATES {len(states)}",
            f"#define INDICATORS {model.indicators}",
            f"#define INTERNAL {model.internal!r}",
            f'#define TOKEN "{TOKEN}"',
            f"static const double START[] = {{{', '.join(repr(v.start) for v in model.variables)}}};",
            f"static const int STATE_OF[] = {{{', '.join([*states, '0'])}}};",
            f"static const int DISCRETE[] = {{{', '.join(discrete)}}};",
            "",
        ]
    )


def _description(name: str, fmi: int, kinds: tuple[str, ...], attributes: str) -> str:
    model = MODELS[name]
    steps = 'completedIntegratorStepNotNeeded="true"' if fmi == 2 else ""
    if model.history:
        steps = "" if fmi == 2 else 'needsCompletedIntegratorStep="true"'
    elements = {
        "me": f'<ModelExchange modelIdentifier="{name}" {steps}/>',
        "cs": f'<CoSimulation modelIdentifier="{name}" {attributes}/>',
    }
    units = "".join(f'<Unit name="{u}"/>' for u in sorted({v.unit for v in model.variables} - {""}))
    units = f"<UnitDefinitions>{units}</UnitDefinitions>" if units else ""
    head = f'modelName="{name}"' + (f' numberOfEventIndicators="{model.indicators}"' if fmi == 2 else "")
    token = "guid" if fmi == 2 else "instantiationToken"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="{fmi}.0" {head} {token}="{TOKEN}">'
        f"{''.join(elements[k] for k in kinds)}{units}"
        f"<ModelVariables>{_variables(model, fmi)}</ModelVariables>"
        f"<ModelStructure>{_structure(model, fmi)}</ModelStructure></fmiModelDescription>"
    )


def _variables(model: Model, fmi: int) -> str:
    text = ""
    for k, v in enumerate(model.variables):
        start = f' start="{v.start!r}"'
        initial = "" if v.causality in ("parameter", "input") else ' initial="exact"'
        unit = f' unit="{v.unit}"' if v.unit else ""
        head = f'name="{v.name}" valueReference="{k}" causality="{v.causality}" variability="{v.variability}"{initial}'
        text += (
            f"<ScalarVariable {head}><Real{start}{unit}/></ScalarVariable>"
            if fmi == 2
            else f"<Float64 {head}{start}{unit}/>"
        )
    for v in model.variables:
        if v.rate and fmi == 2:
            number = next(k for k, w in enumerate(model.variables, 1) if w is v)
            head = f'name="der({v.name})" valueReference="{100 + number}" causality="local" variability="continuous"'
            text += f'<ScalarVariable {head}><Real derivative="{number}"/></ScalarVariable>'
        elif v.rate:
            number = model.variables.index(v)
            head = f'name="der({v.name})" valueReference="{100 + number}" causality="local"'
            text += f'<Float64 {head} derivative="{number}"/>'
    if fmi == 3:
        text += '<Float64 name="time" valueReference="300" causality="independent" variability="continuous"/>'
        for k in range(model.indicators):
            text += f'<Float64 name="indicator{k}" valueReference="{200 + k}" causality="local"/>'
    return text


def _structure(model: Model, fmi: int) -> str:
    n = len(model.variables)
    outputs = [k for k, v in enumerate(model.variables) if v.causality == "output"]
    states = [k for k, v in enumerate(model.variables) if v.rate]
    if fmi == 3:
        rates = "".join(f'<ContinuousStateDerivative valueReference="{100 + k}"/>' for k in states)
        events = "".join(f'<EventIndicator valueReference="{200 + k}"/>' for k in range(model.indicators))
        return "".join(f'<Output valueReference="{k}"/>' for k in outputs) + rates + events
    rates = "".join(f'<Unknown index="{n + 1 + k}"/>' for k in range(len(states)))
    known = "".join(f'<Unknown index="{k + 1}"/>' for k in outputs)
    return f"<Outputs>{known}</Outputs>" + (f"<Derivatives>{rates}</Derivatives>" if rates else "")
