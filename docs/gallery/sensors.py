"""Which sensor should I buy? What each further one can tell at all, and what an estimator makes of it.

    python docs/gallery/sensors.py --out DIRECTORY

For four sets of sensors: the linearised limit of R2, from the model's sensitivities; and R2 of the
estimator that comes with the package, on rooms that it has never seen. Sensors are as good as the description's preset
says, and the constants of the walls as uncertain as it says. What raises the limit is worth buying; what raises the
limit alone waits for a better estimator.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from made import table, write

import datagen
import trainer

SYSTEM = "MixedAirCO2"
CONTEXT, NOISE = 72.0, "sensor"
SETS = {
    "temperature, CO2": ["TRoo", "CO2"],
    "and air flow": ["TRoo", "CO2", "mOA"],
    "and heater power": ["TRoo", "CO2", "QHea"],
    "and both": ["TRoo", "CO2", "QHea", "mOA"],
}
OPTIONAL = {"QHea", "mOA"}
ROOMS, LIMIT_ROOMS, WINDOWS = 60, 3, 300
"""Rooms that the estimator is scored on and that the limit is averaged over; windows of the first."""


COLOURS = ("#0b2f6b", "#4a86c8", "#e0a01b", "#f3d98b")
"""Of sets: by lightness too, for who sees no red or green."""


class Worth(NamedTuple):
    """R2 by parameter for each set of sensors: ``limit`` and ``reached``, (sets, parameters)."""

    parameters: list[str]
    limit: np.ndarray
    reached: np.ndarray


def work(folder: Path) -> Worth:
    """The limits, then a fresh dataset and the estimator's scores on it."""
    conditions = [(NOISE, channels) for channels in SETS.values()]
    limits = datagen.ceilings_of(
        SYSTEM, contexts=[CONTEXT], conditions=conditions, systems=LIMIT_ROOMS, seed=1, uncertain=True
    )
    parameters = list(limits[0].r2)
    datagen.run(SYSTEM, folder / "rooms", systems=ROOMS, preset="many-rooms", seed=5, workers=1, uncertain=True)
    run, reached = trainer.load_run(SYSTEM), []
    for channels in SETS.values():
        scores = trainer.evaluate(
            run,
            folder / "rooms",
            windows=WINDOWS,
            noise=NOISE,
            context_hours=CONTEXT,
            without=sorted(OPTIONAL - set(channels)),
            out=folder / "scores",
        )
        found = scores.protocols["unseen"].r2
        reached.append([found[name] for name in parameters])
    return Worth(parameters, np.array([[one.r2[name] for name in parameters] for one in limits]), np.array(reached))


def tables(made: Worth) -> list[str]:
    """The table of the page."""
    columns = ("parameter", *(f"{name}: {what}" for name in SETS for what in ("limit", "reached")))
    rows = [
        (name, *np.column_stack([made.limit[:, k], made.reached[:, k]]).ravel())
        for k, name in enumerate(made.parameters)
    ]
    means = np.column_stack([made.limit.mean(axis=1), made.reached.mean(axis=1)]).ravel()
    return [table(columns, [*rows, ("mean", *means)])]


def draw(made: Worth, path: Path) -> None:
    """Limit and score of each parameter, by set of sensors."""
    names = [*made.parameters, "mean"]
    figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
    for axis, values, title in ((axes[0], made.limit, "limit"), (axes[1], made.reached, "reached on\nunseen rooms")):
        values = np.column_stack([values, values.mean(axis=1)])
        for k, (name, row) in enumerate(zip(SETS, values, strict=True)):
            axis.bar(np.arange(len(names)) + 0.2 * (k - 1.5), row, 0.2, label=name, color=COLOURS[k])
        axis.set_ylabel(f"R2,\n{title}")
        axis.set_ylim(min(0.0, values.min()), 1)
    axes[0].legend(ncols=4, fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes[1].set_xticks(range(len(names)), names, rotation=20)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main() -> None:
    """Run, and write the page's figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    folder = parser.parse_args().out
    made = work(folder)
    write(folder / "sensors.out.md", *tables(made))
    draw(made, folder / "sensors.png")


if __name__ == "__main__":
    main()
