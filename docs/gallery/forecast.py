"""From a recording to parameters and a forecast with its uncertainty.

    python docs/gallery/forecast.py --out DIRECTORY

A room is measured for a week with ordinary sensors. One forward pass of the estimator that comes with the package gives
the posterior of its parameters. Draws of it are simulated over the two weeks after, each with persons of its own, for
nobody knows who will come; the same with draws from the prior shows what the week of measurements was worth.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from made import table, write

import datagen
import trainer
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator
from shared.system import load_system

SYSTEM = "MixedAirCO2"
SEED, CONTEXT, AHEAD = 4711, 168, 336
"""Root seed of the room; length of what is measured and of what is forecast [h]."""
SAMPLES, DRAWS = 80, 40
"""Of the posterior; so many of these are simulated."""
SHOWN = {"TRoo": "room temperature [K]", "CO2": "CO2 [ppm]"}


class Forecast(NamedTuple):
    """What was found.

    ``parameters``: truth, median and ends of the 90 % interval [unit] by name. Of the hours ahead: ``truth`` (hours,
    outputs), ``draws`` and ``prior`` (draws, hours, outputs) [unit of the output].
    """

    parameters: dict[str, tuple[float, float, float, float]]
    truth: np.ndarray
    draws: np.ndarray
    prior: np.ndarray


def measure(path: Path) -> xr.Dataset:
    """Simulate the room; write its first week as its sensors show it, and return the truth of all three weeks."""
    system = load_system(SYSTEM)
    room = datagen.simulate(system, seed=SEED, hours=CONTEXT + AHEAD)
    rng = np.random.default_rng(SEED)
    week = room.isel(time=slice(CONTEXT)).copy(deep=True)
    for output in system.outputs:
        sensor = output.noise["sensor"]
        read = week[output.name].values + sensor.sd * rng.standard_normal(CONTEXT)
        week[output.name].values[:] = np.round(read / sensor.quantum) * sensor.quantum
    # nobody counted persons, and there is no meter of heat or air
    week[[*SHOWN, *(name for name in system.input_names if name != "nPer")]].to_netcdf(path)
    return room


def work(folder: Path) -> Forecast:
    """Measure, estimate, simulate ahead."""
    folder.mkdir(parents=True, exist_ok=True)
    recording, samples = folder / "week.nc", folder / "samples.nc"
    room = measure(recording)
    found = trainer.predict(SYSTEM, recording, samples=SAMPLES, out=samples, seed=1).predictions[0].parameters
    drawn = xr.load_dataset(samples)
    described = load_system(SYSTEM).with_experiment(hours=CONTEXT + AHEAD)
    simulator = Simulator(described)
    columns = [described.output_names.index(name) for name in SHOWN]

    def ahead(index: int, parameters: dict[str, float]) -> np.ndarray:
        """Outputs of the hours ahead with these parameters and the persons of another system, (hours, outputs)."""
        done = simulate_system(simulator, root_seed=SEED, index=index, parameters=parameters)
        return done.outputs[columns, CONTEXT:].T

    draws = [ahead(k + 1, {name: float(drawn[name][k]) for name in described.parameter_names}) for k in range(DRAWS)]
    prior = [ahead(k + 1, {}) for k in range(DRAWS)]
    truth = np.stack([room[name].values[CONTEXT:] for name in SHOWN], axis=1)
    parameters = {
        name: (float(room[name]), one.median or np.nan, one.low or np.nan, one.high or np.nan)
        for name, one in found.items()
    }
    return Forecast(parameters, truth, np.stack(draws), np.stack(prior))


def figures(made: Forecast) -> list[tuple[str, float, float, float, float]]:
    """By output: RMSE of the medians and share of hours within the 90 % bands, with and without the week.

    In an empty room all draws are next to the truth: what half of a sensor's resolution tells apart counts as within.
    """
    rows = []
    sensors = {one.name: one.noise["sensor"] for one in load_system(SYSTEM).outputs}
    for k, name in enumerate(SHOWN):
        numbers = []
        for cloud in (made.draws[..., k], made.prior[..., k]):
            low, middle, high = np.percentile(cloud, [5, 50, 95], axis=0)
            truth, near = made.truth[:, k], 0.5 * sensors[name].quantum
            numbers += [
                float(np.sqrt(np.mean((middle - truth) ** 2))),
                float(np.mean((low - near <= truth) & (truth <= high + near))),
            ]
        rows.append((name, *numbers))
    return rows


def tables(made: Forecast) -> list[str]:
    """The tables of the page: parameters, and the forecast's figures."""
    columns = ("output", "RMSE", "inside the band", "RMSE without measurements", "inside without")
    rows = [(name, *values) for name, values in made.parameters.items()]
    return [table(("parameter", "true", "median", "90 % from", "to"), rows), table(columns, figures(made))]


def draw(made: Forecast, path: Path) -> None:
    """The forecast beside what came."""
    figure, axes = plt.subplots(len(SHOWN), 1, figsize=(9, 5), sharex=True, layout="constrained")
    days = np.arange(1, AHEAD + 1) / 24
    for k, (axis, label) in enumerate(zip(axes, SHOWN.values(), strict=True)):
        low, high = np.percentile(made.draws[..., k], [5, 95], axis=0)
        axis.fill_between(days, low, high, color="#9ecae1", label="forecast, 90 %")
        for edge, said in zip(
            np.percentile(made.prior[..., k], [5, 95], axis=0), ("without measurements, 90 %", None), strict=True
        ):
            axis.plot(days, edge, color="0.35", lw=0.9, ls="--", label=said)
        axis.plot(days, np.median(made.draws[..., k], axis=0), color="#1f5fa8", lw=1, label="median")
        axis.plot(days, made.truth[:, k], color="#d95f02", lw=1, label="what came")
        axis.set_ylabel(label)
    axes[0].legend(ncols=4, fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes[-1].set_xlabel("days after the week of measurements")
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main() -> None:
    """Run, and write the page's figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    folder = parser.parse_args().out
    made = work(folder)
    write(folder / "forecast.out.md", *tables(made))
    draw(made, folder / "forecast.png")


if __name__ == "__main__":
    main()
