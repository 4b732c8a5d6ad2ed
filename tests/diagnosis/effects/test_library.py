"""Effects that a description or a package adds: what is refused, and with which sentence."""

from importlib import import_module
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from diagnosis.effects import Nothing, library
from shared.errors import SystemDescriptionError
from shared.system import parse_system


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"kind": "sensor", "outputs": ["TWall"], "operation": "bias"}, "'TWall' is not an output"),
        ({"kind": "input", "input": "rain", "operation": "add"}, "'rain' is not an input"),
        ({"kind": "parameter", "parameters": {"roo.V": 1.0}}, "'roo.V' is an estimated parameter"),
        ({"kind": "sensor", "outputs": ["CO2"], "operation": "lag", "lower": -1.0}, "expected lower = 0"),
        ({"kind": "sensor", "outputs": ["CO2"], "operation": "gain", "lower": -1.0}, "expected more than 0"),
        (
            {"kind": "sensor", "outputs": ["CO2"], "operation": "gain", "factor": -1.0, "upper": 1.5},
            "reaches a gain of -0.5; expected more than 0",
        ),
        (
            {"kind": "sensor", "outputs": ["QHea"], "operation": "gain", "lower": 0.0, "replayed": {"QHea": "mOA_in"}},
            "'mOA_in' is not what 'QHea' measures",
        ),
        (
            {
                "kind": "shaped",
                "parameters": {"effect.window.m0": 1.0},
                "input": "nPer",
                "shape": [{"form": "timetable", "hours": [[8.0, 18.0]]}],
            },
            "'nPer' is no constant of 0",
        ),
    ],
)
def test_wrong_declarations_are_refused_with_a_sentence(default_system, change, sentence):
    text = default_system.path.read_text(encoding="utf-8")
    one = {"name": "mine", "unit": "1", "scale": 1.0, "lower": 0.0, "upper": 2.0, **change}
    lines = "\n".join(f"{k} = {_toml(v)}" for k, v in one.items())
    with pytest.raises(SystemDescriptionError, match=sentence):
        library(parse_system(f"{text}\n[[effects]]\n{lines}\n", default_system.path))


def _toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f'"{k}" = {_toml(v)}' for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)


def test_packages_add_their_own(default_system, monkeypatch):
    made = [Nothing("mine")]
    monkeypatch.setattr(EntryPoint, "load", lambda self: lambda system: made)
    entry = EntryPoint("mine", "package:effects", "zeroshot_fmu.effects")
    monkeypatch.setattr(import_module("diagnosis.effects.library"), "entry_points", lambda group: [entry])
    assert library(default_system)[-1].name == "mine"
    made[:] = [Nothing("plug")]
    with pytest.raises(SystemDescriptionError, match="'plug' is declared twice"):
        library(default_system)
    made[:] = ["no effect"]
    with pytest.raises(SystemDescriptionError, match=r"package:effects.*gives a str; expected effects"):
        library(default_system)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"scale": 0.0}, "scale 0; expected a finite number above 0"),
        ({"scale": np.nan}, "scale nan;"),
        ({"lower": 1.0, "upper": 2.0}, "goes from 1 to 2; expected a range with 0, the base model"),
        ({"scale": "1 K"}, "expected numbers"),
    ],
)
def test_a_package_gives_no_effect_without_a_scale_and_a_range_about_zero(default_system, monkeypatch, given, expected):
    monkeypatch.setattr(EntryPoint, "load", lambda self: lambda system: [Nothing("mine", **given)])
    entry = EntryPoint("mine", "package:effects", "zeroshot_fmu.effects")
    monkeypatch.setattr(import_module("diagnosis.effects.library"), "entry_points", lambda group: [entry])
    with pytest.raises(SystemDescriptionError, match="'mine'.*package:effects.*'mine' .*" + expected):
        library(default_system)
