"""What is drawn: causes that can act together, and that do something."""

import pytest

from diagnosis.blind.generator import Generator, draw_case, pairs
from diagnosis.effects import library
from shared.errors import SystemDescriptionError


def only(system, truth, *names):
    """System and truth with these effects alone."""
    return (
        system.model_copy(update={"effects": [one for one in system.effects if one.name in names]}),
        truth.model_copy(update={"forms": [one for one in truth.forms if not one.effect or one.effect in names]}),
    )


@pytest.mark.parametrize("names", [["plug"], ["window.warm", "window.airing"]])
def test_two_causes_that_cannot_act_together_are_refused_before_anything_is_made(default_system, truth, names):
    system, fewer = only(default_system, truth, *names)
    assert pairs(fewer, library(system)) == {}
    with pytest.raises(SystemDescriptionError, match=r"strata\.two is above 0, and no two effects can act together"):
        Generator(system, fewer, hours=24.0)


def test_the_first_of_two_causes_has_one_that_goes_with_it(default_system, truth):
    system, fewer = only(default_system, truth, "window.warm", "window.airing", "plug")
    effects = library(system)
    drawn = [draw_case(fewer, effects, 1, index) for index in range(60)]
    assert any(one.stratum == "two" for one in drawn)
    assert all(len(one.causes) == 2 for one in drawn if one.stratum == "two")
