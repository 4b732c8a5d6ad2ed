"""Effects on FMU parameters begin where the base model is, or are refused before anything is simulated."""

import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.effects import Nothing, build, library
from diagnosis.effects.baselines import check_baselines
from shared.effects import ParameterEffect, ShapedEffect
from shared.errors import SystemDescriptionError

COMMON = {"name": "mine", "unit": "1", "scale": 1.0, "lower": 0.0, "upper": 2.0}
SHAPE = [{"form": "timetable", "hours": [(8.0, 9.0)]}]


@pytest.fixture(scope="module")
def room(default_system):
    return Simulator(default_system)


@pytest.mark.parametrize("replay", [False, True])
def test_the_default_rooms_effects_begin_at_its_base_model(room, replay):
    check_baselines([*library(room.system), Nothing("placebo")], room.system, room.fmu, replay=replay)


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        (
            ParameterEffect(kind="parameter", parameters={"conHea.k": 0.05}, **COMMON),
            r"effects 'mine': 'conHea\.k' begins at 0 but is 0\.25 in MixedAirCO2\.fmu; expected base = .*= 0\.25",
        ),
        (ParameterEffect(kind="parameter", parameters={"conHea.k": 0.05}, base={"conHea.k": 0.25}, **COMMON), None),
        (
            ParameterEffect(kind="parameter", parameters={"conHea.k": 0.05}, base={"conHea.k": 0.3}, **COMMON),
            r"'conHea\.k' begins at 0\.3 but is 0\.25 in",
        ),
        (
            ShapedEffect(kind="shaped", parameters={"conHea.k": 0.05}, input="yWin", shape=SHAPE, **COMMON),
            r"'conHea\.k' begins at 0 but is 0\.25 in MixedAirCO2\.fmu; expected 0 there, .* under \[fixed\]",
        ),
        (
            ParameterEffect(kind="parameter", parameters={"conHea.q": 0.05}, **COMMON),
            r"effects 'mine': 'conHea\.q' is not a variable of MixedAirCO2\.fmu",
        ),
        (
            ParameterEffect(
                kind="parameter", parameters={"effect.bridge.UA": 1.0}, constants={"effect.T": 2.0}, **COMMON
            ),
            r"'effect\.T' is not a variable of MixedAirCO2\.fmu",
        ),
    ],
)
def test_an_effect_that_jumps_at_zero_is_refused(room, spec, said):
    effects = [build(spec, room.system)]
    if said is None:
        check_baselines(effects, room.system, room.fmu, replay=False)
        return
    with pytest.raises(SystemDescriptionError, match=said):
        check_baselines(effects, room.system, room.fmu, replay=False)
