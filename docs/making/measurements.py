"""Make ``docs/example/measurements.csv``: what a building's log might look like, of a room whose parameters are known.

    python docs/making/measurements.py --out docs/example/measurements.csv

The room is simulated, and its sensors read as badly as the system description says. Stamps are local time.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import datagen
from datagen.driving.inputs import system_weather
from shared.system import load_system

SEED, HOURS = 12, 504
AIR_DENSITY = 1.2
"""[kg/m3], what ``diagnosis import`` turns volume flows into mass flows with"""


def measurements() -> pd.DataFrame:
    """The log: hourly rows of room, heater, fresh air and weather."""
    system = load_system("MixedAirCO2")
    room = datagen.simulate(system, seed=SEED, hours=HOURS, excitation=False)
    rng = np.random.default_rng(SEED)
    read = {}
    for output in system.outputs:
        sensor = output.noise["sensor"]
        noisy = room[output.name].values + sensor.sd * rng.standard_normal(HOURS)
        noisy[rng.random(HOURS) < sensor.dropout] = np.nan
        read[output.name] = np.round(noisy / sensor.quantum) * sensor.quantum
    sky = system_weather(system, SEED, 0)
    hours = np.arange(1, HOURS + 1)
    return pd.DataFrame(
        {
            "time": pd.date_range("2001-01-01 01:00", periods=HOURS, freq="h").strftime("%Y-%m-%d %H:%M"),
            "room_degC": (read["TRoo"] - 273.15).round(2),
            "co2_ppm": read["CO2"].round(0),
            "heater_kW": (np.maximum(read["QHea"], 0) / 1000).round(2),
            "fresh_air_m3_h": (np.maximum(read["mOA"], 0) / AIR_DENSITY * 3600).round(0),
            "outdoor_degC": (sky.values("temp_air")[hours] - 273.15).round(1),
            "wind_m_s": sky.values("wind_speed")[hours].round(1),
            "sun_horizontal_W_m2": sky.values("ghi")[hours].round(0),
        }
    )


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    measurements().to_csv(parser.parse_args().out, index=False)


if __name__ == "__main__":
    main()
