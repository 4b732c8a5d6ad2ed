"""Readings beside what the description declares in their unit, and beside the air outdoors."""

import numpy as np
import pytest

from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, measured

OUTPUTS = (
    '{ name = "warmth", unit = "K", accuracy = 0.1, noise = { good = { sd = 0.05 }, poor = { sd = 0.2 } } },',
    '{ name = "gas", unit = "W", accuracy = 1.0, method = "mean", noise = { poor = { sd = 100.0 } } },',
)
EFFECTS = """
[[effects]]
name = "leak"
kind = "parameter"
description = "Air leaks in"
unit = "kg/s"
scale = 0.03
lower = 0.0
upper = 0.1
parameters = { "m0" = 1.0 }
"""


@pytest.fixture
def said(house, tmp_path):
    """Import with sensors and an effect declared; the findings that hold some words."""
    text = HOUSE.replace('{ name = "warmth", unit = "K", accuracy = 0.1 },', OUTPUTS[0])
    text = text.replace('{ name = "gas", unit = "W", accuracy = 1.0, method = "mean" },', OUTPUTS[1])
    (tmp_path / "declared.toml").write_text(text + EFFECTS)

    def run(frame, words, mapping=MAPPING, out="out/declared.nc"):
        found = house(frame, mapping, out=out, system=tmp_path / "declared.toml").physics
        return [one.text for one in found if words in one.text]

    return run


def test_kilowatts_declared_as_watts_move_by_less_than_the_noise(said):
    frame, _ = measured()
    assert said(frame, "Is the unit right") == []
    (note,) = said(frame, "Is the unit right", MAPPING.replace('unit = "kW"', 'unit = "W"'), "watts.nc")
    assert note.startswith("gas varies by 2 W in all, from")
    assert "which is less than its sensor's noise (standard deviation 100 W)." in note


def test_a_flow_far_beyond_all_that_is_declared_in_its_unit(said):
    frame, hours = measured()
    frame["valve"] = 50.0 + np.sin(hours)
    assert said(frame, "largest number") == []
    (note,) = said(frame, "largest number", MAPPING.replace('unit = "m3/h"', 'unit = "m3/s"'), "seconds.nc")
    assert note.startswith(
        "air is usually 144 kg/s where it is not 0, and the largest number in kg/s that the description has is 0.1"
        " (upper of effect leak). Is the unit right?"
    )


def test_a_room_and_the_air_outdoors_that_are_swapped(said):
    frame, _ = measured()
    assert said(frame, "swapped") == []
    swapped = frame.rename(columns={"room": "outside", "outside": "room"})
    (note,) = said(swapped, "swapped", out="swapped.nc")
    assert note.startswith(
        "warmth is 13.0 K colder on average than outdoors, the air outdoors, and varies more. Are their columns"
    )


def test_degrees_fahrenheit_outdoors_that_are_declared_as_celsius(said):
    frame, _ = measured()
    assert said(frame, "degF") == []
    (note,) = said(frame.assign(outside=frame["outside"] * 1.8 + 32), "degF", out="fahrenheit.nc")
    assert note.startswith("outdoors, the air outdoors, has a median of 46.4 degC. Is its unit right (degF)?")
