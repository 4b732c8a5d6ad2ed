"""Diagnoses of rooms of other physics that have no effect: every gap that is answered is a false alarm.

    python tests/benchmarks/reference_rooms.py FOLDER --out OUT [--occupancy unknown]

FOLDER holds systems.csv, weather.csv.gz and roomN.csv.gz of rooms that the Buildings library simulated, with hourly
instants. The description is that of the default room with the library's constructions, which are uncertain by a third
as there. Weeks 3, 11, 19, 28, 37 and 46 of each room get the sensors' noise. The heater's readings of the hours in
which the set point jumps are left out. What OUT has is not diagnosed again.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from any_room import COLUMNS, WEEK, reference_series

from diagnosis import diagnose, read_report
from shared.shipped import resolved
from shared.system import System, load_system

WEEKS = (3, 11, 19, 28, 37, 46)
LAYERS = {
    "floor": [(6e4, 0.1), (1.5e5, 0.1)],
    "ceiling": [(3e4, 0.1), (6e4, 0.1)],
    "innWal": [(2e4, 0.1), (2e4, 0.1)],
    "facade": [(1.5e4, 1.0), (3e4, 1.0), (3e4, 1.0)],
}
"""Areal capacity [J/m2K] and resistance [m2K/W] of each layer; the facade's resistances are scaled by its parameter."""
JUMPS = (6, 22)
"""Hours at which the set point jumps: the instants are those after the jump."""


def description(folder: Path) -> System:
    """The default room's, with other constructions, instants in place of means, and no excitation."""
    default = load_system(resolved("MixedAirCO2"))
    fixed = ["[fixed]"]
    for name, layers in LAYERS.items():
        for k in range(5):
            capacity, resistance = layers[k] if k < len(layers) else (0.0, 0.0)
            fixed += [f'"{name}.layer[{k + 1}].C" = {capacity}', f'"{name}.layer[{k + 1}].R" = {resistance}']
    text = default.path.read_text(encoding="utf-8").replace("[fixed]\n", "\n".join(fixed) + "\n")
    text = text.replace("../MixedAirCO2.fmu", f"{default.fmu_path}").replace('wider = "Room"\n', "")
    text = text.replace('name = "MixedAirCO2"', 'name = "Reference"').replace('method = "mean"\n', "")
    text = text.replace('interpolation = "previous"', 'interpolation = "linear"')
    text = re.sub(r', "ceiling\.layer\[3\]\.[CR]"', "", text)
    text = re.sub(r'source = "excitation"\nexcitation = "\w+"', 'source = "constant"\nvalue = 0.0', text)
    text = re.sub(r"\[excitations\.\w+\]\ncomponents = \[\n(?:.*\n)*?\]\n", "", text)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "system.toml").write_text(text, encoding="utf-8")
    return load_system(folder / "system.toml")


def recordings(source: Path, folder: Path, system: System) -> dict[Path, int]:
    """A week each, and the number of its room."""
    rng, made = np.random.default_rng(20261128), {}
    for room, (read, series) in enumerate(reference_series(source)):
        for week in WEEKS:
            after = np.arange(week * WEEK, (week + 1) * WEEK) + 1
            units = {"units": "seconds since 2001-01-01 00:00:00"}
            data = xr.Dataset(coords={"time": ("time", 3600.0 * after, units)})
            for one in [*system.outputs, *system.inputs]:
                if one.name in series:
                    role = "output" if one in system.outputs else "input"
                    values = series[one.name].to_numpy(float)[after]
                    data[one.name] = ("time", values, {"units": one.unit, "role": role})
            for one in system.outputs:
                noise, values = one.noise["sensor"], data[one.name].values
                values += noise.sd * rng.standard_normal(WEEK)
                if noise.quantum:
                    values[:] = np.round(values / noise.quantum) * noise.quantum
                values[rng.random(WEEK) < noise.dropout] = np.nan
            data["QHea"].values[np.isin(after % 24, JUMPS)] = np.nan
            data["nPer"] = ("time", read["persons"].to_numpy(float)[after - 1], {"units": "1", "role": "input"})
            data["CO2Out"] = ("time", np.full(WEEK, 420.0), {"units": "ppm", "role": "input"})
            path = folder / f"room{room + 1}-week{week:02}.nc"
            data.to_netcdf(path, format="NETCDF3_64BIT", engine="scipy")
            made[path] = room
    return made


def main() -> None:
    """Print what was answered, and how many intervals of parameters cover."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--occupancy", choices=["measured", "unknown"], default="measured")
    asked = parser.parse_args()
    system = description(asked.out)
    truth = pd.read_csv(asked.folder / "systems.csv")
    verdicts, covered, seconds = Counter(), {name: [] for name in system.parameter_names}, []
    for path, room in recordings(asked.folder, asked.out, system).items():
        place = asked.out / f"{path.stem}-{asked.occupancy}"
        if not (place / "report.json").exists():
            diagnose(system, path, occupancy=asked.occupancy, out=place)
        report = read_report(place / "report.json")
        verdicts[report.verdict] += 1
        seconds.append(report.cpu_seconds)
        for one in report.parameters:
            true = truth[COLUMNS[one.name]][room]
            covered[one.name].append(one.before_low <= true <= one.before_high)
        print(f"{path.stem}: {report.verdict}, {report.cpu_seconds:.0f} s", flush=True)
    print(dict(verdicts), f"processor time {np.median(seconds):.0f} s in the median, {max(seconds):.0f} s at most")
    for name, hits in covered.items():
        print(f"{name}: {sum(hits)} of {len(hits)} intervals cover")
    print(f"all: {sum(map(sum, covered.values()))} of {sum(map(len, covered.values()))}")


if __name__ == "__main__":
    main()
