"""How the room answers to its parameters: sign, size, and what must not matter."""

import numpy as np
import pytest

HOUR = 3600.0
TABLE = {  # the ranges of the estimated parameters
    "gaiCO2.k": (6e-6, 1.2e-5),
    "roo.AFlo": (60.0, 200.0),
    "roo.hRoo": (2.5, 4.0),
    "roo.V": (40.0, 300.0),
    "matExtWal.R": (0.5, 3.0),
    "glaSys.UFra": (1.0, 3.0),
    "glaSys.absSolFra": (0.3, 0.7),
    "mOut_flow": (0.05, 0.5),
}
WINTER = {"TDryBul": 270.0, "TSky": 258.0, "winSpe": 3.0, "CO2Out": 420.0}


@pytest.fixture
def hours(twin):
    """Outputs (TRoo, CO2, QHea, mOA) after some hours of constant inputs."""

    def run(values, n=24.0):
        t = twin().start(WINTER | values)
        return t.run(np.array([0.0, n * HOUR]), rtol=1e-8)[0], t.get("TRoo", "CO2", "QHea", "mOA")

    return lambda values, n=24.0: run(values, n)[1]


REPLAY = {"replay": True, "QHea_in": 1500.0, "mOA_in": 0.05}
# conditions, hours, output, sign and least size of the change from the low to the high end of the range
RESPONSES = [
    ("gaiCO2.k", {"nPer": 10.0} | REPLAY, 24, "CO2", +500.0),
    ("roo.AFlo", REPLAY, 240, "TRoo", -1.0),  # a larger facade loses more
    ("roo.hRoo", REPLAY, 240, "TRoo", -1.0),
    ("roo.V", {"nPer": 10.0} | REPLAY, 1, "CO2", -300.0),  # dilutes while CO2 builds up
    ("roo.V", {"nPer": 10.0} | REPLAY, 240, "CO2", 0.0),  # not once it is steady
    ("matExtWal.R", REPLAY, 240, "TRoo", +2.0),
    ("glaSys.UFra", REPLAY, 240, "TRoo", -2.0),
    ("glaSys.absSolFra", {"HFac": 400.0} | REPLAY, 240, "TRoo", -2.0),  # keeps sun out
    ("glaSys.absSolFra", REPLAY, 240, "TRoo", 0.0),  # without sun there is nothing to absorb
    ("mOut_flow", {"nPer": 2.0}, 24, "CO2", -200.0),
    ("mOut_flow", {}, 24, "QHea", +4000.0),  # more outdoor air to heat
    ("matExtWal.R", {"nPer": 10.0}, 240, "QHea", -300.0),
    ("glaSys.UFra", {"nPer": 10.0}, 240, "QHea", +300.0),
]


@pytest.mark.parametrize(("name", "values", "n", "output", "least"), RESPONSES)
def test_sign_and_size(hours, name, values, n, output, least):
    k = ("TRoo", "CO2", "QHea", "mOA").index(output)
    low, high = (hours(values | {name: end}, n)[k] for end in TABLE[name])
    change = high - low
    if least == 0.0:
        assert abs(change) < 1e-3
    else:
        assert np.sign(change) == np.sign(least)
        assert abs(least) < abs(change) < 20 * abs(least)


def test_co2_and_temperature_are_apart_where_they_should_be(twin):
    """In replay the emission rate leaves the temperature alone; the envelope leaves CO2 alone."""
    base = WINTER | REPLAY | {"nPer": 8.0, "HFac": 200.0}
    reference = twin().start(base)
    time = np.array([0.0, 7200.0])
    reference.run(time)
    for name, (_, high) in TABLE.items():
        other = twin().start(base | {name: high})
        other.run(time)
        dT, dC = np.abs(other.get("TRoo", "CO2") - reference.get("TRoo", "CO2"))
        assert (dC > 1.0) == (name in {"gaiCO2.k", "roo.V"}), name
        assert (dT > 1e-4) == (name not in {"gaiCO2.k", "mOut_flow"}), name


EFFECTS = {  # amplitude, output, sign and least size of the change after ten cold hours
    "effect.infiltration.m0": (0.03, "TRoo", -0.3),
    "effect.infiltration.cWind": (0.01, "TRoo", -0.3),
    "effect.infiltration.cStack": (0.002, "TRoo", -0.3),
    "effect.bridge.UA": (30.0, "TRoo", -0.3),
    "effect.adjacent.UA": (100.0, "TRoo", +0.3),
    "effect.furniture.C": (2e7, "TRoo", +0.3),  # cools down more slowly
    "effect.plug.Q": (500.0, "TRoo", +0.3),
    "effect.shading.fra": (0.5, "TRoo", -0.3),
    "effect.mixing.bypass": (0.5, "CO2", +100.0),
    "effect.window.m0": (0.03, "TRoo", -0.3),
    "effect.window.cStack": (0.002, "TRoo", -0.3),
    "effect.timetable.Q": (500.0, "TRoo", +0.3),
    "effect.blinds.fra": (0.5, "TRoo", -0.3),
    "effect.shutdown.fra": (0.5, "CO2", +100.0),
}
SHAPES = ("yWin", "yPlu", "yOff", "ySha")


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_acts(hours, name):
    amplitude, output, least = EFFECTS[name]
    values = WINTER | REPLAY | {"nPer": 2.0, "HFac": 50.0, "QHea_in": 100.0, "mOA_in": 0.03}
    k = ("TRoo", "CO2").index(output)
    values |= dict.fromkeys(SHAPES, 1.0)
    change = hours(values | {name: amplitude}, 10)[k] - hours(values, 10)[k]
    assert np.sign(change) == np.sign(least)
    assert abs(least) < abs(change) < 50 * abs(least)


@pytest.mark.parametrize("name", ["window.m0", "window.cStack", "timetable.Q", "blinds.fra", "shutdown.fra"])
def test_an_effect_with_a_shape_sleeps_while_the_shape_is_zero(hours, name):
    values = WINTER | REPLAY | {"nPer": 2.0, "HFac": 50.0}
    np.testing.assert_array_equal(hours(values | {f"effect.{name}": 0.5}, 10), hours(values, 10))


def test_effects_at_zero_are_the_base_model_to_the_last_bit(twin, weather):
    effects = {name: 0.0 for name in twin().variables if name.startswith("effect.")}
    effects["effect.adjacent.T"] = 250.0  # no matter while its conductance is zero
    time = np.arange(0.0, 3 * 86400.0, HOUR)
    base, zero = twin().start(), twin().start(effects)
    a, b = (t.run(time, weather, outputs=("TRoo", "CO2", "QHea", "mOA"))[0] for t in (base, zero))
    assert np.array_equal(a, b)
