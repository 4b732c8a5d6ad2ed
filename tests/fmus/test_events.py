"""Limiters and clamps: modes, event indicators, replay."""

import itertools

import numpy as np

DAY = 86400.0
OUTPUTS = ("TRoo", "CO2", "QHea", "mOA")


def test_saturating_controllers_do_not_chatter(twin, weather):
    """Four days, excitations and smooth weather: a few events for each turn of a limiter, and all limits kept."""
    values = {"mOut_flow": 0.05, "gaiCO2.k": 1.2e-5, "conCO2.yMax": 1.0, "QHea_max": 3000.0, "glaSys.UFra": 3.0}
    t = twin().start(values)
    time = np.arange(0.0, 4 * DAY + 1, 1800.0)
    out, _, events = t.run(time, weather, (*OUTPUTS, "yCO2", "yHea"), rtol=1e-6)
    y_co2, y_hea = out[:, 4], out[:, 5]
    assert 10 < events < 160  # two excitations cross their clamps up to some 15 times a day
    for y, top in ((y_co2, 1.0), (y_hea, 1.0)):
        assert np.all((y >= -2e-6) & (y <= top + 2e-6))
        assert np.any(y == 0.0)
        assert np.any((y > 0.01) & (y < top - 0.01))
    assert np.any(y_co2 == 1.0)
    assert np.all(out[:, 2:4] >= 0.0 - 0.01)


def test_replay_takes_actuators_from_the_inputs(twin):
    t = twin().start({"replay": True, "QHea_in": 1234.0, "mOA_in": 0.21, "excHea": 500.0, "excOut": 0.1})
    assert t.get("QHea", "mOA", "yCO2", "yHea").tolist() == [1234.0, 0.21, 0.0, 0.0]
    assert t.dx[-2:].tolist() == [0.0, 0.0]
    t.set(QHea_in=-100.0, mOA_in=-0.1)
    t.event()
    assert t.get("QHea", "mOA").tolist() == [0.0, 0.0]


def test_replaying_the_control_run_gives_the_control_run(twin, winter):
    """Interval means of heater and flow over short intervals, fed back."""
    time = np.arange(0.0, DAY + 1, 300.0)
    a = twin().start({"mOut_flow": 0.06})
    means, rows = [], []
    for t0, t1 in itertools.pairwise(time):
        out, integral, _ = a.run(np.array([t0, t1]), winter, OUTPUTS, ("QHea", "mOA"), 1e-6, hold=True)
        means.append(integral / (t1 - t0))
        rows.append(out[0])
    b = twin().start({"mOut_flow": 0.06, "replay": True})

    def replay(t):
        k = min(int(t // 300.0), len(means) - 1)
        return winter(t) | {"QHea_in": means[k][0], "mOA_in": means[k][1]}

    again, _, _ = b.run(time, replay, OUTPUTS, rtol=1e-6, hold=True)
    error = again[:-1] - np.array(rows)
    assert np.sqrt(np.mean(error[:, 0] ** 2)) < 0.05
    assert np.sqrt(np.mean(error[:, 1] ** 2)) < 3.0
