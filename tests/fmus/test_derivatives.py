"""Directional derivatives of the FMU."""

import numpy as np
import pytest

OUTPUTS = ("TRoo", "CO2", "QHea", "mOA")


def test_directional_derivatives_against_differences(twin):
    """Whole Jacobian of derivatives and outputs to states and inputs, at a state where everything is active."""
    rng = np.random.default_rng(11)
    t = twin().start({"mOut_flow": 0.06, "effect.infiltration.cStack": 1e-3, "effect.infiltration.cWind": 2e-3})
    x = rng.normal(292, 3, t.n)
    x[1], x[-2:] = 1.8e-3, (0.1, 0.3)
    t.set(TDryBul=274.0, TSky=260.0, winSpe=3.3, HFac=310.0, CO2Out=420.0, nPer=9.0, TSet=x[0] + 0.5)
    t.x = x
    t.event()
    assert np.all(t.z > 0)
    inputs = ["TDryBul", "TSky", "winSpe", "HFac", "CO2Out", "nPer", "TSet", "excHea", "excOut"]
    unknowns = [f"der({s})" for s in t.states] + list(OUTPUTS) + ["TMRT", "QWinOut"]
    knowns = t.states + inputs
    J = np.array([[t.derivative(u, k) for k in knowns] for u in unknowns])

    def value(known, v):
        if known in t.states:
            y = x.copy()
            y[t.states.index(known)] = v
            t.x = y
        else:
            t.set_all({known: v})
        return t.get(*unknowns)

    for j, known in enumerate(knowns):
        v = t.get(known)[0]
        step = {"air.X": 1e-5, "conCO2.xI": 1e-2, "conHea.xI": 1e-2}.get(known, 2e-3 * max(1.0, abs(v) / 300))
        estimates = [(value(known, v + h) - value(known, v - h)) / (2 * h) for h in (step, step / 2)]
        value(known, v)
        reference = (4 * estimates[1] - estimates[0]) / 3  # Richardson
        scale = np.abs(reference) + 1e-9 * np.max(np.abs(reference))
        assert np.all(np.abs(J[:, j] - reference) <= 2e-6 * scale + 1e-14), known
    # entries known in closed form
    assert J[unknowns.index("QHea"), knowns.index("TSet")] == pytest.approx(2500.0, rel=1e-9)
    assert J[unknowns.index("CO2"), knowns.index("air.X")] == pytest.approx(28.9647 / 44.0095 * 1e6, rel=1e-9)
    assert J[unknowns.index("der(air.X)"), knowns.index("nPer")] == pytest.approx(9e-6 / 180.0, rel=1e-9)
    # and what does not depend is exactly zero
    assert J[unknowns.index("der(facade.T[1])"), knowns.index("TSet")] == 0.0
