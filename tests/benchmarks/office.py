"""Does the valve's opening tell the air flow? A balance of the office's CO2 by least squares, without any simulator.

    python tests/benchmarks/office.py office-999169.csv [--before 2022-10-22]

The room's air, 75 m3, mixes at once; per quarter-hour it is renewed by a constant flow plus a share of what the valve's
opening promises (240 m3/h when open); presence adds CO2. Fitted to the room's sensor (soft L1 loss, scale 20 ppm): what
outdoor air would show, the emission while somebody is present, the constant flow, and the valve's share.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

VOLUME, LARGEST, HOURS = 75.0, 240.0, 0.25
"""[m3], [m3/h], [h]."""


def simulated(outdoors: float, emission: float, flow: np.ndarray, first: float, present: np.ndarray) -> np.ndarray:
    """CO2 (steps,) [ppm] for the flow of each step (steps,) [m3/h] and an emission [m3/h]."""
    made, now = np.empty(len(present)), first
    for k, (here, renewed) in enumerate(zip(present, flow, strict=True)):
        settled = outdoors + 1e6 * emission * here / renewed
        now = settled + (now - settled) * np.exp(-renewed * HOURS / VOLUME)
        made[k] = now
    return made


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--before", default="2022-10-22")
    options = parser.parse_args()
    data = pd.read_csv(options.file)
    data = data[data["timestamp"] < options.before]
    promised = LARGEST * data["bms_valve_frac__0"].ffill().bfill().to_numpy()
    present = data["bms_occupancy__bool"].ffill().fillna(0.0).to_numpy()
    measured = data["bms_co2__ppm"].to_numpy()
    seen = np.isfinite(measured)
    print("| valve | outdoors [ppm] | emission [m3/h] | constant flow [m3/h] | valve's share | rmse [ppm] |")
    print("|---|---|---|---|---|---|")
    for name, most in (("share fitted", 1.0), ("believed", None)):

        def residual(x: np.ndarray, most: float | None = most) -> np.ndarray:
            share = 1.0 if most is None else x[3]
            flow = np.exp(x[2]) + share * promised
            return (simulated(100 * x[0], np.exp(x[1]), flow, measured[seen][0], present) - measured)[seen]

        found = least_squares(
            lambda x, residual=residual: residual(x) / 20.0,
            [4.5, np.log(0.03), np.log(20.0), 0.5],
            bounds=([3.5, -9.0, -5.0, 0.0], [6.0, 0.0, 7.0, 1.0]),
            loss="soft_l1",
            max_nfev=60,
        ).x
        share = 1.0 if most is None else found[3]
        rmse = np.sqrt(np.mean(residual(found) ** 2))
        emission, flow = np.exp(found[1:3])
        print(f"| {name} | {100 * found[0]:.0f} | {emission:.3f} | {flow:.0f} | {share:.2f} | {rmse:.0f} |")


if __name__ == "__main__":
    main()
