"""What cannot be is found in a hall whose balances are known, and nothing in one that is right; what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from datagen import simulate
from diagnosis.physics import check_physics, check_recording, hints, warnings
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from shared.variables import Noise
from tests.diagnosis.hall_cases import FAN, hall, lived

HALL = hall()
METER = {"name": "meter", "unit": "W", "method": "mean", "noise": {"sensor": Noise(sd=50.0)}}


@pytest.fixture(scope="module")
def recorded(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("checks") / "room.nc"
    simulate(default_system, hours=48, seed=1, out=path)
    return read_recording(path, default_system)


@pytest.mark.parametrize(("value", "difference"), [(0.0, False), (2.0, True)])
def test_what_stands_in_for_a_measured_temperature_tells_a_difference_only_where_it_was_given(
    default_system, recorded, value, difference
):
    """The 0 that nobody wrote is none: degrees Celsius in an input in K are still found."""
    measured = next(one for one in default_system.inputs if one.source == "measured")
    recorded.inputs[measured.name] = np.full(len(recorded.time), 21.0)
    given = [
        one.model_copy(update={"unit": "K", "value": value}) if one is measured else one
        for one in default_system.inputs
    ]
    system = default_system.model_copy(update={"inputs": given})
    if difference:
        check_recording(recorded, system)
    else:
        with pytest.raises(RecordingError, match="look like degC"):
            check_recording(recorded, system)


def with_output(recording, name, values):
    outputs = recording.outputs.copy()
    outputs[HALL.output_names.index(name)] = values
    return replace(recording, outputs=outputs)


def output(recording, name):
    return recording.outputs[HALL.output_names.index(name)]


def test_nothing_is_found_in_a_hall_that_is_right():
    for seed in range(4):
        assert check_physics(HALL, lived(seed=seed)) == []


@pytest.mark.parametrize(("low", "found"), [(40.0, False), (110.0, True)])
def test_less_gas_than_outdoors_is_an_offset_of_the_sensor(low, found):
    """At least: the nights of a hall that is never aired out end above the air outdoors."""
    recording = lived()
    told = check_physics(HALL, with_output(recording, "breathed", output(recording, "breathed") - low))
    assert bool(told) == found
    for one in told:
        assert one.kind == "offset" and one.strong and -one.size == pytest.approx(low, abs=15)
        assert "offset = 1" in one.remedy and "[variables.breathed]" in one.remedy


def test_a_clock_stands_first_with_its_line_and_silences_what_follows_from_it():
    recording = lived()
    shifted = replace(recording, outputs=np.roll(recording.outputs, -8, axis=1))
    low = with_output(shifted, "breathed", output(shifted, "breathed") - 110.0)
    clock, offset = check_physics(HALL, low)
    assert (clock.kind, offset.kind) == ("clock", "offset")
    assert "shift = 28800.0 under [variables.warmth] and [variables.breathed]" in clock.remedy
    assert warnings([clock, offset])[0].startswith(
        "Correct this before believing what follows: warmth and breathed come"
    )
    assert hints([clock, offset]) == []


def test_light_by_night_and_light_at_the_wrong_time():
    recording = lived()
    dim = replace(recording, inputs=recording.inputs | {"shine": recording.inputs["shine"] + 20.0})
    (night,) = check_physics(HALL, dim)
    assert night.kind == "night" and night.size == pytest.approx(20.0) and not night.strong
    # all columns together keep another clock: only the sun tells
    every = replace(recording, time=recording.time + 8 * 3600.0)
    (clock,) = [one for one in check_physics(HALL, every) if one.kind == "clock"]
    assert clock.names == ("shine",) and clock.size == pytest.approx(8.0, abs=0.6) and "time.zone" in clock.remedy


def test_an_air_flow_in_another_unit_is_found_by_the_gas_that_it_carries():
    recording = lived()
    for factor in (10.0, 0.1):
        (one,) = check_physics(HALL, with_output(recording, "fan", factor * FAN))
        assert one.kind == "balance" and (one.size > 3.6) == (factor > 1) and not one.strong


def test_a_hall_that_is_not_the_descriptions():
    recording = lived()
    outside = recording.inputs["outside"]
    cooled = replace(recording, inputs=recording.inputs | {"outside": outside + 25.0})
    (one,) = check_physics(HALL, cooled)
    assert "so that the room is cooled" in one.sentence and "From my room to a description" in one.remedy
    # the noise of a heat meter that reads nothing is no cooler
    metered = HALL.model_copy(update={"outputs": [*HALL.outputs, HALL.outputs[0].model_copy(update=METER)]})
    noise = np.random.default_rng(0).normal(0, 50, (1, len(recording.time)))
    for heat, found in ((noise, True), (10.0 * noise - 2500.0, False)):
        said = check_physics(metered, replace(cooled, outputs=np.concatenate([cooled.outputs, heat])))
        assert any("is cooled" in one.sentence for one in said) == found
        warm = replace(recording, outputs=np.concatenate([recording.outputs, heat]))
        said = check_physics(metered, warm)
        turned = ["If it heats, turn the sign of scale under [variables.meter]: scale = -1 where there is none."]
        assert [one.remedy for one in said] == ([] if found else turned)
    crowded = replace(recording, inputs=recording.inputs | {"heads": 2.0 * recording.inputs["heads"]})
    assert any("and the description has 20 at most" in one.sentence for one in check_physics(HALL, crowded))
    quick = with_output(recording, "breathed", 420.0 + 4 * (output(recording, "breathed") - 420.0))
    assert any(one.names == ("air",) and one.size < 150.0 for one in check_physics(HALL, quick))
