"""The default FMU against textbook solutions: a table of what it should give, what it gives, and with finer walls.

    python tests/benchmarks/validation.py

Walls: decay of an insulated homogeneous slab, and the admittance of the default floor to swings of its surface, both
exact by the one-dimensional heat equation (for layers the matrices of ISO 13786). CO2: build-up and decay in a
ventilated volume, exact by the exponential. Builds the finer FMU, which needs the extra `dev`.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Model

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from datagen.driving.tables import Piecewise, merge  # noqa: E402
from datagen.simulating.simulator import Simulator  # noqa: E402
from fmus.build import build  # noqa: E402
from fmus.toolchain import native_platform  # noqa: E402
from shared.system import System, load_system  # noqa: E402

FINER = 9
R_SLAB, C_SLAB = 0.8, 2.4e5
SLAB = {f"floor.layer[{k}].{q}": 0.0 for k in range(1, 6) for q in "RC"}
SLAB |= {"floor.layer[3].R": R_SLAB, "floor.layer[3].C": C_SLAB}
MOLAR = 28.9647 / 44.0095


class Jacobian:
    """Partial derivatives of an instance, by names."""

    def __init__(self, fmu: Path, values: dict[str, float]) -> None:
        folder = fmpy.extract(str(fmu))
        description = fmpy.read_model_description(folder)
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.start = {v.name: v.start for v in description.modelVariables}
        self.model = FMU2Model(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.modelExchange.modelIdentifier,
            instanceName="validation",
        )
        self.model.instantiate()
        self.model.setReal([self.reference[name] for name in values], list(values.values()))
        self.model.setupExperiment(startTime=0.0)
        self.model.enterInitializationMode()
        self.model.exitInitializationMode()

    def of(self, unknown: str, known: str) -> float:
        """d unknown / d known."""
        pair = [self.reference[unknown]], [self.reference[known]]
        return float(self.model.getDirectionalDerivative(*pair, [1.0])[0])

    def conduction(self, wall: str, nodes: int) -> np.ndarray:
        """M of dT/dt = M T for conduction alone, (nodes, nodes) [1/s]."""
        names = [f"{wall}.T[{k + 1}]" for k in range(nodes)]
        found = np.zeros((nodes, nodes))
        for i in range(nodes):
            for j in (i - 1, i + 1):
                if 0 <= j < nodes:
                    found[i, j] = self.of(f"der({names[i]})", names[j])
            found[i, i] = -found[i].sum()
        return found

    def floor_capacity(self, nodes: int) -> float:
        """Areal capacity of the floor's surface node, from what the sun does to it [J/(m2.K)]."""
        tau, side = 1 - 0.15 - 0.5, np.sqrt(120.0)
        sun = 0.8 * tau * 0.4 * side * 3.0
        return sun / self.of(f"der(floor.T[{nodes}])", "HFac") / 120.0


def admittance(layers: list[tuple[float, float]], period: float) -> complex:
    """Heat flow into a layered slab with an adiabatic back per swing of its surface temperature [W/(m2.K)].

    ``layers`` are (R, C) from the back to the surface. ISO 13786: the matrices of homogeneous layers multiply.
    """
    omega = 2j * np.pi / period
    temperature, flow = 1.0 + 0j, 0.0 + 0j  # at the back: no flow
    for R, C in layers:
        root = np.sqrt(omega * R * C)
        temperature, flow = (
            np.cosh(root) * temperature + R * np.sinh(root) / root * flow,
            root / R * np.sinh(root) * temperature + np.cosh(root) * flow,
        )
    return complex(flow / temperature)


def discrete_admittance(M: np.ndarray, C: float, period: float) -> complex:
    """The same of a wall of nodes, whose last one has areal capacity ``C`` and takes the flow."""
    omega = 2j * np.pi / period
    unit = np.zeros(len(M))
    unit[-1] = 1.0 / C
    return complex(1.0 / np.linalg.solve(omega * np.eye(len(M)) - M, unit)[-1])


def co2(system: System) -> tuple[float, float]:
    """Largest error of build-up and of decay against the exponential [ppm], and the rise itself."""
    k, volume, flow, persons, outdoors = 9e-6, 150.0, 0.06, 10.0, 420.0
    leave, stop = 6 * 3600.0, 12 * 3600.0
    signals = {name: Piecewise.constant(0.0) for name in system.input_names}
    known = {"TDryBul": 283.15, "TSky": 273.15, "CO2Out": outdoors, "TSet": 294.15, "mOA_in": flow}
    signals |= {name: Piecewise.constant(value) for name, value in known.items()}
    signals["nPer"] = Piecewise(np.array([0.0, leave]), np.array([persons, 0.0]), "previous")
    values = {"gaiCO2.k": k, "roo.V": volume, "CO2_start": outdoors}
    table = merge(signals, 0.0, stop)
    made = Simulator(system).run(values, table, start=0.0, stop=stop, step=300.0, replay=True)
    rate, rise = flow / (1.2 * volume), k * persons / flow * MOLAR * 1e6
    peak = rise * (1 - np.exp(-rate * leave))
    late = np.maximum(made.time - leave, 0)
    exact = np.where(made.time <= leave, rise * (1 - np.exp(-rate * made.time)), peak * np.exp(-rate * late))
    got = made.outputs[system.output_names.index("CO2")] - outdoors
    return float(np.abs(got - exact).max()), float(peak)


def main() -> None:
    """Print the table."""
    system = load_system(ROOT / "fmus" / "MixedAirCO2")
    finer = build(Path(tempfile.mkdtemp()) / "finer.fmu", FINER, [native_platform()])
    sizes = {3: system.fmu_path, FINER: finer}
    print(f"| case | exact | 3 nodes | {FINER} nodes |\n|---|---|---|---|")
    rates = {}
    for nodes, fmu in sizes.items():
        M = Jacobian(fmu, SLAB).conduction("floor", nodes)
        rates[nodes] = np.sort(-np.linalg.eigvals(M).real)[1]
    exact = np.pi**2 / (R_SLAB * C_SLAB)
    cells = [f"{1 / r / 3600:.2f} h ({r / exact - 1:+.1%})" for r in rates.values()]
    print(f"| insulated slab, slowest decay | {1 / exact / 3600:.2f} h | {' | '.join(cells)} |")
    jacobians = {nodes: Jacobian(fmu, {}) for nodes, fmu in sizes.items()}
    start = jacobians[3].start
    layers = [tuple(float(start[f"floor.layer[{k}].{q}"]) for q in "RC") for k in (1, 2)]
    for period, name in ((86400.0, "daily"), (6 * 3600.0, "six-hour"), (3600.0, "hourly")):
        wanted = admittance(layers, period)
        cells = []
        for nodes, one in jacobians.items():
            found = discrete_admittance(one.conduction("floor", nodes), one.floor_capacity(nodes), period)
            shift = np.degrees(np.angle(found / wanted))
            cells.append(f"{abs(found):.3f} ({abs(found / wanted) - 1:+.1%}, {shift:+.1f} degree)")
        print(f"| floor, {name} admittance [W/(m2.K)] | {abs(wanted):.3f} | {' | '.join(cells)} |")
    worst, peak = co2(system)
    print(f"| CO2, build-up to {peak:.0f} ppm above outdoors and decay | exponential | within {worst:.1g} ppm | |")


if __name__ == "__main__":
    main()
