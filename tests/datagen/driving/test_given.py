"""Given facts, ratios, drawn timetables and occupancy per area, as the farm draws them for the shipped Room."""

import numpy as np
import pytest

from datagen.driving.inputs import build_inputs, system_weather
from datagen.driving.occupancy import occupancy_prior, sized
from datagen.driving.sampling import fmu_values, sample_given, sample_parameters
from datagen.simulating.simulator import Simulator
from shared.errors import SystemDescriptionError
from shared.given import Given
from shared.system import load_system, parse_system

HOUR = 3600.0


@pytest.fixture(scope="module")
def room():
    return load_system("Room")


def test_a_fact_is_uniform_in_its_scale_and_zero_in_its_share():
    fact = Given(name="size", unit="W", min=10.0, max=1000.0, scale="log", zero=0.25, parameters=["P"])
    values = np.array([fact.from_unit(u) for u in np.linspace(0, 1, 4001)])
    assert np.mean(values == 0) == pytest.approx(0.25, abs=1e-3)
    assert np.median(values[values > 0]) == pytest.approx(100.0, rel=1e-2)  # the geometric middle
    assert values.max() == pytest.approx(1000.0)
    steps = Given(name="azimuth", unit="degree", min=0.0, max=330.0, quantum=30.0, weather="surface_azimuth")
    assert {steps.from_unit(u) for u in np.linspace(0, 1, 1000)} == set(np.arange(12) * 30.0)


def test_what_is_drawn_goes_together(room):
    for index in range(40):
        drawn = dict(zip(room.parameter_names, sample_parameters(room, 7, index), strict=True))
        for one in room.ratios:
            assert one.min <= drawn[one.over] / drawn[one.under] <= one.max
        given = sample_given(room, 7, index)
        assert given == sample_given(room, 7, index)
        area = drawn["roo.AFlo"]
        assert 20.0 <= given["heater.size"] / area <= 250.0
        starts = {name: 3.0 + k for one in room.given for k, name in enumerate(one.parameters)}
        values = fmu_values(room, given, starts)
        layers = [values[name] for name in next(one for one in room.given if one.name == "floor.mass").parameters]
        assert sum(layers) == pytest.approx(given["floor.mass"])
        assert layers[1] / layers[0] == pytest.approx(4.0 / 3.0)  # as the FMU's own


def test_occupancy_follows_the_floor_area(room):
    persons_alone = room.model_copy(update={"inputs": [one for one in room.inputs if one.name == "nPer"]})
    for index in range(12):
        table = build_inputs(persons_alone, root_seed=3, index=index, start=0.0, stop=14 * 24 * HOUR)
        persons = table.at(np.arange(0, 14 * 24) * HOUR)[:, 0]
        assert persons.max() > 0
        area = sample_parameters(room, 3, index)[room.parameter_names.index("roo.AFlo")]
        assert persons.max() <= max(round(0.3 * area), 1)


def test_the_weather_of_a_system_is_turned_and_warmed(room):
    for index in range(3):
        given, table = sample_given(room, 11, index), system_weather(room, 11, index)
        plain = room.model_copy(update={"given": []})
        before = system_weather(plain, 11, index)
        assert np.allclose(table.columns["temp_air"] - before.columns["temp_air"], given["climate"])
        assert np.allclose(table.columns["temp_sky"] - before.columns["temp_sky"], given["climate"])
        if given["azimuth"] != room.weather.surface_azimuth:
            assert not np.allclose(table.columns["poa_global"], before.columns["poa_global"])


TEXT = """
schema_version = 1
name = "Pipe"
fmu = "pipe.fmu"
[estimator]
channels = ["flow"]
[[parameters]]
name = "a"
unit = "1"
min = 1.0
max = 2.0
[[outputs]]
name = "flow"
unit = "1"
accuracy = 0.1
"""


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (
            '[[given]]\nname = "a"\nunit = "1"\nmin = 0.0\nmax = 1.0\nparameters = ["P"]',
            "'a' is the name of two things",
        ),
        ('[[given]]\nname = "g"\nunit = "1"\nmin = 0.0\nmax = 1.0\nparameters = ["a"]', "'a', which is an estimated"),
        ('[[ratios]]\nover = "a"\nunder = "b"\nmin = 0.0\nmax = 1.0', "'b' is not an estimated parameter"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, more, said):
    with pytest.raises(SystemDescriptionError, match=said):
        parse_system(TEXT + more, tmp_path / "system.toml")


def test_ratios_that_no_draw_has_are_named(tmp_path):
    system = parse_system(
        TEXT + '[[parameters]]\nname = "b"\nunit = "1"\nmin = 1.0\nmax = 2.0\n'
        '[[ratios]]\nover = "a"\nunder = "b"\nmin = 5.0\nmax = 6.0\n',
        tmp_path / "system.toml",
    )
    with pytest.raises(SystemDescriptionError, match="a / b from 5 to 6"):
        sample_parameters(system, 0, 0)


def test_a_fact_that_the_fmu_does_not_have_is_named(room):
    wrong = room.given[0].model_copy(update={"parameters": ["fraWim"]})
    with pytest.raises(SystemDescriptionError, match=r"'fraWim' is not a variable .* did you mean 'fraWin'"):
        Simulator(room.model_copy(update={"given": [wrong]}))


def test_the_prior_of_persons_is_that_of_the_rooms_own_size(room):
    hours = np.arange(0, 8 * 24 + 1) * HOUR
    spec = sized(room.occupancy, 50.0)
    assert spec.headcount == (1, 15)  # 0.02 and 0.3 per square metre
    assert occupancy_prior(spec, hours, 400, seed=1).max() <= 15
    assert sized(room.occupancy, 4000.0).headcount == (80, 120)  # the description's headcount limits it
