"""Temperatures in the wrong unit are refused, differences of temperature are not."""

import numpy as np
import pytest

from datagen import simulate
from diagnosis.calibrating.checks import check_recording
from diagnosis.recording import read_recording
from shared.errors import RecordingError


@pytest.fixture(scope="module")
def recorded(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("checks") / "room.nc"
    simulate(default_system, hours=48, seed=1, out=path)
    return read_recording(path, default_system)


def as_input(system, name, unit="K", **more):
    inputs = [one.model_copy(update={"unit": unit, **more}) if one.name == name else one for one in system.inputs]
    return system.model_copy(update={"inputs": inputs})


def test_an_excitation_in_kelvin_is_a_difference(default_system, recorded):
    excited = next(one.name for one in default_system.inputs if one.source == "excitation")
    recorded.inputs[excited] = np.full(len(recorded.time), 0.00443)
    check_recording(recorded, as_input(default_system, excited))


def test_an_input_is_a_difference_where_its_description_has_small_values(default_system, recorded):
    constant = next(one for one in default_system.inputs if one.source == "constant")
    recorded.inputs[constant.name] = np.full(len(recorded.time), 2.0)
    check_recording(recorded, as_input(default_system, constant.name, value=0.0))
    with pytest.raises(RecordingError, match="look like degC"):
        check_recording(recorded, as_input(default_system, constant.name, value=293.15))


@pytest.mark.parametrize(("value", "difference"), [(0.0, False), (2.0, True), (293.15, False)])
def test_what_stands_in_for_a_measured_temperature_tells_a_difference_only_where_it_was_given(
    default_system, recorded, value, difference
):
    """The 0 that nobody wrote is none: degrees Celsius in an input in K are still found."""
    measured = next(one for one in default_system.inputs if one.source == "measured")
    recorded.inputs[measured.name] = np.full(len(recorded.time), 21.0)
    system = as_input(default_system, measured.name, value=value)
    if difference:
        check_recording(recorded, system)
    else:
        with pytest.raises(RecordingError, match="look like degC"):
            check_recording(recorded, system)
