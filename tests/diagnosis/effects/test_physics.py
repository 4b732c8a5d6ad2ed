"""What effects do to the default room, against balances by hand and against other ways to say the same."""

import numpy as np
import pytest

from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import sample_parameters
from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from diagnosis.blind.generator import signals_of
from diagnosis.effects import library
from diagnosis.recording import DAY, HOUR, Recording

PPM = 28.9647 / 44.0095 * 1e6  # mass fraction of CO2 to ppm
T_OUT, WIND, N, FLOW, POWER = 273.15, 5.0, 6.0, 0.12, 1800.0
STEADY = 60 * DAY


@pytest.fixture(scope="module")
def simulator(default_system):
    return Simulator(default_system)


@pytest.fixture(scope="module")
def effects(default_system):
    return {effect.name: effect for effect in library(default_system)}


@pytest.fixture(scope="module")
def values(default_system):
    return {p.name: float(p.from_unit(0.5)) for p in default_system.parameters}


def recording_of(simulator, hours=24, start=0.0, outputs=None):
    time = start + HOUR * np.arange(1, hours + 1)
    shape = (len(simulator.system.outputs), hours)
    return Recording(
        path="room", step=HOUR, time=time, outputs=np.ones(shape) if outputs is None else outputs, inputs={}
    )


def steady(simulator, values, effect=None, amplitude=0.0, replay=True, **inputs):
    """Outputs after two months of the same day: TRoo [K], CO2 [ppm], QHea [W], mOA [kg/s]."""
    level = {"TDryBul": T_OUT, "TSky": T_OUT, "winSpe": WIND, "CO2Out": 420.0, "nPer": N, "TSet": 294.15}
    level |= {"QHea_in": POWER, "mOA_in": FLOW, **inputs}
    signals = {name: Piecewise.constant(level.get(name, 0.0)) for name in simulator.system.input_names}
    recording = recording_of(simulator, start=STEADY - DAY)
    changed = {}
    if effect is not None:
        signals, changed = effect.inputs(amplitude, signals, recording), effect.parameters(amplitude)
    made = simulator.run(
        {**values, **changed},
        merge(signals, 0.0, STEADY),
        start=0.0,
        stop=STEADY,
        record_from=STEADY - DAY,
        tolerance=1e-8,
        replay=replay,
    )
    outputs = effect.outputs(amplitude, made.outputs, made.time) if effect is not None else made.outputs
    return outputs[:, -1]


@pytest.mark.parametrize(
    ("name", "amplitude", "heat"),
    [
        ("bridge", 35.0, lambda T: 35.0 * (T_OUT - T)),
        ("adjacent", 60.0, lambda T: 60.0 * (288.15 - T)),
        ("plug", 650.0, lambda T: 650.0),
        ("infiltration.constant", 0.05, lambda T: 0.05 * 1006 * (T_OUT - T)),
        ("infiltration.wind", 0.01, lambda T: 0.01 * WIND * 1006 * (T_OUT - T)),
        ("infiltration.stack", 0.003, lambda T: 0.003 * (abs(T - T_OUT) - 0.01) * 1006 * (T_OUT - T)),
        ("mixing", 0.3, lambda T: -0.3 * FLOW * 1006 * (T_OUT - T)),
        ("meter.heater.gain", 0.2, lambda T: POWER / 1.2 - POWER),
    ],
)
def test_heat_of_an_effect_is_what_another_heater_would_give(simulator, values, effects, name, amplitude, heat):
    """In the steady state the effect's heat, by hand, replaces heater power watt by watt."""
    T, *_ = steady(simulator, values, effects[name], amplitude)
    base, *_ = steady(simulator, values)
    same, *_ = steady(simulator, values, QHea_in=POWER + heat(T))
    assert same == pytest.approx(T, abs=2e-3)
    assert (T - base) * heat(T) > 0
    assert abs(T - base) > 0.02


@pytest.mark.parametrize(
    ("name", "amplitude", "flow", "outdoor"),
    [
        (None, 0.0, FLOW, 420.0),
        ("infiltration.constant", 0.05, FLOW + 0.05, 420.0),
        ("infiltration.wind", 0.01, FLOW + 0.01 * WIND, 420.0),
        ("mixing", 0.3, 0.7 * FLOW, 420.0),
        ("outdoor.CO2.offset", 45.0, FLOW, 465.0),
        ("meter.flow.gain", 0.25, FLOW / 1.25, 420.0),
        ("bridge", 50.0, FLOW, 420.0),
    ],
)
def test_steady_co2_is_outdoor_air_and_what_persons_add(simulator, values, effects, name, amplitude, flow, outdoor):
    _, co2, *_ = steady(simulator, values, effects.get(name), amplitude)
    assert co2 == pytest.approx(outdoor + values["gaiCO2.k"] * N / flow * PPM, abs=0.05)


def test_heater_effects_by_hand(simulator, values, effects):
    """A heater at its limit gives what is left of it; one that is off gives what leaks."""
    cold = {"replay": False, "TDryBul": 243.15, "TSky": 243.15, "nPer": 0.0}
    assert steady(simulator, values, **cold)[2] == pytest.approx(10000.0, abs=1.0)
    assert steady(simulator, values, effects["heater.derated"], 0.35, **cold)[2] == pytest.approx(6500.0, abs=1.0)
    warm = {"replay": False, "TDryBul": 305.15, "TSky": 305.15, "nPer": 0.0}
    assert steady(simulator, values, **warm)[2] == pytest.approx(0.0, abs=1e-6)
    assert steady(simulator, values, effects["heater.leaking"], 250.0, **warm)[2] == pytest.approx(250.0, abs=1e-3)


def test_thermostat_that_reads_high_keeps_the_room_cold_and_shows_the_set_point(simulator, values, effects):
    """An integrating controller holds what its sensor shows at the set point."""
    mild = {"replay": False, "TDryBul": 283.15, "TSky": 283.15, "nPer": 0.0}
    base = steady(simulator, values, **mild)
    read = steady(simulator, values, effects["thermostat.bias"], 0.8, **mild)
    assert base[0] == pytest.approx(294.15, abs=0.01)
    assert read[0] == pytest.approx(294.15, abs=0.01)
    assert read[2] < base[2] - 50.0
    logger = steady(simulator, values, effects["sensor.temperature.bias"], 0.8, **mild)
    assert logger[0] - 0.8 == pytest.approx(294.15, abs=0.01)


def test_furniture_slows_the_first_seconds_by_its_capacity(simulator, values, effects):
    """From equilibrium at one temperature the air's rate is power over capacity: nothing else has moved yet."""
    signals = {name: Piecewise.constant(0.0) for name in simulator.system.input_names}
    signals |= {"TDryBul": Piecewise.constant(293.15), "TSky": Piecewise.constant(293.15)}
    signals |= {"QHea_in": Piecewise.constant(1000.0), "CO2Out": Piecewise.constant(420.0)}
    rates = []
    for amplitude in (0.0, 2.0):
        made = simulator.run(
            {**values, **effects["furniture"].parameters(amplitude)},
            merge(signals, 0.0, 4.0),
            start=0.0,
            stop=4.0,
            step=4.0,
            tolerance=1e-9,
            replay=True,
        )
        rates.append((made.outputs[0, -1] - 293.15) / 4.0)
    capacity = 1.2 * 1006 * values["roo.V"]
    assert rates[0] == pytest.approx(1000.0 / capacity, rel=0.02)
    assert rates[1] == pytest.approx(1000.0 / (capacity + 2e6), rel=0.02)


@pytest.fixture(scope="module", params=[20, 200], ids=["winter", "summer"])
def season(request, simulator):
    """Ten days of weather and persons, the first three for warming up; signals, recording, parameters."""
    begin = request.param * DAY
    table = build_inputs(simulator.system, root_seed=4, index=2, start=begin, stop=begin + 10 * DAY)
    signals = signals_of(table)
    drawn = dict(zip(simulator.system.parameter_names, sample_parameters(simulator.system, 4, 2), strict=True))
    base = run(simulator, drawn, signals, begin)
    return signals, recording_of(simulator, 7 * 24, begin + 3 * DAY, base), drawn, base


def run(simulator, values, signals, begin, replay=False):
    made = simulator.run(
        values,
        merge({name: signals[name] for name in simulator.system.input_names}, begin, begin + 10 * DAY),
        start=begin,
        stop=begin + 10 * DAY,
        record_from=begin + 3 * DAY,
        replay=replay,
    )
    return made.outputs


def acted(simulator, season, effect, amplitude, **more):
    signals, recording, values, _ = season
    after = effect.inputs(amplitude, {**signals, **more}, recording)
    outputs = run(simulator, {**values, **effect.parameters(amplitude)}, after, recording.start - 3 * DAY)
    return effect.outputs(amplitude, outputs, recording.time)


@pytest.mark.slow
def test_zero_gives_the_base_bit_by_bit_and_next_to_it_is_nearly_the_base(simulator, season, effects):
    """A base value that is declared wrong would jump away from zero."""
    base, accuracy = season[3], np.array([o.accuracy for o in simulator.system.outputs])
    assert np.array_equal(acted(simulator, season, next(iter(effects.values())), 0.0), base)
    for name, effect in effects.items():
        near = acted(simulator, season, effect, 1e-6 * effect.scale)
        assert (np.abs(near - base).max(axis=1) < accuracy).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_every_effect_acts_in_some_season(simulator, season, effects, direction):
    """Twice its scale moves a channel by more than the simulation's accuracy; what sleeps in one season is listed."""
    base, accuracy = season[3], np.array([o.accuracy for o in simulator.system.outputs])
    summer = season[1].start > 100 * DAY
    sleeps = {True: {"heater.derated", "schedule.shift"}, False: {"window.warm"}}[summer]
    for name, effect in effects.items():
        amplitude = direction * 2.0 * effect.scale
        if not effect.lower <= amplitude <= effect.upper:
            continue
        moved = np.abs(acted(simulator, season, effect, amplitude) - base).max(axis=1) / accuracy
        assert moved.max() > 3.0 or name in sleeps, name
