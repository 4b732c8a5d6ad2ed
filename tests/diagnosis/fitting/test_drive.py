"""What drives the model over a recording: its own inputs, and its first day before them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from datagen import simulate
from datagen.driving.tables import merge
from diagnosis.fitting.inputs import crowd, drive
from diagnosis.recording import DAY, HOUR, Recording, read_recording
from shared.errors import RecordingError, SystemDescriptionError


@pytest.fixture(scope="module")
def record(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "room.nc"
    simulate(default_system, hours=72.0, seed=9, out=path)
    return read_recording(path, default_system)


def test_inputs_are_the_recordings(record, default_system):
    """An instant is joined to the next by a straight line; a mean holds over its step."""
    driven = drive(default_system, record, warm_up=DAY)
    assert (driven.begin, driven.start, driven.stop) == (record.start - DAY, record.start, record.stop)
    table = merge(driven.signals, driven.begin, driven.stop)
    k = default_system.input_names.index("TDryBul")
    np.testing.assert_allclose(table.at(record.time)[:, k], record.inputs["TDryBul"], atol=1e-4)
    n = default_system.input_names.index("nPer")
    edges = np.concatenate([[record.start], record.time])
    np.testing.assert_allclose(table.means(edges)[:, n], record.inputs["nPer"], atol=1e-4)


@pytest.mark.parametrize(("hours", "days"), [(1, 1), (25, 2)])
def test_whole_first_days_stand_before_the_recording(record, default_system, hours, days):
    driven = drive(default_system, record, warm_up=hours * HOUR)
    assert driven.begin == record.start - days * DAY
    signal = driven.signals["TDryBul"]
    first = record.time[record.time <= record.start + DAY]
    for back in range(1, days + 1):
        np.testing.assert_allclose(signal.at(first - back * DAY), signal.at(first), rtol=1e-12)
    held = driven.signals["nPer"]
    middles = first - 0.5 * record.step
    np.testing.assert_array_equal(held.at(middles - DAY), held.at(middles))


def test_nothing_is_replayed_where_no_actuator_is_measured(record, default_system):
    """The page would say that actuators were replayed."""
    inputs = [one for one in default_system.inputs if one.source != "measured"]
    with pytest.raises(SystemDescriptionError, match=r"system.toml: inputs: none has the source 'measured'"):
        drive(default_system.model_copy(update={"inputs": inputs}), record, warm_up=0.0, replay=True)


def test_what_drives_a_model_without_controllers_must_have_been_measured(house, house_recorded, tmp_path):
    """Nothing in the FMU takes its place, and the description's 0 degC is no weather."""
    system = house("me")
    record = read_recording(house_recorded(tmp_path, hours=72), system)
    assert drive(system, record, warm_up=0.0).assumed == {}
    without = {name: values for name, values in record.inputs.items() if name != "To"}
    with pytest.raises(RecordingError, match="input 'To' was not recorded; expected it in degC"):
        drive(system, replace(record, inputs=without), warm_up=0.0)
    # an import has said so, and says it still
    stands_in = replace(record, assumed={"To": "assumed, not measured"})
    assert drive(system, stands_in, warm_up=0.0).assumed == {"To": "assumed, not measured"}


def test_uncounted_persons_of_several_inputs_are_refused(default_system):
    """Where a system is simulated they are one crowd (datagen.driving.inputs); a fit would make them two."""
    (persons,) = [one for one in default_system.inputs if one.source == "occupancy"]
    two = default_system.model_copy(
        update={"inputs": [*default_system.inputs, persons.model_copy(update={"name": "breathing"})]}
    )
    time = HOUR * np.arange(1, 25)
    counted = {name: np.ones(24) for name in (persons.name, "breathing")}
    record = Recording(Path("room.nc"), HOUR, time, np.zeros((len(two.outputs), 24)), counted)
    assert crowd(two, record, None) == "measured"
    said = rf"room\.nc: persons .*system\.toml has 2 inputs for them \({persons.name}, breathing\); expected"
    for inputs, wanted in (({}, None), ({persons.name: np.ones(24)}, None), (counted, "unknown")):
        with pytest.raises(RecordingError, match=said):
            crowd(two, replace(record, inputs=inputs), wanted)
    assert crowd(default_system, replace(record, inputs={}), None) == "unknown"
