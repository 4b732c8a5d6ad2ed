"""How the room answers to its parameters and effects: what must not matter."""

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


@pytest.mark.parametrize("name", ["window.m0", "window.cStack", "timetable.Q", "blinds.fra", "shutdown.fra"])
def test_an_effect_with_a_shape_sleeps_while_the_shape_is_zero(hours, name):
    values = WINTER | REPLAY | {"nPer": 2.0, "HFac": 50.0}
    np.testing.assert_array_equal(hours(values | {f"effect.{name}": 0.5}, 10), hours(values, 10))


def test_effects_at_zero_are_the_base_model_to_the_last_bit(twin, weather):
    effects = {name: 0.0 for name in twin().variables if name.startswith("effect.")}
    effects["effect.adjacent.T"] = 250.0  # no matter while its conductance is zero
    time = np.arange(0.0, 86400.0 + 1, HOUR)
    base, zero = twin().start(), twin().start(effects)
    a, b = (t.run(time, weather, outputs=("TRoo", "CO2", "QHea", "mOA"))[0] for t in (base, zero))
    assert np.array_equal(a, b)
