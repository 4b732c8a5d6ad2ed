"""Numbers of a description that are in another unit than it says."""

import pytest

from shared.possible import in_another_unit


@pytest.mark.parametrize(
    ("values", "unit", "meant"),
    [
        ([21.0], "K", "degC or degF"),
        ([70.0], "K", "degF"),
        ([294.15], "degC", "K"),
        ([420e-6], "ppm", "a fraction"),
        ([0.042], "ppm", "percent"),
    ],
)
def test_what_is_possible_in_another_unit_only(values, unit, meant):
    assert in_another_unit(values, unit).endswith(f"; is it in {meant}?")


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        ([294.15], "K"),
        ([345.0], "K"),  # hot water
        ([-3.0], "K"),  # a setback
        ([0.5, 20.0], "K"),  # a difference, or nothing that one unit explains
        ([21.0], "degC"),
        ([0.0], "ppm"),
    ],
)
def test_what_may_be_as_it_is(values, unit):
    assert in_another_unit(values, unit) == ""
