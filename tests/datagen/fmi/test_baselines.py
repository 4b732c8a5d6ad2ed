"""Effects of a description on parameters of its FMU begin where that is, or the description is refused at once."""

import pytest

from datagen.simulating.simulator import Simulator
from shared.errors import SystemDescriptionError
from shared.system import parse_system

LEAK = """
[[effects]]
name = "mine"
kind = "parameter"
unit = "W/K"
scale = 1.0
lower = 0.0
upper = 2.0
parameters = {{ "{parameter}" = 0.05 }}
{more}
"""


def described(default_system, parameter, more=""):
    text = default_system.path.read_text(encoding="utf-8")
    return parse_system(text + LEAK.format(parameter=parameter, more=more), default_system.path)


def test_what_begins_at_the_fmus_own_value_is_accepted(default_system):
    assert default_system.effects
    Simulator(default_system)
    Simulator(described(default_system, "conHea.k", 'base = { "conHea.k" = 0.25 }'))  # the model description's start


@pytest.mark.parametrize(
    ("parameter", "more", "said"),
    [
        (
            "conHea.k",
            'base = { "conHea.k" = 0.3 }',
            r"system\.toml: effects 'mine': 'conHea\.k' begins at 0\.3 but is 0\.25 in MixedAirCO2\.fmu; expected base"
            r" = \{ \"conHea\.k\" = 0\.25 \}",
        ),
        ("conHea.q", "", r"'conHea\.q' is not a variable of MixedAirCO2\.fmu"),
        ("TRoo", "", r"'TRoo' has the causality output in MixedAirCO2\.fmu; expected one that can be set"),
        ("replay", 'modes = ["replay"]', r"'replay' begins at 0 but is 1 under \[replay\]"),
    ],
)
def test_an_effect_that_jumps_at_zero_is_refused_when_the_fmu_is_loaded(default_system, parameter, more, said):
    with pytest.raises(SystemDescriptionError, match=said):
        Simulator(described(default_system, parameter, more))
