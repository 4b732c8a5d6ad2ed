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
        ([294.15], "K", None),
        ([345.0], "K", None),  # hot water
        ([-3.0], "K", None),  # a setback
        ([0.5, 20.0], "K", None),  # a difference, or nothing that one unit explains
        ([21.0], "degC", None),
        ([0.0], "ppm", None),
    ],
)
def test_what_is_possible_in_another_unit_only_is_asked_about(values, unit, meant):
    found = in_another_unit(values, unit)
    assert found.endswith(f"; is it in {meant}?") if meant else found == ""
