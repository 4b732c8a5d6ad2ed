"""Effects of a package's own, in a simulation: what they may do acts, and what they may not is a sentence."""

import numpy as np
import pytest

from datagen.driving.tables import Piecewise
from diagnosis.effects import Nothing, library
from diagnosis.effects.library import check_baselines
from diagnosis.fitting.problem import Problem
from shared.errors import SimulationError, SystemDescriptionError
from tests.diagnosis.fitting.crowd_cases import warm_room


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Simulator and recording."""
    return warm_room(tmp_path_factory.mktemp("own") / "room.nc")


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
    problem = Problem(*warm, effects=effects, occupancy="measured", uncertain=False, warm_up=3600.0)
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
