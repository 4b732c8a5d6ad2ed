"""Diagnoses of simulated rooms whose log came through the import: sun on the horizontal, no sky temperature.

    python tests/benchmarks/imported_rooms.py --out OUT [--rooms 24] [--hours 336] [--seed 20261129]

Every other room has no effect: a gap that is answered there is a false alarm. The others have one of the candidates
that act by a parameter, twice its scale. Weeks lie anywhere in the year, constants are as uncertain as the description
says, and in every other pair of rooms nobody counted the occupants. What OUT has is not diagnosed again. With
``--calibrate`` the rooms without an effect are calibrated, and none is diagnosed.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

import datagen
from datagen.driving.inputs import system_weather
from diagnosis import calibrate, diagnose, import_recording, read_report
from shared.schema import methods_of
from shared.shipped import resolved
from shared.system import System, load_system

YEAR = 8760
SCALES = 2.0
COLUMNS = {"temp_air": "K", "wind_speed": "m/s", "ghi": "W/m2"}


def mapping(system: System, counted: bool) -> str:
    """Of a log whose columns are named as the description's variables and pvlib's weather."""
    names = {one.name: one.unit for one in system.outputs}
    names |= {one.name: one.unit for one in system.inputs if one.source == "occupancy" and counted}
    methods = methods_of(system)
    with (Path(__file__).parents[2] / "docs/example/mapping.toml").open("rb") as file:
        place = tomllib.load(file)["place"]
    lines = ["schema_version = 1", f'system = "{system.name}"']
    lines += ["[time]", 'column = "time"', 'zone = "-05:00"']
    lines += ["[place]", *(f"{name} = {value}" for name, value in place.items())]
    for name, unit in names.items():
        lines += [f"[variables.{name}]", f'column = "{name}"', f'unit = "{unit}"', "stuck_after = 1000.0"]
        lines += ['reading = "mean"'] if methods[name] == "mean" else []
    for name, unit in COLUMNS.items():
        lines += [f"[weather.{name}]", f'column = "{name}"', f'unit = "{unit}"', "stuck_after = 1000.0"]
    return "\n".join(lines)


def logged(system: System, seed: int, room: int, hours: int, folder: Path) -> tuple[Path, str]:
    """The recording of a room, and the name of its cause; "" where it has none."""
    rng = np.random.default_rng((seed, room))
    begin = int(rng.integers(0, YEAR - hours) // 24 * 24)
    causes = [one for one in system.effects if one.kind == "parameter"]
    cause = causes[rng.integers(len(causes))] if room % 2 else None
    given = {}
    if cause is not None:
        given = {
            name: min(SCALES * cause.scale, cause.upper) * per for name, per in cause.parameters.items()
        } | cause.constants
    simulated = datagen.simulate(
        system, parameters=given, seed=seed, index=room, hours=begin + hours, uncertain=True, excitation=False,
        noise="sensor",
    )  # fmt: skip
    some = slice(begin, begin + hours)
    after = np.arange(begin, begin + hours) + 1
    sky = system_weather(system, seed, room)
    names = [*system.output_names, *(one.name for one in system.inputs if one.source == "occupancy")]
    frame = {"time": pd.to_datetime("2001-01-01") + pd.to_timedelta(after, unit="h")}
    frame |= {name: simulated[name].values.ravel()[some] for name in names}
    frame |= {name: sky.values(name)[after] for name in COLUMNS}
    path = folder / f"{room:03}"
    pd.DataFrame(frame).to_csv(path.with_suffix(".csv"), index=False)
    path.with_suffix(".toml").write_text(mapping(system, counted=room % 4 < 2), encoding="utf-8")
    import_recording(path.with_suffix(".toml"), path.with_suffix(".csv"), out=path.with_suffix(".nc"))
    return path.with_suffix(".nc"), cause.name if cause else ""


def calibrated(system: System, asked: argparse.Namespace) -> None:
    """Print how far calibrations are off [prior standard deviations], how often their intervals cover, and the cost."""
    errors, covered, seconds, simulations = [], [], [], []
    for room in range(0, asked.rooms, 2):
        path, _ = logged(system, asked.seed, room, asked.hours, asked.out)
        drawn = datagen.simulate(system, seed=asked.seed, index=room, hours=24, uncertain=True, excitation=False)
        began = time.process_time()
        done = calibrate(system, path, run="MixedAirCO2", starts=1)
        seconds.append(time.process_time() - began)
        truth = {name: float(drawn[name]) for name in system.parameter_names}
        count, fit = len(truth), done.fit
        errors.append((fit.z - fit.problem.unknowns(truth))[:count])
        covered.append([one.low <= truth[one.name] <= one.high for one in done.report.parameters])
        simulations.append(fit.simulations)
        print(f"{room:03}: {sum(covered[-1])} of {count} intervals cover, {seconds[-1]:.0f} s", flush=True)
    print(f"off by {np.sqrt(np.mean(np.square(errors))):.2f}, {np.sum(covered)} of {np.size(covered)} intervals cover")
    print(f"in the median {np.median(simulations):.0f} simulations and {np.median(seconds):.1f} s of processor time")


def main() -> None:
    """Print what was answered of each room, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rooms", type=int, default=24)
    parser.add_argument("--hours", type=int, default=336)
    parser.add_argument("--seed", type=int, default=20261129)
    parser.add_argument("--calibrate", action="store_true")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    system = load_system(resolved("MixedAirCO2"))
    if asked.calibrate:
        calibrated(system, asked)
        return
    answers, right, seconds = {True: Counter(), False: Counter()}, 0, []
    for room in range(asked.rooms):
        path, cause = logged(system, asked.seed, room, asked.hours, asked.out)
        if not (asked.out / f"{room:03}" / "report.json").exists():
            diagnose(system, path, out=asked.out / f"{room:03}")
        report = read_report(asked.out / f"{room:03}" / "report.json")
        named = [one.name for one in report.effects if one.named]
        answers[bool(cause)][report.verdict] += 1
        right += bool(cause) and cause in named
        seconds.append(report.cpu_seconds)
        print(f"{room:03} {cause or 'none'}: {report.verdict} {named}, {report.cpu_seconds:.0f} s", flush=True)
    print(f"without a cause: {dict(answers[False])}; with one: {dict(answers[True])}, of which {right} name it")
    print(f"processor time {np.median(seconds):.0f} s in the median, {max(seconds):.0f} s at most")


if __name__ == "__main__":
    main()
