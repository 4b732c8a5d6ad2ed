"""Effects that a description or a package adds: what is refused, and with which sentence."""

from importlib import import_module
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from datagen.driving.tables import Piecewise
from diagnosis.app.project import as_toml
from diagnosis.effects import Nothing, library
from diagnosis.effects.library import check_baselines
from diagnosis.fitting.problem import Problem
from shared.errors import SimulationError, SystemDescriptionError
from shared.system import parse_system


def warmer(inputs, amount):
    old = inputs["TDryBul"]
    return Piecewise(old.times, old.values + amount, old.kind)


class Copying(Nothing):
    def inputs(self, amplitude, inputs, recording):
        return {**inputs, "TDryBul": warmer(inputs, amplitude)} if amplitude else inputs


class InPlace(Nothing):
    def inputs(self, amplitude, inputs, recording):
        if amplitude:
            inputs["TDryBul"] = warmer(inputs, amplitude)
        return inputs


class Acting(Nothing):
    """Gives at any amplitude but zero what it was made with."""

    given = ()

    def _one(self, what, amplitude, otherwise):
        kind, value = self.given
        if kind != what or not amplitude:
            return otherwise
        if isinstance(value, Exception):
            raise value
        return value(otherwise) if callable(value) else value

    def parameters(self, amplitude):
        return self._one("parameters", amplitude, {})

    def inputs(self, amplitude, inputs, recording):
        return self._one("inputs", amplitude, inputs)

    def outputs(self, amplitude, outputs, time):
        return self._one("outputs", amplitude, outputs)


def acting(what, value):
    effect = Acting("mine")
    object.__setattr__(effect, "given", (what, value))
    return effect


def simulated(warm, effects, amplitudes):
    problem = Problem(*warm, occupancy="measured", known=["constants"], warm_up=3600.0).with_effects(effects)
    return problem.simulate(problem.unknowns(dict(zip([one.name for one in effects], amplitudes, strict=True))))


def test_inputs_changed_in_place_act_as_copies_do(warm):
    base = simulated(warm, [], [])
    wanted = simulated(warm, [Copying("mine")], [2.0])
    assert np.abs(wanted - base)[0].max() > 0.05
    np.testing.assert_array_equal(simulated(warm, [InPlace("mine")], [2.0]), wanted)
    # and one of two effects leaves the other what it changed
    np.testing.assert_array_equal(simulated(warm, [InPlace("mine"), Copying("yours")], [1.0, 1.0]), wanted)
    np.testing.assert_array_equal(simulated(warm, [InPlace("mine")], [0.0]), base)


@pytest.mark.parametrize(
    ("what", "value", "said"),
    [
        ("parameters", KeyError("k"), "parameters fails with KeyError: 'k'"),
        ("parameters", None, "parameters gives a NoneType; expected a dictionary"),
        ("inputs", lambda inputs: inputs | {"wind": inputs["TSet"]}, "inputs has 'wind', which is no input; expected"),
        ("inputs", lambda inputs: {"TSet": inputs["TSet"]}, "inputs lacks '[A-Za-z0-9_]+'; expected TDryBul"),
        ("outputs", lambda outputs: outputs[:2], r"outputs gives the shape \(2, [0-9]+\); expected \(4, "),
    ],
)
def test_what_goes_wrong_in_a_strangers_effect_is_told_with_its_name(warm, what, value, said):
    with pytest.raises(SimulationError, match=rf"effect 'mine' \({__name__}\): {said}"):
        simulated(warm, [acting(what, value)], [1.0])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("no.such", r"'no\.such'; expected a variable of MixedAirCO2\.fmu"),
        ("TRoo", r"'TRoo', whose causality in MixedAirCO2\.fmu is output; expected one that can be set"),
        ("mOut_flow", "'mOut_flow', which is estimated; expected another parameter"),
        ("effect.plug.Q", None),
    ],
)
def test_parameters_that_cannot_be_set_are_refused_before_anything_is_simulated(warm, name, said):
    system, fmu = warm[0].system, warm[0].fmu
    candidates = [*library(system), acting("parameters", {name: 1.0})]
    if said is None:
        check_baselines(candidates, system, fmu, replay=False)
        return
    with pytest.raises(SystemDescriptionError, match=rf"effect 'mine' \({__name__}\): parameters sets {said}"):
        check_baselines(candidates, system, fmu, replay=False)


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
    with pytest.raises(SystemDescriptionError, match=sentence):
        library(parse_system(f"{text}\n{as_toml({'effects': [one]})}", default_system.path))


@pytest.fixture
def made(monkeypatch):
    """Effects of a package."""
    made = [Nothing("mine")]
    monkeypatch.setattr(EntryPoint, "load", lambda self: lambda system: made)
    entry = EntryPoint("mine", "package:effects", "zeroshot_fmu.effects")
    monkeypatch.setattr(import_module("diagnosis.effects.library"), "entry_points", lambda group: [entry])
    return made


def test_packages_add_their_own(default_system, made):
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
def test_a_package_gives_no_effect_without_a_scale_and_a_range_about_zero(default_system, made, given, expected):
    made[:] = [Nothing("mine", **given)]
    with pytest.raises(SystemDescriptionError, match="'mine'.*package:effects.*'mine' .*" + expected):
        library(default_system)
