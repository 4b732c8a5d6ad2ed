"""Heat and CO2 balances, computed here from parameters and outputs."""

import numpy as np
import pytest

FLOWS = ("QFacOut", "QWinOut", "QSolFac", "QSolWin", "QSolTra", "QVen", "QInf", "QEff", "QPeo", "QHea")
RATIO = 44.0095 / 28.9647 * 1e-6  # CO2 mass fraction per ppm
WINTER = {"TDryBul": 271.15, "TSky": 258.15, "winSpe": 4.0, "HFac": 150.0, "CO2Out": 420.0, "nPer": 12.0}


def steady(twin, values, days=60.0):
    """An instance at rest under constant inputs."""
    t = twin().start(values)
    t.run(np.array([0.0, days * 86400.0]), rtol=1e-10)
    assert np.max(np.abs(t.dx)) < 1e-9
    return t


@pytest.mark.parametrize("replay", [False, True])
def test_steady_state_closes_both_balances(twin, replay):
    values = WINTER | {"replay": replay, "QHea_in": 2500.0, "mOA_in": 0.11, "TSet": 294.15, "matExtWal.R": 0.9}
    t = steady(twin, values)
    T, ppm, Q, m = t.get("TRoo", "CO2", "QHea", "mOA")
    if replay:
        assert (Q, m) == (2500.0, 0.11)
    else:
        assert abs(T - 294.15) < 1e-6  # integral action
        assert m == 0.15  # CO2 below its set point
    # CO2: what the persons give off leaves with the air
    assert m * (ppm - 420.0) * RATIO == pytest.approx(9e-6 * 12, rel=1e-6)

    # heat: sun, sensible heat of persons and heater leave by facade, window and ventilation
    A_facade = np.sqrt(120.0) * 3.0
    A_win, A_fac = 0.4 * A_facade, 0.6 * A_facade
    gains = 0.35 * A_win * 150.0 + 0.8 * 120.0 * 12 + Q
    T_fo, T_fi, T_po, T_pi = t.get("facade.T[1]", "facade.T[3]", "win.TOut", "win.TIn")
    facade = A_fac / 0.9 * (T_fi - T_fo)
    window = A_win / (1 / 2.0 - 0.17) * (T_pi - T_po) - 0.25 * A_win * 150.0  # half the absorbed sun arrives inside
    ventilation = m * 1006.0 * (T - 271.15)
    assert gains == pytest.approx(facade + window + ventilation, rel=1e-6)
    assert np.sum(t.get(*FLOWS)) == pytest.approx(0.0, abs=1e-6 * gains)


def test_co2_builds_up_and_decays_exponentially(twin):
    m, V, n = 0.08, 110.0, 9.0
    tau = 1.2 * V / m
    values = {"replay": True, "mOA_in": m, "roo.V": V, "nPer": n, "CO2Out": 430.0, "CO2_start": 900.0}
    t = twin().start(values)
    time = np.arange(0.0, 6 * 3600.0 + 1, 600.0)
    up = t.run(time, outputs=("CO2",), rtol=1e-9)[0][:, 0]
    end = 430.0 + 9e-6 * n / m / RATIO
    np.testing.assert_allclose(up, end + (900.0 - end) * np.exp(-time / tau), atol=1e-3)
    t.set(nPer=0.0)
    down = t.run(time, outputs=("CO2",), rtol=1e-9)[0][:, 0]
    np.testing.assert_allclose(down, 430.0 + (up[-1] - 430.0) * np.exp(-time / tau), atol=1e-3)


def stored_heat(t):
    """Heat above 273.15 K [J], with node capacities found from the response to a unit flow, not from the FMU."""
    s, h = np.sqrt(120.0), 3.0
    area = {"facade": 0.6 * s * h, "floor": 120.0, "ceiling": 120.0, "innWal": 3 * s * h}
    total = {"facade": 23600.8, "floor": 31244.4, "ceiling": 32622.2, "innWal": 26414.9}  # sums of the layers
    U = 1.2 * 150.0 * 1006.0 * (t.get("air.T")[0] - 273.15)
    U += 1.26e4 * 0.4 * s * h * np.sum(t.get("win.TOut", "win.TIn") - 273.15)
    for wall, A in area.items():
        # conduction matrix K/C of the interior: off-diagonal entries give the ratios of the capacities
        names = [f"{wall}.T[{i}]" for i in (1, 2, 3)]
        down = [t.derivative(f"der({names[i]})", names[i + 1]) for i in (0, 1)]  # G / C_i
        up = [t.derivative(f"der({names[i + 1]})", names[i]) for i in (0, 1)]  # G / C_{i+1}
        C = np.array([1.0, down[0] / up[0], down[0] / up[0] * down[1] / up[1]])
        C *= total[wall] * A / np.sum(C)
        U += np.sum(C * (t.get(*names) - 273.15))
    return U


@pytest.mark.slow
def test_heat_is_conserved_over_a_season(twin, weather):
    """Integral of all net flows over three weeks of smooth weather, controls and excitation active."""
    effects = {
        "effect.infiltration.cStack": 4e-4,
        "effect.bridge.UA": 8.0,
        "effect.adjacent.UA": 10.0,
        "effect.plug.Q": 150.0,
    }

    def season(time):
        day = time / 86400.0
        return weather(time) | {"excHea": 400.0 * np.sin(day), "excOut": 0.2 * np.sin(day / 3.3)}

    t = twin().start({k: float(v) for k, v in season(0.0).items()} | effects)
    before, stored_before = stored_heat(t), t.get("UStored")[0]
    time = np.arange(0.0, 20 * 86400.0 + 1, 5 * 86400.0)
    # a linear multistep method keeps linear balances exactly, so that a loose tolerance does
    _, integrals, events = t.run(time, season, integrals=FLOWS, rtol=1e-4)
    after = stored_heat(t)
    assert events > 30  # limiters were at work
    assert t.get("UStored")[0] - stored_before == pytest.approx(after - before, rel=1e-4)
    gains = integrals[FLOWS.index("QHea")] + integrals[FLOWS.index("QPeo")]
    assert gains > 6e8
    assert abs(np.sum(integrals) - (t.get("UStored")[0] - stored_before)) < 1e-6 * gains


def test_a_cooled_room_is_at_rest_where_the_controller_says_and_loses_what_is_cooled(twin):
    summer = WINTER | {"TDryBul": 303.15, "TSky": 293.15, "TSet": 295.15, "QCoo_max": 8000.0, "conCoo.k": 0.5}
    t = steady(twin, summer | {"conCoo.dSet": 1.5})
    T, Q = t.get("TRoo", "QHea")
    # proportional control, written down anew
    assert pytest.approx(-8000.0 * np.clip(0.5 * (T - 295.15 - 1.5), 0, 1), abs=1e-3) == Q
    assert -8000.0 < Q < -100.0
    assert np.sum(t.get(*FLOWS)) == pytest.approx(0.0, abs=1e-2)
    # in replay a measured power may be negative, and is limited by the cooler's size
    for given, acting in ((-1500.0, -1500.0), (-9000.0, -8000.0)):
        replayed = steady(twin, summer | {"replay": True, "QHea_in": given, "mOA_in": 0.1})
        assert replayed.get("QHea")[0] == acting
