"""A house of my own: from an FMU and a system description to a dataset, an estimator and a diagnosis.

    python docs/gallery/house.py --out DIRECTORY

The FMU is built from ``house/house.c``; a modelling tool would export it. The recording comes from elsewhere: the
exact solution of the house's two linear equations, with equipment that runs in working hours, which the model does
not know.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from made import table, write
from scipy.signal import cont2discrete

import datagen
import trainer
from datagen.driving.inputs import build_inputs
from diagnosis import diagnose
from diagnosis.gap.schema import Report
from fmus.build import write_zip
from fmus.toolchain import BINARIES, compile_binary, native_platform
from shared.numbers import chance
from shared.system import System, load_system

HERE = Path(__file__).resolve().parent
TRUTH = {"rw": 6e-3, "ri": 1.5e-3, "cw": 2.5e7, "area": 2.4}
"""The house that is measured."""
EQUIPMENT = 300.0
"""Heat of the equipment in working hours [W]."""
HOURS, BEGIN, WARM_UP = 336, 1008, 480
"""Length of the recording, its beginning in the year (12 February), and what is simulated before it [h]."""
Heat = Callable[[np.ndarray], np.ndarray]
"""Heat that the model does not know [W], at times [s of the year]."""
PARTS = 60
"""Steps of the exact solution in an hour: the inputs' straight lines are held that long."""


def build_fmu(folder: Path) -> System:
    """Compile the house for this machine, pack it as an FMU beside its description; returns the description."""
    folder.mkdir(parents=True, exist_ok=True)
    source = {"house.c": (HERE / "house" / "house.c").read_text(encoding="utf-8")}
    place, binary = compile_binary(BINARIES[native_platform()], source, "House")
    model = (HERE / "house" / "modelDescription.xml").read_bytes()
    write_zip(folder / "House.fmu", {"modelDescription.xml": model, place: binary})
    shutil.copy(HERE / "house" / "system.toml", folder)
    return load_system(folder)


def exact_house(
    inputs: np.ndarray, start: tuple[float, float], parameters: Mapping[str, float] = TRUTH, ca: float = 2e6
) -> np.ndarray:
    """Air temperature [K] at the ends of steps of 1 / PARTS h; inputs (steps, 3): outdoors, sun, heat; held."""
    one = parameters
    a = np.array([[-1 / (one["ri"] * ca), 1 / (one["ri"] * ca)], [1 / (one["ri"] * one["cw"]), 0.0]])
    a[1, 1] = -(1 / one["ri"] + 1 / one["rw"]) / one["cw"]
    b = np.array([[0.0, one["area"] / ca, 1 / ca], [1 / (one["rw"] * one["cw"]), 0.0, 0.0]])
    advance, drive, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 3))), 3600 / PARTS)
    x, air = np.array(start), np.empty(len(inputs))
    for k, row in enumerate(inputs):
        x = advance @ x + drive @ row
        air[k] = x[0]
    return air


def air_of(system: System, parameters: Mapping[str, float], heat: Heat | float = 0.0) -> np.ndarray:
    """Air temperature [K] of a house at the recording's steps, with so much heat [W] in working hours, or at times."""
    gains = heat if callable(heat) else lambda time: heat * at_work(time)
    table = build_inputs(system, root_seed=5, index=0, start=(BEGIN - WARM_UP) * 3600, stop=(BEGIN + HOURS) * 3600)
    fine = (np.arange((WARM_UP + HOURS) * PARTS) + 0.5) * 3600 / PARTS + (BEGIN - WARM_UP) * 3600
    inputs = table.at(fine)  # in the description's order: outdoors, sun, heater
    inputs[:, 2] += gains(fine)
    return exact_house(inputs, (293.0, 285.0), parameters)[PARTS * WARM_UP + PARTS - 1 :: PARTS]


def at_work(time: np.ndarray) -> np.ndarray:
    """Whether times [s of the year] lie in working hours; the year begins on a Monday."""
    hour = time / 3600 % 24
    return (hour >= 8) & (hour < 18) & ((time // 86400) % 7 < 5)


def measure(system: System, path: Path, *, heat: Heat | float = EQUIPMENT, noise: float = 0.05) -> xr.Dataset:
    """Write a recording of the true house: what its sensor shows, and the inputs that were logged."""
    air = air_of(system, TRUTH, heat) + noise * np.random.default_rng(5).standard_normal(HOURS)
    table = build_inputs(system, root_seed=5, index=0, start=BEGIN * 3600, stop=(BEGIN + HOURS) * 3600)
    time = 3600.0 * (BEGIN + np.arange(1, HOURS + 1))
    record = xr.Dataset(coords={"time": ("time", time, {"units": "seconds since 2001-01-01 00:00:00"})})
    record["TAir"] = ("time", air, {"units": "K"})
    instants, middles = table.at(time), table.at(time - 1800.0)
    for k, one in enumerate(system.inputs):  # the heater's power is held over the hour that a row ends
        held = one.interpolation == "previous"
        record[one.name] = ("time", (middles if held else instants)[:, k], {"units": one.unit})
    record.to_netcdf(path)
    return record


class Answer(NamedTuple):
    """What was found: R2 on houses never seen, the zero-shot estimate, and the diagnosis."""

    r2: dict[str, float]
    estimate: dict[str, float]
    report: Report


def work(folder: Path) -> Answer:
    """The whole way."""
    system = build_fmu(folder)
    datagen.run(system, folder / "data", systems=300, hours=336, seed=1, workers=1)
    run = trainer.fit(folder / "data", folder / "run", model="ridge")
    scores = trainer.evaluate(run, folder / "data").protocols["unseen"]
    measure(system, folder / "recording.nc")
    found = trainer.predict(run, folder / "recording.nc").predictions[0].parameters
    done = diagnose(system, folder / "recording.nc", run=folder / "run", out=folder / "diagnosis")
    r2 = {name: value for name, value in scores.r2.items() if value is not None}
    return Answer(r2, {name: one.value for name, one in found.items()}, done.report)


def draw(made: Answer, path: Path) -> None:
    """Parameters beside the truth, and what the diagnosis holds probable."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    for k, one in enumerate(made.report.parameters):
        true = TRUTH[one.name]
        left.plot(made.estimate[one.name] / true, k + 0.2, "o", color="0.5", label="zero-shot" if k == 0 else None)
        rows = [("base model", "#d95f02", one.before, one.before_low, one.before_high)]
        if one.after is not None and one.after_low is not None and one.after_high is not None:
            rows.append(("with the effect", "#1f5fa8", one.after, one.after_low, one.after_high))
        for i, (name, colour, value, low, high) in enumerate(rows):
            y = k - 0.2 * i
            left.plot([low / true, high / true], [y, y], color=colour, lw=2)
            left.plot(value / true, y, "o", color=colour, label=name if k == 0 else None)
    left.axvline(1, color="0.7", zorder=0)
    left.set_yticks(range(len(made.report.parameters)), [one.name for one in made.report.parameters])
    left.set_xlabel("estimate / truth, with 90 % intervals")
    left.set_title("What the parameters are, as shares of the truth", fontsize="medium")
    left.legend(fontsize="small", loc="upper right", bbox_to_anchor=(1.0, 0.86))
    chances = {one.name: one.probability for one in made.report.effects}
    chances |= {"none of these": made.report.none_of_these, "no gap": made.report.no_gap}
    right.barh(list(chances)[::-1], list(chances.values())[::-1], color="#1f5fa8")
    right.set_title("What the gap is", fontsize="medium")
    right.set_xlim(0, 1)
    right.set_xlabel("probability")
    figure.savefig(path, dpi=100)
    plt.close(figure)


def draw_answer(made: Answer, system: System, recording: xr.Dataset, path: Path) -> None:
    """The first week measured, and simulated by the model before and after the effect that was found is added."""
    named = [one for one in made.report.effects if one.named]
    size = sum(one.amplitude or 0.0 for one in named)
    before = air_of(system, {one.name: one.before for one in made.report.parameters})
    after = air_of(
        system, {one.name: one.before if one.after is None else one.after for one in made.report.parameters}, size
    )
    measured, week = recording["TAir"].values, slice(0, 168)
    day = np.arange(1, HOURS + 1)[week] / 24
    figure, (top, low) = plt.subplots(2, 1, figsize=(7, 4.6), layout="constrained", sharex=True, height_ratios=(2, 1))
    top.plot(day, measured[week] - 273.15, ".", color="0.25", ms=4, label="measured")
    for values, colour, label in ((before, "#d95f02", "model before"), (after, "#1f5fa8", "model after")):
        top.plot(day, values[week] - 273.15, color=colour, lw=1.4, label=label)
        low.plot(day, (measured - values)[week], color=colour, lw=1.2)
    top.set_ylabel("room air [°C]")
    top.legend(loc="upper right", frameon=False)
    found = "; ".join(
        f"{one.description}:\n{one.amplitude:.0f} {one.unit} ({one.low:.0f} to {one.high:.0f}),"
        f" probability {chance(one.probability)}"
        for one in named
    )
    top.set_title(found, loc="left", fontsize="medium")
    low.set_ylabel("measured\nminus model [K]")
    low.set_xlabel("days of the recording; shaded: working hours")
    working = at_work(3600.0 * (BEGIN + np.arange(168) + 0.5))
    edges = np.flatnonzero(np.diff(working.astype(int), prepend=0, append=0)) / 24
    for axes in (top, low):
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            axes.axvspan(begin, end, color="0.92", zorder=0, lw=0)
        axes.set_xlim(0, 7)
    low.axhline(0, color="0.6", lw=0.8, zorder=0)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def known(*values: float | None) -> list[float]:
    """Numbers for a table; what a report does not give is none."""
    return [np.nan if value is None else value for value in values]


def tables(made: Answer) -> list[str]:
    """The tables of the page: parameters, effects, shrinkage."""
    parameters = table(
        (
            "parameter",
            "unit",
            "true",
            "R2 on unseen houses",
            "zero-shot",
            "base model",
            "with the effect",
            "from",
            "to",
        ),
        [
            (
                one.name,
                one.unit,
                TRUTH[one.name],
                made.r2[one.name],
                made.estimate[one.name],
                one.before,
                *known(one.after, one.after_low, one.after_high),
            )
            for one in made.report.parameters
        ],
    )
    named = [one for one in made.report.effects if one.named]
    effects = table(
        ("effect found", "probability", "size", "from", "to", "unit"),
        [(one.name, one.probability, *known(one.amplitude, one.low, one.high), one.unit) for one in named],
    )
    shrinkage = table(
        ("on the days kept", "RMS before", "after", "noise alone", "unit", "share of the gap gone", "placebo"),
        [
            (one.channel, one.before, one.after, one.floor, one.unit, *known(one.share, one.placebo))
            for one in made.report.shrinkage
        ],
    )
    return [parameters, effects, shrinkage]


def main() -> None:
    """Run, and write the page's figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    folder = parser.parse_args().out
    made = work(folder)
    write(folder / "house.out.md", *tables(made))
    draw(made, folder / "house.png")
    recording = xr.load_dataset(folder / "recording.nc", decode_times=False)
    draw_answer(made, load_system(folder), recording, folder / "diagnosis.png")


if __name__ == "__main__":
    main()
