"""How often intervals of an estimator that reads facts cover: test rooms of its dataset, and rooms of other physics.

    python tests/benchmarks/any_room.py Room rooms
    python tests/benchmarks/any_room.py Room --reference FOLDER

A dataset's test rooms have one random week each. FOLDER holds systems.csv, weather.csv.gz and roomN.csv.gz of rooms
that the Buildings library simulated (weeks 2, 6, 10 ... of the year).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from datagen.driving.transposition import irradiance_on_plane
from shared.metrics import r2
from shared.signals import Weather
from shared.store import DatasetFolder
from shared.system import load_system
from trainer import load_run
from trainer.posterior.checkpoint import load_posterior
from trainer.posterior.inference import summarise
from trainer.reading.data import load_records
from trainer.reading.noise import Sensors

WEEK = 168
KNOWN = ("roo.AFlo", "roo.V")
COLUMNS = {
    **{"gaiCO2.k": "kCO2", "roo.AFlo": "AFlo", "roo.hRoo": "hRoo", "roo.V": "VRoo", "matExtWal.R": "RWal"},
    **{"glaSys.UFra": "UFra", "glaSys.absSolFra": "absSolFra", "mOut_flow": "mOut_flow"},
}
GIVEN = {
    **{"window.share": 0.4, "heater.size": 1e4, "person.heat": 120.0},
    **{"floor.mass": 2.1e5, "ceiling.mass": 9e4, "walls.mass": 4e4, "facade.mass": 7.5e4},
}
"""Of the reference rooms."""
CHICAGO = {"latitude": 41.98, "longitude": -87.92, "altitude": 201.0, "utc_offset": -6.0}


def of_dataset(folder: Path, encoding):
    """Windows, first stamps, parameters, given facts, and which rooms are disturbed."""
    dataset = DatasetFolder(folder)
    records = load_records(dataset, encoding.recorded)
    rows = records.of_split("test")
    starts = np.random.default_rng(1).integers(len(records.time) - WEEK + 1, size=len(rows))
    windows = np.stack([records.values[row][:, at : at + WEEK].T for row, at in zip(rows, starts, strict=True)])
    stamps = records.starts[rows] + records.time[starts]
    return windows, stamps, records.parameters[rows], records.given[rows], records.disturbances[rows] > 0


def reference_series(folder: Path):
    """Of each reference room its table and its series by the names of the default room."""
    weather = pd.read_csv(folder / "weather.csv.gz")
    sun = (weather[name].to_numpy() for name in ("dni_W_m2", "dhi_W_m2", "ghi_W_m2"))
    facade = irradiance_on_plane(Weather(files=["none"]), weather["time_s"].to_numpy(float), *sun, **CHICAGO)
    for room in range(len(pd.read_csv(folder / "systems.csv"))):
        read = pd.read_csv(folder / f"room{room + 1}.csv.gz")
        series = {"TRoo": read["TRoo_K"], "CO2": read["CO2_above_outdoor_ppm"] + 420.0, "QHea": read["QHea_W"]}
        series |= {"mOA": read["mOA_kg_s"], "TDryBul": weather["outdoor_temp_K"], "TSky": weather["sky_temp_K"]}
        yield read, series | {"winSpe": weather["wind_m_s"], "HFac": pd.Series(facade)}


def of_reference(folder: Path, encoding):
    """The same of the reference rooms; none is disturbed."""
    systems, windows, stamps, which = pd.read_csv(folder / "systems.csv"), [], [], []
    for room, (read, series) in enumerate(reference_series(folder)):
        count = min(len(read), len(series["TSky"]))
        columns = []
        for name in encoding.recorded:
            values = series[name].to_numpy()[:count]
            columns.append(0.5 * (values[1:] + values[:-1]) if name in ("QHea", "mOA") else values[1:])
        table = np.stack(columns, axis=1)
        for week in range(2, 51, 4):
            windows.append(table[week * WEEK : (week + 1) * WEEK])
            stamps.append(3600.0 * (week * WEEK + 1))
            which.append(room)
    truth = np.stack([systems[COLUMNS[name]].to_numpy(float) for name in encoding.parameters], axis=1)[which]
    given = np.tile([GIVEN[one.name] for one in encoding.given], (len(which), 1))
    return np.array(windows), np.array(stamps), truth, given, np.zeros(len(which), dtype=bool)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run")
    parser.add_argument("dataset", nargs="?", type=Path)
    parser.add_argument("--reference", type=Path)
    parser.add_argument("--samples", type=int, default=300)
    asked = parser.parse_args()
    torch.set_num_threads(1)
    run = load_run(asked.run)
    posterior, encoding = load_posterior(run), run.card.encoding
    assert posterior is not None, "expected a run with a posterior"
    system = load_system(run.card.system_name)
    source = of_reference(asked.reference, encoding) if asked.reference else of_dataset(asked.dataset, encoding)
    windows, stamps, truth, given, disturbed = source
    print(f"{len(windows)} windows, {disturbed.sum()} of disturbed rooms; parameters: {', '.join(encoding.parameters)}")
    print("readings | known | cover | calm | disturbed | mean R2 | R2 | widths over those with nothing known")
    generator = torch.Generator().manual_seed(2)
    for preset in ("none", "sensor"):
        sensors = Sensors(system, encoding.recorded, preset)
        readings = sensors(torch.from_numpy(windows.astype(np.float32)), generator).numpy()
        widths = None
        for label in ("nothing", "given facts", "given facts, area, volume"):
            facts = np.full((len(windows), len(encoding.facts)), np.nan)
            if label != "nothing":
                facts[:, len(encoding.facts) - len(encoding.given) :] = given
            known = KNOWN if label.endswith("volume") else ()
            for name in known:
                facts[:, encoding.facts.index(name)] = truth[:, encoding.parameters.index(name)]
            said = summarise(posterior.sample(readings, stamps, asked.samples, facts=facts))
            free = [k for k, name in enumerate(encoding.parameters) if name not in known]
            inside = ((truth >= said.low) & (truth <= said.high))[:, free]
            width = np.log(said.high / said.low)[:, free].mean(axis=0)
            whole = np.log(said.high / said.low).mean(axis=0)
            widths = whole if widths is None else widths
            parts = [inside.mean(), *(inside[one].mean() if one.any() else np.nan for one in (~disturbed, disturbed))]
            scores = r2(truth, said.mean)[free]
            score, each = scores.mean(), " ".join(f"{one:.2f}" for one in scores)
            ratio = " ".join(f"{w:.2f}" for w in width / widths[free])
            cover = " | ".join(f"{100 * one:.1f} %" for one in parts)
            print(f"{preset} | {label} | {cover} | {score:.2f} | {each} | {ratio}")


if __name__ == "__main__":
    main()
