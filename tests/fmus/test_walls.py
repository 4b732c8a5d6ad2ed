"""Conduction in the walls: against the analytic slab, and against finer walls."""

import numpy as np
import pytest

R, C = 0.8, 2.4e5  # a homogeneous floor [m2.K/W], [J/(m2.K)]


def conduction_matrix(t, wall, n):
    """Matrix of dT/dt = M T for conduction alone, from the off-diagonal derivatives of the FMU."""
    names = [f"{wall}.T[{i + 1}]" for i in range(n)]
    M = np.zeros((n, n))
    for i in range(n):
        for j in (i - 1, i + 1):
            if 0 <= j < n:
                M[i, j] = t.derivative(f"der({names[i]})", names[j])
        M[i, i] = -np.sum(M[i])
    return M


def slab(t):
    values = {f"floor.layer[{i}].{q}": 0.0 for i in range(1, 6) for q in "RC"}
    for i, share in enumerate((0.3, 0.5, 0.2), start=2):  # three layers of one material, in the middle
        values[f"floor.layer[{i}].R"], values[f"floor.layer[{i}].C"] = share * R, share * C
    return t.start(values)


def test_insulated_slab_decays_at_the_analytic_rates(twin, build_fmu, unpack_fmu):
    """Both surfaces adiabatic: rates (k pi)^2 / (R C); the error of lumped elements falls with the square of N."""
    errors = {}
    for n in (3, 9, 17):
        t = slab(twin(unpack_fmu(build_fmu(n))))
        rates = np.sort(-np.linalg.eigvals(conduction_matrix(t, "floor", n)).real)
        assert abs(rates[0]) < 1e-12 * rates[1]  # heat is conserved
        exact = (np.arange(n) * np.pi) ** 2 / (R * C)
        errors[n] = abs(rates[1] / exact[1] - 1)
        if n > 3:
            assert abs(rates[2] / exact[2] - 1) < 0.06
    assert errors[3] < 0.2
    assert errors[9] < 0.014
    assert errors[9] / errors[17] == pytest.approx(4.0, rel=0.05)


def test_resistance_of_the_facade_is_the_parameter(twin):
    """Layers only give shares: the steady flux through the facade is dT / matExtWal.R."""
    for resistance in (0.5, 3.0):
        values = {"matExtWal.R": resistance, "TDryBul": 265.0, "replay": True, "QHea_in": 2000.0, "HFac": 0.0}
        t = twin().start(values)
        t.run(np.array([0.0, 60 * 86400.0]), rtol=1e-10)
        dT = np.subtract(*t.get("facade.T[3]", "facade.T[1]"))
        A = 0.6 * 3.0 * np.sqrt(120.0)
        assert t.get("QFacOut")[0] == pytest.approx(-A * dT / resistance, rel=1e-6)
        assert t.get("QFacRoo")[0] == pytest.approx(-A * dT / resistance, rel=1e-6)
