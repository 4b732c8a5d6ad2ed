"""Make the sample reports of ``docs/samples``: a page for each verdict, and a forecast.

    python docs/making/samples.py [NAME ...]

``effect`` is the diagnosis of the quick start, which takes ten minutes of processor time. The others are of the
gallery's house and take a minute together. Every random number comes from the seeds below.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import numpy as np

import datagen
import diagnosis

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "gallery"))
from house import Heat, build_fmu, measure

OUT = Path(__file__).resolve().parents[1] / "samples"
ROOM, HOURS, PLUG = 99, 672, 400.0
"""Seed and length [h] of the default room of the quick start, and the heat of its equipment [W]."""
GUESTS, GUESTS_HEAT = 7, 900.0
"""Seed of the evenings on which the house has guests, and their heat [W]."""
CONTEXT = AHEAD = 168.0
"""Of the forecast: length of what is fitted, and of what is simulated [h]."""


def guests(moments: np.ndarray) -> np.ndarray:
    """Heat of guests [W] at times [s of the year]: from 19 to 23 h, on two of five evenings."""
    hour, day = moments / 3600 % 24, (moments // 86400).astype(int)
    come = np.random.default_rng(GUESTS).random(day.max() + 1) < 0.4
    return GUESTS_HEAT * (come[day] & (hour >= 19) & (hour < 23))


def effect(folder: Path) -> Path:
    """Equipment that a candidate describes, in the default room."""
    room = folder / "odd.nc"
    datagen.simulate("MixedAirCO2", parameters={"effect.plug.Q": PLUG}, hours=HOURS, seed=ROOM, out=room)
    diagnosis.diagnose("MixedAirCO2", room, out=folder / "answer")
    return folder / "answer"


def house(folder: Path, heat: Heat | float) -> Path:
    """A diagnosis of the gallery's house, which has that heat more than its model."""
    system = build_fmu(folder)
    measure(system, folder / "house.nc", heat=heat)
    diagnosis.diagnose(system, folder / "house.nc", out=folder / "answer")
    return folder / "answer"


def forecast(folder: Path) -> Path:
    """A week of the gallery's house, forecast from the week before."""
    system = build_fmu(folder)
    measure(system, folder / "house.nc", heat=0.0)
    diagnosis.forecast(system, folder / "house.nc", context=CONTEXT, ahead=AHEAD, out=folder / "answer")
    return folder / "answer"


SAMPLES: dict[str, Callable[[Path], Path]] = {
    "none_of_these": lambda folder: house(folder, guests),
    "no_gap": lambda folder: house(folder, 0.0),
    "forecast": forecast,
    "effect": effect,
}


def main() -> None:
    """Make the samples that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(SAMPLES), help=f"of {', '.join(SAMPLES)}")
    names = parser.parse_args().names
    if unknown := [name for name in names if name not in SAMPLES]:
        parser.error(f"there is no sample {', '.join(unknown)}; expected some of {', '.join(SAMPLES)}")
    OUT.mkdir(exist_ok=True)
    for name in names:
        began = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            answer = SAMPLES[name](Path(folder))
            kind = "forecast" if name == "forecast" else "report"
            if kind == "report":
                verdict = diagnosis.read_report(answer).verdict
                if verdict != name:
                    raise SystemExit(f"{name}: the verdict is {verdict}; nothing is written: choose another recording")
                shutil.copy(answer / "report.json", OUT / f"{name}.json")
            shutil.copy(answer / f"{kind}.html", OUT / f"{name}.html")
        print(f"{name}: {time.process_time() - began:.0f} s of processor time, {OUT / f'{name}.html'}")  # noqa: T201


if __name__ == "__main__":
    main()
