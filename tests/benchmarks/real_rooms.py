"""Recordings of real rooms through every command: what is kept, how soon and what it answers, how well it forecasts.

    python tests/benchmarks/real_rooms.py FOLDER --out OUT [--minutes 8]

FOLDER has a folder a room, each with ``log.csv``, ``mapping.toml`` (it names a system description) and ``room.toml``:

    title = "Office, 25 m2"
    context = 168.0             # [h] calibrated and diagnosed
    ahead = 168.0               # [h] forecast after it
    [known]                     # parameters that a plan tells, by name
    "roo.V" = 75.0
    [greybox]                   # variables of the recording; all but the first four may be left out
    temperature = "TRoo"
    co2 = "CO2"
    outdoors = "TDryBul"
    volume = 75.0               # [m3]
    sun = "HFac"
    persons = "nPer"
    outdoor_co2 = "CO2Out"
    flow = "mOA_in"             # [kg/s]
    heat = ["QHea_in"]          # [W], added up

Context and forecast are of the longest stretch without gaps in the inputs. Calibration and diagnosis are told to end
within half of ``--minutes``. Of a shorter stretch 60 % (to whole days) are context and the rest is forecast. Ahead, the
forecast and the grey-box model (``greybox.py``, fitted to the context) get the same measured inputs. *Day before*
repeats the context's last 24 hours, *week before* its last 168. A command that fails or runs out of time leaves its
sentence under the table.
Writes ``rooms.md``, ``rooms.json`` and each command's words to OUT.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import greybox
import numpy as np
import pandas as pd
import xarray as xr

from shared.stretches import stretches

HOUR, DAY, WEEK = 3600.0, 24, 168
SHIPPED = "MixedAirCO2"
"""The system whose estimator comes with the package."""
BIN = Path(sys.executable).parent


@dataclass
class Room:
    """A room's folder, where its results go, and what has been found."""

    source: Path
    out: Path
    minutes: float
    about: dict[str, Any]
    row: dict[str, Any] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)

    def command(self, step: str, words: list[str]) -> str | None:
        """What a command printed on standard output; its times go to the row, a failure's sentence to the failures."""
        began, worked = time.monotonic(), processor_time()
        child = subprocess.Popen(
            [str(BIN / words[0]), *words[1:]], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            cwd=self.source, start_new_session=True, env={**os.environ, "COLUMNS": "200", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        late = False
        try:
            printed, errors = child.communicate(timeout=60 * self.minutes)
        except subprocess.TimeoutExpired:
            late = True
            os.killpg(child.pid, signal.SIGTERM)
            printed, errors = child.communicate()
        self.row[f"{step}_s"] = round(time.monotonic() - began, 1)
        self.row[f"{step}_cpu_s"] = round(processor_time() - worked, 1)
        (self.out / f"{step}.txt").write_text(f"$ {shlex.join(words)}\n{printed}\n{errors}")
        if child.returncode in (0, 3) and not late:
            return printed
        said = [line.strip() for line in errors.splitlines() if line.strip()] or ["nothing"]
        if late:
            stages = [line for line in said if not line.startswith("warning")] or said
            self.failures[step] = f"no answer after {self.minutes:g} min; the last stage was: {stages[-1]}"
        else:
            self.failures[step] = next((line for line in reversed(said) if line.startswith("error")), said[-1])
        return None


def processor_time() -> float:
    """Of all commands that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measured_hours(room: Room, outputs: list[str]) -> int:
    """Hours of the log in which each output has a reading."""
    mapping = tomllib.loads((room.source / "mapping.toml").read_text())
    columns = [mapping["variables"][name]["column"] for name in outputs if name in mapping["variables"]]
    log = pd.read_csv(room.source / "log.csv", usecols=[mapping["time"]["column"], *columns])
    stamps = pd.to_datetime(log[mapping["time"]["column"]], utc=True, format="mixed")
    return int(log[columns].notna().groupby(stamps.dt.floor("h")).any().all(axis=1).sum())


def imported(room: Room) -> xr.Dataset | None:
    """The recording, once by the room's own description; how much of what was measured it keeps."""
    path = room.out / "recording.nc"
    if room.command("import", ["diagnosis", "import", "mapping.toml", "log.csv", "--out", str(path), "--json"]) is None:
        return None
    with xr.open_dataset(path) as opened:
        data = opened.load()
    names = [room.about["greybox"]["temperature"], room.about["greybox"]["co2"]]
    step = float(np.diff(data["time"].values[:2])[0] / np.timedelta64(1, "s"))
    read = np.isfinite(np.stack([data[name].values for name in names])).all(axis=0)
    inputs = [one for one in data.data_vars if data[one].attrs.get("role") == "input"]
    whole = np.all([np.isfinite(data[one].values) for one in inputs], axis=0) & np.ones(len(read), dtype=bool)
    found = stretches(whole, step)
    kept = sum(int(read[a:b].sum()) for a, b in found) * step / HOUR
    first, after = max(found, key=lambda one: one[1] - one[0], default=(0, len(read)))
    data = data.isel(time=slice(first, after))
    length = data.sizes["time"] * step / HOUR
    context = min(room.about["context"], DAY * round(0.6 * length / DAY))
    ahead = min(room.about["ahead"], length - context)
    room.row |= {
        "measured_h": measured_hours(room, names), "kept_h": round(float(kept)), "step_s": step,
        "stretches": len(found),
        "context_h": context, "ahead_h": ahead,
    }  # fmt: skip
    if context < DAY:
        room.failures["context"] = f"the recording has {length:g} h; a context of a day or more needs 40"
        return None
    opened.close()
    data.to_netcdf(room.out / "longest.nc")
    data.isel(time=slice(0, round(context * HOUR / step))).to_netcdf(room.out / "context.nc")
    return data


def predicted(room: Room) -> None:
    """The shipped estimator's intervals; it reads recordings that were imported by its own description."""
    path = room.out / "shipped.nc"
    words = ["diagnosis", "import", "mapping.toml", "log.csv", "--system", SHIPPED, "--out", str(path)]
    if room.command("import_shipped", words) is None:
        return
    told = room.command("predict", ["trainer", "predict", SHIPPED, str(path), "--json"])
    if told is not None:
        parameters = json.loads(told)["predictions"][0]["parameters"]
        held(room, "predict", {name: (one.get("low"), one.get("high")) for name, one in parameters.items()})


def held(room: Room, step: str, intervals: dict[str, tuple[float | None, float | None]]) -> None:
    """Which of the known parameters lie within their 90 % intervals."""
    inside = {}
    for name, value in room.about.get("known", {}).items():
        low, high = intervals.get(name, (None, None))
        if low is not None and high is not None:
            inside[name] = bool(low <= value <= high)
    room.row[f"{step}_known"] = inside


def calibrated(room: Room, system: str) -> bool:
    """Calibrate on the context."""
    out = room.out / "calibration"
    words = ["diagnosis", "calibrate", system, str(room.out / "context.nc"), "--out", str(out)]
    if room.command("calibrate", [*words, "--minutes", f"{room.minutes / 2:g}"]) is None:
        return False
    report = json.loads((out / "calibration.json").read_text())
    held(room, "calibrate", {one["name"]: (one["low"], one["high"]) for one in report["parameters"]})
    told = {name: one["explained"] for name, one in report["outputs"].items() if one["used"]}
    room.row["explained"] = {name: None if share is None else max(share, 0.0) for name, share in told.items()}
    room.row["at_bound"] = [one["name"] for one in report["parameters"] if one["at_bound"]]
    return True


def forecast(room: Room, system: str) -> None:
    """Forecast what comes after the context with the calibration's parameters."""
    hours = ["--context", f"{room.row['context_h']:g}", "--ahead", f"{room.row['ahead_h']:g}"]
    out = room.out / "forecast"
    words = ["diagnosis", "forecast", system, str(room.out / "longest.nc"), *hours, "--out", str(out)]
    if room.command("forecast", [*words, "--calibration", str(room.out / "calibration")]) is None:
        return
    report = json.loads((out / "forecast.json").read_text())
    room.row["forecast_rmse"] = {name: one["rmse"] for name, one in report["outputs"].items() if one}
    room.row["forecast_covered"] = {name: one["covered"] for name, one in report["outputs"].items() if one}


def diagnosed(room: Room, system: str) -> None:
    """Diagnose the context."""
    out = room.out / "answer"
    words = ["diagnosis", "run", system, str(room.out / "context.nc"), "--out", str(out)]
    told = room.command("run", [*words, "--minutes", f"{room.minutes / 2:g}"])
    if told is None:
        return
    report = json.loads((out / "report.json").read_text())
    room.row["verdict"], room.row["summary"] = report["verdict"], report["summary"]
    room.row["named"] = [one["name"] for one in report.get("effects", []) if one.get("named")]
    room.row["first_answer_min"] = round((room.row["import_s"] + room.row["run_s"]) / 60, 1)


def step_means(data: xr.Dataset, name: str | None) -> np.ndarray:
    """An input's mean over each step: what is an instant at the steps' ends is joined by straight lines."""
    if not name or name not in data:
        return np.zeros(data.sizes["time"])
    values = data[name].values.astype(float)
    if "mean" in data[name].attrs.get("cell_methods", ""):
        return values
    return (values + np.concatenate([values[:1], values[:-1]])) / 2


def baselines(room: Room, data: xr.Dataset) -> None:
    """RMSE ahead of the grey-box model, of the day before and of the week before."""
    roles, row = room.about["greybox"], room.row
    names = [roles["temperature"], roles["co2"]]
    split, end = (
        round(hours * HOUR / row["step_s"]) for hours in (row["context_h"], row["context_h"] + row["ahead_h"])
    )
    read = np.stack([data[name].values.astype(float) for name in names])[:, :end]
    heat = sum((step_means(data, name) for name in roles.get("heat", [])), np.zeros(data.sizes["time"]))
    outdoor_co2 = step_means(data, roles.get("outdoor_co2")) if roles.get("outdoor_co2") else np.full(heat.shape, 420.0)
    series = [
        *(step_means(data, roles.get(name)) for name in ("outdoors", "sun")), heat,
        *(step_means(data, roles.get(name)) for name in ("flow", "persons")), outdoor_co2,
    ]  # fmt: skip
    drive = greybox.Drive(row["step_s"], roles["volume"], *(one[:end] for one in series))
    began = time.monotonic()
    values = greybox.fit(drive, read, split)
    row["greybox_s"], row["greybox"] = round(time.monotonic() - began, 1), values
    made = greybox.simulate(values, drive, greybox.first_of(read))
    row["greybox_rmse"] = dict(zip(names, off(made, read, split), strict=True))
    for key, hours in (("day_before", DAY), ("week_before", WEEK)):
        steps = round(hours * HOUR / row["step_s"])
        if steps <= split:
            row[f"{key}_rmse"] = dict(zip(names, off(repeated(read, split, steps), read, split), strict=True))


def repeated(read: np.ndarray, split: int, steps: int) -> np.ndarray:
    """The readings (outputs, steps) with the last ``steps`` before ``split`` repeated after it.

    A reading that is missing there is that of the same time one period earlier, or else the channel's mean.
    """
    pattern = np.full((len(read), steps), np.nan)
    for begin in range(split % steps, split, steps):
        part = read[:, begin : begin + steps]
        pattern = np.where(np.isfinite(part), part, pattern)
    pattern = np.where(np.isfinite(pattern), pattern, np.nanmean(read[:, :split], axis=1, keepdims=True))
    made = read.copy()
    made[:, split:] = pattern[:, np.arange(read.shape[1] - split) % steps]
    return made


def off(made: np.ndarray, read: np.ndarray, split: int) -> list[float]:
    """Root mean square error of each output from ``split`` on."""
    return [float(one) for one in np.sqrt(np.nanmean((made - read)[:, split:] ** 2, axis=1))]


def tried(room: Room) -> None:
    """All commands on one room."""
    data = imported(room)
    predicted(room)
    if data is None:
        return
    system = str((room.source / tomllib.loads((room.source / "mapping.toml").read_text())["system"]).resolve())
    try:
        baselines(room, data)
    except (ValueError, KeyError, IndexError) as error:
        room.failures["baselines"] = repr(error)
    if calibrated(room, system):
        forecast(room, system)
    diagnosed(room, system)


def table(rooms: list[Room]) -> str:
    """The results as Markdown, and what failed."""
    lines = [
        "| room | measured hours kept | import, estimate, calibrate, run: processor time [s] | answer after [min] |"
        " answer | explained T, CO2 | known in 90 %: estimate, calibrate | forecast [h from h] |"
        " T rmse [K]: forecast, grey-box, day before, week before | CO2 rmse [ppm]: the same |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for room in rooms:
        row, roles = room.row, room.about["greybox"]
        kept = f"{row['kept_h']} of {row['measured_h']}" if "kept_h" in row else "-"
        times = ", ".join(
            shown(row.get(f"{step}_cpu_s"), "{:.0f}") for step in ("import", "predict", "calibrate", "run")
        )
        answer = f"{row['verdict']}: {', '.join(row['named']) or 'nothing named'}" if "verdict" in row else "none"
        both = [roles["temperature"], roles["co2"]]
        explained = ", ".join(shown(row.get("explained", {}).get(name), "{:.0%}") for name in both)
        known = ", ".join(counted(row.get(f"{step}_known")) for step in ("predict", "calibrate"))
        hours = f"{row['ahead_h']:g} from {row['context_h']:g}" if "ahead_h" in row else "-"
        errors = [
            ", ".join(
                shown(row.get(f"{key}_rmse", {}).get(name), form)
                for key in ("forecast", "greybox", "day_before", "week_before")
            )
            for name, form in zip(both, ("{:.2f}", "{:.0f}"), strict=True)
        ]
        first = shown(row.get("first_answer_min"), "{:.1f}")
        cells = [room.source.name, kept, times, first, answer, explained, known, hours, *errors]
        lines.append("| " + " | ".join(cells) + " |")
    said = [f"- {room.source.name}: {' '.join(room.row['summary'])}" for room in rooms if "summary" in room.row]
    failed = [f"- {room.source.name}, {step}: {words}" for room in rooms for step, words in room.failures.items()]
    return "\n".join([*lines, "", *said, "", *failed]) + "\n"


def shown(value: float | None, form: str) -> str:
    """A number, or a dash for none."""
    return "-" if value is None else form.format(value)


def counted(inside: dict[str, bool] | None) -> str:
    """How many of the known parameters lie inside."""
    return "-" if not inside else f"{sum(inside.values())} of {len(inside)}"


def write(rooms: list[Room], out: Path) -> None:
    """Both files."""
    (out / "rooms.md").write_text(table(rooms))
    told = [
        {"room": one.source.name, "title": one.about["title"], **one.row, "failures": one.failures} for one in rooms
    ]
    (out / "rooms.json").write_text(json.dumps(told, indent=1))


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=8.0, help="a command is stopped after so long")
    options = parser.parse_args()
    rooms: list[Room] = []
    for source in sorted(one.parent for one in options.folder.glob("*/room.toml")):
        out = (options.out / source.name).resolve()
        out.mkdir(parents=True, exist_ok=True)
        room = Room(source.resolve(), out, options.minutes, tomllib.loads((source / "room.toml").read_text()))
        rooms.append(room)
        tried(room)
        write(rooms, options.out)
    print(table(rooms))


if __name__ == "__main__":
    main()
