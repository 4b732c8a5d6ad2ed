"""The FMU against an implementation of EQUATIONS.md that shares no code with it."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

SIGMA = 5.670374419e-8
LAYERS = {  # areal capacity [J/(m2.K)] and resistance [m2.K/W], far side first
    "facade": ([2752.5, 8298.2, 12550.1], [1.545e-5, 0.10583, 2.82979]),
    "floor": ([18829.8, 12414.6], [0.126667, 0.158333]),
    "ceiling": ([6207.3, 12550.1, 13864.8], [0.0791667, 2.82979, 0.0935294]),
    "innWal": ([12550.1, 13864.8], [2.82979, 0.0935294]),
}
BASE = {
    "gaiCO2.k": 9e-6, "roo.AFlo": 120.0, "roo.hRoo": 3.0, "roo.V": 150.0, "matExtWal.R": 1.5,
    "glaSys.UFra": 2.0, "glaSys.absSolFra": 0.5, "mOut_flow": 0.15, "conCO2.yMax": 10.0,
    "effect.infiltration.m0": 0.0, "effect.infiltration.cWind": 0.0, "effect.infiltration.cStack": 0.0,
    "effect.bridge.UA": 0.0, "effect.adjacent.UA": 0.0, "effect.adjacent.T": 293.15, "effect.furniture.C": 0.0,
    "effect.plug.Q": 0.0, "effect.shading.fra": 0.0, "effect.heater.derate": 0.0, "effect.mixing.bypass": 0.0,
    "effect.window.m0": 0.0, "effect.window.cStack": 0.0, "effect.timetable.Q": 0.0, "effect.shutdown.fra": 0.0,
    "effect.blinds.fra": 0.0, "effect.valve.Q": 0.0, "fraRadHea": 0.0,
}  # fmt: skip


def spread(C, R):
    """Node capacities [J/(m2.K)] of three nodes: the hat functions integrated numerically over each layer."""
    edges = np.concatenate([[0.0], np.cumsum(R)]) / np.sum(R)
    hat = [lambda x: max(0.0, 1 - 2 * x), lambda x: 1 - abs(2 * x - 1), lambda x: max(0.0, 2 * x - 1)]
    out = np.zeros(3)
    for c, a, b in zip(C, edges[:-1], edges[1:], strict=True):
        x = a + (b - a) * (np.arange(20000) + 0.5) / 20000
        out += [c * np.mean([h(xi) for xi in x]) for h in hat]
    return out


NODE_C = {name: spread(*layers) for name, layers in LAYERS.items()}


class Room:
    """Right-hand side with real limiters (no modes), nothing rounded off, walls as matrices."""

    def __init__(self, parameters):
        p = self.p = BASE | parameters
        s, h = np.sqrt(p["roo.AFlo"]), p["roo.hRoo"]
        self.A_win = 0.4 * s * h
        A = {"facade": 0.6 * s * h, "floor": s * s, "ceiling": s * s, "innWal": 3 * s * h}
        self.A = np.array([A["facade"], self.A_win, s * s, s * s, 3 * s * h])  # facade, window, floor, ceiling, inner
        self.walls = {}
        for name, area in A.items():
            R = p["matExtWal.R"] if name == "facade" else sum(LAYERS[name][1])
            K = 2 / R * np.array([[-1, 1, 0], [1, -2, 1], [0, 1, -1]])
            self.walls[name] = (K / NODE_C[name][:, None], NODE_C[name] * area)
        self.C_pane = 1.26e4 * self.A_win
        self.G_win = self.A_win / (1 / p["glaSys.UFra"] - 0.17)
        self.m_air = 1.2 * p["roo.V"]
        self.C_air = self.m_air * 1006 + p["effect.furniture.C"]
        self.wind = 2.537 * 0.75 * np.sqrt(2 * (s + h) / (s * h))

    def controls(self, T, ppm, I_co2, I_hea, u):
        p = self.p
        e = (ppm - u["CO2Out"] - 700.0) / 700.0
        w = 5.0 * (e + I_co2)
        y = np.clip(w, 0.0, p["conCO2.yMax"])
        m = max(0.0, p["mOut_flow"] * (1 + y) + u["excOut"]) * (1 - p["effect.shutdown.fra"] * u["yOff"])
        dI_co2 = (e + (y - w) / (5.0 * 0.9)) / 120.0
        e = u["TSet"] - T
        w = 0.25 * (e + I_hea)
        y = np.clip(w, 0.0, 1.0)
        Q = max(0.0, 1e4 * (1 - p["effect.heater.derate"]) * y + u["excHea"]) + p["effect.valve.Q"]
        return m, Q, dI_co2, (e + (y - w) / (0.25 * 0.9)) / 14400.0

    def __call__(self, x, u):
        """Derivatives, and the outputs [K, ppm, W, kg/s]."""
        p = self.p
        T, X, fac, flo, cei, inn = x[0], x[1], x[2:5], x[5:8], x[8:11], x[11:14]
        T_po, T_pi, I_co2, I_hea = x[14:]
        ppm = X * 28.9647 / 44.0095 * 1e6
        m, Q, dI_co2, dI_hea = self.controls(T, ppm, I_co2, I_hea, u)
        surface = np.array([fac[2], T_pi, flo[2], cei[2], inn[2]])
        d = surface - T
        c = np.array([1.31, 1.31, 1.51 if d[2] > 0 else 0.76, 1.51 if d[3] < 0 else 0.76, 1.31])
        convection = self.A * c * np.abs(d) ** (1 / 3) * d
        hr = 4 * 0.9 * SIGMA * 293.15**3
        Q_rad = 48.0 * u["nPer"] + p["fraRadHea"] * Q
        T_mrt = np.sum(self.A * surface) / np.sum(self.A) + Q_rad / (hr * np.sum(self.A))
        into = -convection - hr * self.A * (surface - T_mrt)
        H = u["HFac"] * (1 - p["effect.shading.fra"]) * (1 - p["effect.blinds.fra"] * u["ySha"])
        tau = (0.85 - p["glaSys.absSolFra"]) * self.A_win * H
        into[2] += 0.8 * tau
        into[3:] += 0.2 * tau * self.A[3:] / np.sum(self.A[3:])
        env = 0.5 * u["TSky"] ** 4 + 0.5 * u["TDryBul"] ** 4

        def outside(T_s, area, roughness):
            dT = u["TDryBul"] - T_s
            h = 1.31 * np.abs(dT) ** (1 / 3) + roughness * self.wind * np.sqrt(u["winSpe"])
            return area * (h * dT + 0.9 * SIGMA * (env - T_s**4))

        absorbed = 0.5 * p["glaSys.absSolFra"] * self.A_win * H
        far = {"facade": outside(fac[0], self.A[0], 1.52) + 0.6 * self.A[0] * H, "floor": 0, "ceiling": 0, "innWal": 0}
        dx = np.zeros(18)
        for i, (name, node) in enumerate(zip(self.walls, (fac, flo, cei, inn), strict=True)):
            K, C = self.walls[name]
            dx[2 + 3 * i : 5 + 3 * i] = K @ node
            dx[2 + 3 * i] += far[name] / C[0]
            dx[4 + 3 * i] += into[(0, 2, 3, 4)[i]] / C[2]
        across = self.G_win * (T_po - T_pi)
        dx[14] = (outside(T_po, self.A_win, 1.0) + absorbed - across) / self.C_pane
        dx[15] = (across + absorbed + into[1]) / self.C_pane
        m_inf = p["effect.infiltration.m0"] + p["effect.infiltration.cWind"] * u["winSpe"]
        m_inf += p["effect.infiltration.cStack"] * (np.hypot(T - u["TDryBul"], 0.01) - 0.01)
        stack = np.hypot(T - u["TDryBul"], 0.01) - 0.01
        m_inf += u["yWin"] * (p["effect.window.m0"] + p["effect.window.cStack"] * stack)
        m_mix = (1 - p["effect.mixing.bypass"]) * m + m_inf
        Q_air = np.sum(convection) + m_mix * 1006 * (u["TDryBul"] - T) + 48.0 * u["nPer"] + (1 - p["fraRadHea"]) * Q
        Q_air += p["effect.plug.Q"] + p["effect.timetable.Q"] * u["yPlu"]
        Q_air += p["effect.bridge.UA"] * (u["TDryBul"] - T)
        Q_air += p["effect.adjacent.UA"] * (p["effect.adjacent.T"] - T)
        dx[0] = Q_air / self.C_air
        X_out = u["CO2Out"] * 1e-6 * 44.0095 / 28.9647
        dx[1] = (m_mix * (X_out - X) + p["gaiCO2.k"] * u["nPer"]) / self.m_air
        dx[16:] = dI_co2, dI_hea
        return dx, np.array([T, ppm, Q, m])

    def simulate(self, t, inputs):
        """Outputs at t [s], inputs held over each interval."""
        x = np.full(18, 293.15)
        x[1], x[16:] = 400e-6 * 44.0095 / 28.9647, 0.0
        atol = np.full(18, 1e-7)
        atol[1] = 1e-12
        rows = []
        for k, (a, b) in enumerate(itertools.pairwise(t)):
            u = {name: values[k] for name, values in inputs.items()}
            rows.append(self(x, u)[1])
            s = solve_ivp(lambda _, y, u=u: self(y, u)[0], (a, b), x, "LSODA", rtol=1e-9, atol=atol)
            assert s.success, s.message
            x = s.y[:, -1]
        rows.append(self(x, {name: values[-1] for name, values in inputs.items()})[1])
        return np.array(rows)


def scenario(days, seed=0):
    """Hourly constant inputs that drive every limiter and clamp to its ends."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, days * 86400.0 + 1, 3600.0)
    hour, n = t / 3600.0 % 24, len(t)
    occupied = (hour >= 8) & (hour < 17)
    return t, {
        "TDryBul": 273.15 + 8 * np.sin(2 * np.pi * (hour - 9) / 24) + rng.normal(0, 1.5, n),
        "TSky": 262.0 + rng.normal(0, 5, n),
        "winSpe": rng.gamma(2.0, 1.5, n),
        "HFac": np.maximum(0, 700 * np.sin(2 * np.pi * (hour - 6) / 24)) * rng.uniform(0.1, 1, n),
        "CO2Out": rng.uniform(400, 450, n),
        "nPer": np.where(occupied, rng.integers(5, 25, n), 0.0),
        "TSet": np.where((hour >= 6) & (hour < 22), 294.15, 289.15),
        "excHea": rng.normal(0, 800, n),
        "excOut": rng.normal(0, 0.05, n),
        "yWin": rng.uniform(0, 1, n),
        "yPlu": rng.uniform(0, 1, n),
        "yOff": np.where((hour < 6) | (hour >= 22), 1.0, 0.0),
        "ySha": rng.uniform(0, 1, n),
    }


CASES = {
    "saturating": {"mOut_flow": 0.06, "conCO2.yMax": 1.0, "roo.AFlo": 200.0, "matExtWal.R": 0.5, "glaSys.UFra": 3.0},
    "corner": {
        "gaiCO2.k": 1.2e-5, "roo.AFlo": 60.0, "roo.hRoo": 4.0, "roo.V": 300.0, "matExtWal.R": 3.0,
        "glaSys.UFra": 1.0, "glaSys.absSolFra": 0.3, "mOut_flow": 0.05,
    },
    "effects": {
        "effect.infiltration.m0": 0.01, "effect.infiltration.cWind": 0.004, "effect.infiltration.cStack": 0.001,
        "effect.bridge.UA": 25.0, "effect.adjacent.UA": 40.0, "effect.adjacent.T": 288.15,
        "effect.furniture.C": 6e5, "effect.plug.Q": 350.0, "effect.shading.fra": 0.3,
        "effect.heater.derate": 0.4, "effect.mixing.bypass": 0.2, "fraRadHea": 0.3,
        "effect.window.m0": 0.05, "effect.window.cStack": 0.004, "effect.timetable.Q": 600.0,
        "effect.shutdown.fra": 0.8, "effect.blinds.fra": 0.7, "effect.valve.Q": 150.0,
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def saturating():
    """Times, inputs and outputs of three days in which every limit is reached."""
    t, inputs = scenario(3)
    return t, inputs, Room(CASES["saturating"]).simulate(t, inputs)


@pytest.mark.parametrize("case", ["saturating", "effects"])
def test_trajectory_agrees_with_an_independent_implementation(case, simulate, saturating):
    t, inputs, ours = saturating
    if case != "saturating":
        ours = Room(CASES[case]).simulate(t, inputs)
    fmu = simulate(t, inputs, CASES[case], rtol=1e-9)
    # fmpy records QHea and mOA at a knot before the inputs change there: not compared at the knots themselves
    assert np.max(np.abs(fmu[:, 0] - ours[:, 0])) < 1e-3
    assert np.max(np.abs(fmu[:, 1] - ours[:, 1])) < 0.1


def test_the_scenario_reaches_every_limit(saturating):
    _, inputs, out = saturating
    base = 0.06 + inputs["excOut"]
    m, Q = out[:, 3], out[:, 2]
    assert np.any(m == 0.0)
    assert np.any(np.isclose(m, base))  # lower limit of the CO2 controller
    assert np.any(np.isclose(m, base + 0.06))  # its upper limit
    assert np.any(Q == 0.0)
    assert np.any(np.isclose(Q, 1e4 + inputs["excHea"]))
    assert np.any((inputs["excHea"] > 0) & np.isclose(Q, inputs["excHea"]))  # lower limit of the heating controller


@pytest.mark.parametrize("case", CASES)
def test_derivatives_agree_at_random_states(case, twin):
    """Pointwise, with the modes settled for each point."""
    rng = np.random.default_rng(7)
    room, t = Room(CASES[case]), twin().start(CASES[case])
    for _ in range(100):
        x = rng.normal(293, 8, 18)
        x[1], x[16:] = rng.uniform(4e-4, 3e-3), rng.normal(0, 1.0, 2)
        u = {
            "TDryBul": rng.normal(280, 10), "TSky": rng.normal(265, 10), "winSpe": rng.uniform(0.5, 9),
            "HFac": rng.uniform(0, 800), "CO2Out": 420.0, "nPer": rng.uniform(0, 20), "TSet": 294.15,
            "excHea": rng.normal(0, 2000), "excOut": rng.normal(0, 0.2),
            "yWin": rng.uniform(), "yPlu": rng.uniform(), "yOff": rng.uniform(), "ySha": rng.uniform(),
        }  # fmt: skip
        t.set_all(u)
        t.x = x
        t.event()
        dx, y = room(x, u)
        allowed = np.full(18, 1e-6)  # [K/s]: what rounding off |d| and sqrt(v) makes
        allowed[1], allowed[16:] = 1e-15, 1e-12
        assert np.all(np.abs(t.dx - dx) < allowed + 1e-5 * np.abs(dx))
        np.testing.assert_allclose(t.get("TRoo", "CO2", "QHea", "mOA"), y, rtol=1e-9, atol=1e-12)
