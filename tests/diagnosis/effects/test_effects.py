"""The generic kinds of effects and their shapes, by hand-made signals; readings that a clock would have to invent."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from diagnosis.effects import Nothing, build, clash, library
from diagnosis.effects.base import foreseen
from diagnosis.effects.kinds import lagged
from diagnosis.effects.shapes import followed, shape_signal, timetable
from diagnosis.recording import DAY, HOUR, Recording
from shared.effects import PresenceShape, SensorEffect, ThresholdShape, TimetableShape
from shared.errors import RecordingError
from shared.system import parse_system

START, DAYS = 10 * DAY, 14


@pytest.fixture(scope="module")
def recording():
    time = START + HOUR * np.arange(1, DAYS * 24 + 1)
    warm = 294.0 + 4.0 * np.sin(2 * np.pi * time / DAY)
    outputs = np.stack([warm, 600.0 + 200.0 * np.sin(2 * np.pi * time / DAY), 0 * time + 1000.0, 0 * time + 0.2])
    return Recording(path="room.nc", step=HOUR, time=time, outputs=outputs, inputs={})


@pytest.fixture(scope="module")
def inputs(default_system, recording):
    """Every input, varying, from five days before the recording on."""
    times = np.arange(START - 5 * DAY, recording.stop + 1, HOUR)
    hours = times / HOUR % 24
    made = {name: Piecewise.constant(0.0) for name in default_system.input_names}
    sun = np.maximum(0.0, 700.0 * np.sin(2 * np.pi * (hours - 6) / 24))
    made |= {
        "TDryBul": Piecewise(times, 280.0 + 5.0 * np.sin(2 * np.pi * times / DAY)),
        "TSky": Piecewise(times, 268.0 + 5.0 * np.sin(2 * np.pi * times / DAY)),
        "winSpe": Piecewise(times, 4.0 + np.cos(times / 40000.0)),
        "HFac": Piecewise(times, sun),
        "CO2Out": Piecewise.constant(420.0),
        "nPer": Piecewise(times, np.where((hours >= 8) & (hours < 18), 10.0, 0.0), "previous"),
        "TSet": Piecewise(times, np.where((hours >= 6) & (hours < 22), 294.15, 290.15), "previous"),
    }
    return made


def effects(system):
    return {effect.name: effect for effect in library(system)}


def test_zero_is_the_base_and_touches_nothing(default_system, recording, inputs):
    outputs = recording.outputs
    for effect in library(default_system):
        assert effect.parameters(0.0) == {}
        assert effect.inputs(0.0, inputs, recording) is inputs
        assert effect.outputs(0.0, outputs, recording.time) is outputs


def test_effects_are_no_part_of_the_hash(default_system):
    text = default_system.path.read_text(encoding="utf-8")
    bare = parse_system(text[: text.index("[[effects]]")], default_system.path)
    assert not bare.effects
    assert bare.hash() == default_system.hash()


def test_what_an_effect_says_it_changes_is_what_it_changes(default_system, recording, inputs):
    for effect in library(default_system):
        after = effect.inputs(effect.scale, inputs, recording)
        changed = {name for name in inputs if after[name] is not inputs[name]}
        touched = changed | set(effect.parameters(effect.scale))
        shown = effect.outputs(effect.scale, recording.outputs, recording.time)
        rows = np.flatnonzero((shown != recording.outputs).any(axis=1))
        touched |= {f"output:{default_system.output_names[k]}" for k in rows}
        # a series that is constant here cannot show a lag or a shift
        assert touched <= effect.changes
        assert effect.changes - touched <= {"output:QHea", "output:mOA"}


def test_timetable_wraps_past_midnight_and_knows_the_days(recording):
    night = TimetableShape(form="timetable", hours=[(20.0, 6.0)], days="weekday")
    shape = timetable(night, START, START + 14 * DAY)
    # day 14 is a Monday, since time zero is: its night begins at 20 and ends on Tuesday at 6
    hours = 14 * DAY + HOUR * np.array([5.99, 19.9, 20.0, 23.0, 29.9, 30.0])
    np.testing.assert_array_equal(shape.at(hours), [0, 0, 1, 1, 1, 0])
    friday, saturday = 18, 19
    assert shape.at(saturday * DAY + 3 * HOUR) == 1  # of Friday's night
    assert shape.at(saturday * DAY + 23 * HOUR) == 0
    assert shape.at(friday * DAY + 12 * HOUR) == 0


def test_threshold_and_presence_have_the_stated_values(recording, inputs, default_system):
    shapes = [
        ThresholdShape(form="threshold", series="TRoo", threshold=295.0, width=0.5),
        PresenceShape(form="presence", series="nPer", half=2.0),
    ]
    made = shape_signal(shapes[:1], inputs, recording, default_system.output_names)
    np.testing.assert_allclose(
        made.at(recording.time), 1 / (1 + np.exp(-(recording.outputs[0] - 295.0) / 0.5)), rtol=1e-12
    )
    # before the recording its first day is repeated
    np.testing.assert_allclose(made.at(recording.time[:24] - 3 * DAY), made.at(recording.time[:24]), rtol=1e-12)
    persons = shape_signal(shapes[1:], inputs, recording, default_system.output_names)
    assert persons.at(START + 12 * HOUR) == pytest.approx(10 / 12)
    assert persons.at(START + 2 * HOUR) == 0
    both = shape_signal(shapes, inputs, recording, default_system.output_names)
    assert both.at(START + 3 * HOUR) == 0
    assert 0 < both.at(START + 9 * HOUR) < 1


def test_a_series_that_was_not_measured_is_an_obstacle(default_system, recording, inputs):
    blind = Recording(
        path="room.nc",
        step=HOUR,
        time=recording.time,
        outputs=np.where(np.arange(4)[:, None] == 0, np.nan, recording.outputs),
        inputs={},
    )
    window = effects(default_system)["window.warm"]
    assert window.obstacle(recording, replay=False) == ""
    assert "TRoo" in window.obstacle(blind, replay=False)
    with pytest.raises(RecordingError, match=r"room\.nc: 'TRoo' was not measured"):
        window.inputs(0.1, inputs, blind)
    assert "TRoo" in effects(default_system)["sensor.temperature.bias"].obstacle(blind, replay=False)


def test_replay_leaves_control_effects_no_way_to_act(default_system, recording):
    cannot = {e.name for e in library(default_system) if e.obstacle(recording, replay=True)}
    assert cannot == {"heater.derated", "heater.leaking", "schedule.shift", "thermostat.bias", "ventilation.night"}
    assert not [e.name for e in library(default_system) if e.obstacle(recording, replay=False)]


def test_a_mean_that_is_followed_holds_over_its_own_step(default_system, recording, inputs):
    """Hourly means of a power: 1000 W from eight to sixteen have their middle at noon."""
    hour = (recording.time - recording.step) / HOUR % 24
    outputs = recording.outputs.copy()
    outputs[2] = np.where((hour >= 8) & (hour < 16), 1000.0, 0.0)
    read = replace(recording, outputs=outputs)
    names, means = default_system.output_names, {o.name for o in default_system.outputs if o.method == "mean"}
    power = followed("QHea", inputs, read, names, means)
    edges = np.append(read.start, read.time)
    table = merge({"QHea": power}, read.start - DAY, read.stop)
    np.testing.assert_allclose(table.means(edges)[:, 0], outputs[2])
    fine = read.start + 60.0 * (np.arange(24 * 60) + 0.5)
    assert np.average((fine - read.start) / HOUR, weights=power.at(fine)) == pytest.approx(12.0)
    assert power.times[0] <= read.start - 5 * DAY


def test_input_effects_by_hand(default_system, recording, inputs):
    found, t = effects(default_system), recording.time[:-1] - 600.0
    sun = found["outdoor.temperature.sun"].inputs(4.0, inputs, recording)["TDryBul"]
    np.testing.assert_allclose(sun.at(t), inputs["TDryBul"].at(t) - 4.0 * inputs["HFac"].at(t) / 1000.0, atol=1e-9)
    lee = found["wind.sheltered"].inputs(0.25, inputs, recording)["winSpe"]
    np.testing.assert_allclose(lee.at(t), 0.75 * inputs["winSpe"].at(t), rtol=1e-12)
    late = found["schedule.shift"].inputs(1.0, inputs, recording)["TSet"]
    day = 15 * DAY
    assert late.at(day + 6.5 * HOUR) == 290.15
    assert late.at(day + 7.0 * HOUR) == 294.15
    swing = found["outdoor.CO2.swing"].inputs(30.0, inputs, recording)["CO2Out"]
    assert swing.at(day + 6 * HOUR) == pytest.approx(450.0)
    assert swing.at(day + 18 * HOUR) == pytest.approx(390.0)
    assert found["outdoor.CO2.offset"].inputs(-25.0, inputs, recording)["CO2Out"].at(day) == 395.0


def test_sensor_effects_by_hand(default_system, recording):
    found, y, t = effects(default_system), recording.outputs, recording.time
    bias = found["sensor.temperature.bias"].outputs(0.7, y, t)
    np.testing.assert_allclose(bias[0], y[0] + 0.7)
    np.testing.assert_array_equal(bias[1:], y[1:])
    np.testing.assert_allclose(found["sensor.CO2.gain"].outputs(0.1, y, t)[1], 420 + 1.1 * (y[1] - 420))
    drift = found["sensor.CO2.drift"].outputs(60.0, y, t)[1] - y[1]
    assert drift[0] == 0
    assert drift[-1] == pytest.approx(60.0 * (DAYS * 24 - 1) / (30 * 24))
    late = found["clock"].outputs(1.0, y, t)
    np.testing.assert_allclose(late[0, :-1], y[0, 1:])  # a clock that is an hour late reads what comes in an hour


def test_lag_follows_a_sine_with_gain_and_phase_of_a_first_order_system():
    step, constant, period = 600.0, 3 * HOUR, DAY
    t = step * np.arange(20 * 144)
    shown = lagged(np.sin(2 * np.pi * t / period), constant, step)
    w = 2 * np.pi * constant / period
    expected = np.sin(2 * np.pi * t / period - np.arctan(w)) / np.sqrt(1 + w**2)
    np.testing.assert_allclose(shown[-144:], expected[-144:], atol=2e-4)
    np.testing.assert_allclose(lagged(np.sin(t / period), 1e-3, step), np.sin(t / period), atol=1e-6)


def test_two_that_set_the_same_clash(default_system, recording):
    found = effects(default_system)
    assert clash([found["window.warm"], found["window.night"]]).startswith("window.warm and window.night both set ")
    assert not clash([found["outdoor.CO2.offset"], found["outdoor.CO2.swing"], found["plug"]])
    assert Nothing("placebo").outputs(3.0, recording.outputs, recording.time) is recording.outputs


STEP, NOISE = 1800.0, 0.1


def clock(system, lower=-3.0, upper=3.0, **more):
    common = {"name": "clock", "kind": "sensor", "unit": "h", "scale": 0.5, "operation": "shift", "factor": HOUR}
    return build(SensorEffect(outputs=["TRoo", "CO2"], lower=lower, upper=upper, **common, **more), system)


def heated(time):
    """A room that is heated from six to ten at night, by straight lines [degC]."""
    return np.interp(time / HOUR % 24, [0, 6, 7, 22, 24], [17.5, 17.0, 21.0, 21.0, 17.5])


def half_hours(begin, end):
    time = np.arange(begin + STEP, end + 1, STEP)
    return Recording("room.nc", STEP, time, np.tile(heated(time), (4, 1)), {})


@pytest.mark.parametrize("amplitude", [-1.0, 0.25, 1.0])
def test_what_counts_is_what_a_clock_shows_of_a_longer_recording(default_system, amplitude):
    """Ends in the middle of what heats up, at half past six."""
    effect = clock(default_system)
    cut = half_hours(6.5 * HOUR, 7 * DAY + 6.5 * HOUR)
    time = np.arange(0.0, 8 * DAY, STEP)
    shown = np.interp(cut.time, time, effect.outputs(amplitude, np.tile(heated(time), (4, 1)), time)[0])
    fitted = effect.outputs(amplitude, cut.outputs, cut.time)[0]
    lost = 0.5 * ((shown - fitted) / NOISE) ** 2
    counts = foreseen([effect], cut)
    assert lost[counts[0]].sum() < 1e-9
    assert lost.sum() > 5
    # three hours at either edge, of the outputs that the clock stamps
    assert (~counts).sum(axis=1).tolist() == [12, 12, 0, 0]


def test_every_candidate_is_weighed_by_the_same_readings(default_system):
    week = half_hours(0.0, 7 * DAY)
    others = [one for one in library(default_system) if one.spec.kind != "sensor" and "shift" not in one.name]
    assert foreseen(others, week).all()
    np.testing.assert_array_equal(
        foreseen([*others, clock(default_system)], week), foreseen([clock(default_system)], week)
    )


def test_a_clock_that_may_invent_more_than_a_quarter_is_not_tried(default_system):
    day = half_hours(0.0, DAY)
    assert clock(default_system).obstacle(day, replay=False) == ""
    assert "more than a quarter of the readings" in clock(default_system, -4.0, 4.0).obstacle(day, replay=False)
