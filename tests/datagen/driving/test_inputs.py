"""All inputs of a system, composed from its description."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datagen.driving.inputs import build_inputs, excitation_signal, schedule_signal, system_weather
from datagen.driving.tables import SNAP, Piecewise
from shared.errors import SystemDescriptionError
from shared.signals import Excitation, Schedule, Sinusoid
from shared.system import parse_system

HOUR, DAY = 3600.0, 86400.0

TEXT = """
schema_version = 1
name = "room"
fmu = "room.fmu"
[estimator]
channels = ["T"]
[[parameters]]
name = "R"
unit = "m2.K/W"
min = 0.5
max = 3.0
[[inputs]]
name = "out"
unit = "K"
source = "weather"
column = "temp_air"
[[inputs]]
name = "sun"
unit = "W/m2"
source = "weather"
column = "poa_global"
[[inputs]]
name = "persons"
unit = "1"
source = "occupancy"
[[inputs]]
name = "alsoPersons"
unit = "1"
source = "occupancy"
[[inputs]]
name = "set"
unit = "K"
source = "schedule"
schedule = "day"
[[inputs]]
name = "wobble"
unit = "W"
source = "excitation"
excitation = "heat"
[[inputs]]
name = "co2"
unit = "ppm"
source = "constant"
value = 420.0
[[inputs]]
name = "heater"
unit = "W"
source = "measured"
column = "Q"
value = 12.5
interpolation = "previous"
[[outputs]]
name = "T"
unit = "K"
accuracy = 0.01
[weather]
files = ["pvlib:723170TYA.CSV", "pvlib:703165TY.csv"]
[occupancy]
headcount = [4, 16]
arrival = [7.0, 9.5]
duration = [7.0, 10.0]
jitter = 0.5
attendance = [0.4, 1.0]
gaps = [1, 3]
gap_duration = [0.4, 1.5]
gap_share = [0.3, 1.0]
absence = 0.05
weekend = 0.15
[schedules.day]
weekday = [[0.0, 290.0], [6.5, 294.0], [22.0, 290.0]]
weekend = [[0.0, 289.0]]
[excitations.heat]
components = [{ amplitude = 300.0, period = 7.3, phase = 0.25 }, { amplitude = 100.0, period = 53.0 }]
"""
PATH = Path("room") / "system.toml"
SYSTEM = parse_system(TEXT, PATH)


def build(index=0, start=0.0, stop=30 * DAY, system=SYSTEM, **more):
    return build_inputs(system, root_seed=3, index=index, start=start, stop=stop, **more)


def changed(old, new):
    assert old in TEXT
    return parse_system(TEXT.replace(old, new, 1), PATH)


def test_every_source():
    table = build()
    assert table.names == tuple(SYSTEM.input_names)
    assert (table.start, table.stop) == (0.0, 30 * DAY)
    got = dict(zip(table.names, table.at(np.array([0.0, 10 * HOUR, 5 * DAY + 10 * HOUR])).T, strict=True))
    weather = system_weather(SYSTEM, 3, 0)
    np.testing.assert_allclose(got["out"], weather.values("temp_air")[[0, 10, 130]])
    np.testing.assert_allclose(got["sun"], weather.values("poa_global")[[0, 10, 130]])
    np.testing.assert_array_equal(got["persons"], got["alsoPersons"])
    np.testing.assert_array_equal(got["set"], [290, 294, 289])
    assert got["wobble"][0] == pytest.approx(300.0)  # a quarter of a period ahead; the other begins at zero
    assert (got["co2"] == 420.0).all()
    assert (got["heater"] == 12.5).all()


@given(st.integers(0, 10**5), st.floats(-20 * DAY, 50 * DAY), st.floats(HOUR, 20 * DAY))
@settings(max_examples=20)
def test_an_input_at_a_time_does_not_depend_on_the_span(index, start, length):
    whole = build(index, -21 * DAY, 80 * DAY)
    part = build(index, start, start + length)
    t = np.random.default_rng(0).uniform(start, start + length, 200)
    # a span that begins within SNAP of a knot may take that knot for its start: inputs move by at most slope * SNAP
    steepest = 1000.0 / HOUR
    np.testing.assert_allclose(part.at(t), whole.at(t), rtol=0, atol=steepest * SNAP)


def test_each_system_draws_its_weather():
    places = [system_weather(SYSTEM, 3, k).latitude for k in range(60)]
    assert set(places) == {36.1, 55.317}
    assert 15 < places.count(36.1) < 45


def test_excitation_off_measured_and_overrides():
    heater = Piecewise([0, DAY], [1, 2], "previous")
    outside = Piecewise([0, 30 * DAY], [270, 300])
    table = build(excitation=False, measured={"Q": heater}, overrides={"out": outside})
    column = dict(zip(table.names, table.at([0.0, 2 * DAY]).T, strict=True))
    np.testing.assert_array_equal(column["wobble"], [0, 0])
    np.testing.assert_array_equal(column["heater"], [1, 2])
    np.testing.assert_allclose(column["out"], [270, 272])
    np.testing.assert_array_equal(column["persons"], build().at([0.0, 2 * DAY])[:, 2])


def test_schedule_of_the_week():
    schedule = Schedule(weekday=[(0, 1.0), (6.5, 2.0), (22, 1.0)], weekend=[(0, 0.5)])
    signal = schedule_signal(schedule, 3 * DAY, 8 * DAY)  # Thursday to Monday
    hours = np.array([-24, -18, -17.5, -2, 0, 7, 22, 24, 31, 48, 55, 72, 79]) * HOUR
    np.testing.assert_array_equal(signal.at(4 * DAY + hours), [1, 1, 2, 1, 1, 2, 1, 0.5, 0.5, 0.5, 0.5, 1, 2])
    every_day = Schedule(weekday=[(0, 1.0), (6.5, 2.0)])
    np.testing.assert_array_equal(schedule_signal(every_day, 5 * DAY, 6 * DAY).at([5.5 * DAY]), [2])


def test_excitation_is_exact_at_its_knots():
    slow = Excitation(components=[Sinusoid(amplitude=2.0, period=8.0), Sinusoid(amplitude=1.0, period=5.0, phase=0.2)])
    signal = excitation_signal(slow, 0, 100 * HOUR)
    np.testing.assert_array_equal(signal.times, np.arange(101) * HOUR)
    h = np.arange(101)
    expected = 2 * np.sin(2 * np.pi * h / 8) + np.sin(2 * np.pi * (h / 5 + 0.2))
    np.testing.assert_allclose(signal.values, expected, atol=1e-10)
    fast = excitation_signal(Excitation(components=[Sinusoid(amplitude=1.0, period=1.5)]), 0, 3 * HOUR)
    np.testing.assert_allclose(np.diff(fast.times), HOUR / 4)  # 5 knots in a period of 1.5 h need 3.3 in the hour


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            'unit = "K"\nsource = "weather"',
            'unit = "Pa"\nsource = "weather"',
            r"system\.toml: inputs 'out': unit is 'Pa'; expected one that 'K', the unit of weather column 'temp_air'",
        ),
        (
            'column = "temp_air"',
            'column = "drybulb"',
            r"system\.toml: inputs 'out': weather column is 'drybulb'; expected one of temp_air, temp_dew, temp_sky",
        ),
    ],
)
def test_weather_columns_and_units_are_checked(old, new, text):
    with pytest.raises(SystemDescriptionError, match=text):
        build(system=changed(old, new))
