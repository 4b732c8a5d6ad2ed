import pytest

from shared.errors import SystemDescriptionError
from shared.system import load_system, parse_system

FLOOR = """
[[uncertain]]
name = "floor"
parameters = ["floor.layer[1].C"]
relative = 0.3
"""


@pytest.fixture
def parse():
    room = load_system("fmus/MixedAirCO2")
    text = room.path.read_text(encoding="utf-8").partition("[[uncertain]]")[0]
    effects = """
[[effects]]
name = "plug"
kind = "parameter"
unit = "W"
scale = 1.0
lower = 0.0
upper = 2.0
parameters = { "effect.plug.Q" = 1.0 }
"""
    return lambda more: parse_system(text + effects + more, room.path)


def test_they_are_no_part_of_the_hash_because_no_dataset_depends_on_them(parse):
    assert parse(FLOOR).hash() == parse("").hash()
    assert parse(FLOOR).uncertain[0].relative == 0.3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('"floor"', '"plug"'), "'plug' is the name of two things"),
        (('"floor"', '"TRoo"'), "'TRoo' is the name of two things"),
        (("floor.layer[1].C", "roo.V"), "holds 'roo.V', which is an estimated parameter"),
        (("floor.layer[1].C", "effect.plug.Q"), "holds 'effect.plug.Q', which is set elsewhere as well"),
        (('["floor.layer[1].C"]', '["win.C", "win.C"]'), "holds 'win.C', which is set elsewhere as well"),
        (('["floor.layer[1].C"]', "[]"), "uncertain[1].parameters: List should have at least 1 item"),
    ],
)
def test_what_does_not_fit_is_told(parse, change, says):
    with pytest.raises(SystemDescriptionError) as told:
        parse(FLOOR.replace(*change))
    assert says in str(told.value)
