"""A house whose logger's clock, units and columns are as they come: its description, its mapping, its rows."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd

ZONE = ZoneInfo("Europe/Amsterdam")

# names that no other system of ours has: nothing in the import may know a name
HOUSE = """
schema_version = 1
name = "House"
fmu = "none.fmu"
experiment = { step = 1800.0, hours = 24.0 }
estimator = { channels = ["warmth"] }
parameters = [{ name = "UA", unit = "W/K", min = 1.0, max = 9.0 }]
outputs = [
  { name = "warmth", unit = "K", accuracy = 0.1 },
  { name = "gas", unit = "W", accuracy = 1.0, method = "mean" },
]
inputs = [
  { name = "outdoors", unit = "K", source = "weather", column = "temp_air" },
  { name = "sky", unit = "K", source = "weather", column = "temp_sky" },
  { name = "sunshine", unit = "W/m2", source = "weather", column = "poa_global" },
  { name = "people", unit = "1", source = "occupancy" },
  { name = "air", unit = "kg/s", source = "measured", column = "air", interpolation = "previous" },
  { name = "wish", unit = "K", source = "schedule", schedule = "wish" },
  { name = "nothing", unit = "1", source = "constant", value = 3.0 },
]
weather = { files = ["pvlib:723170TYA.CSV"] }
schedules = { wish = { weekday = [[0.0, 290.0], [6.5, 294.0]], weekend = [[0.0, 289.0]] } }
[occupancy]
headcount = [1, 2]
arrival = [7.0, 9.0]
duration = [7.0, 9.0]
jitter = 0.5
attendance = [0.4, 1.0]
gaps = [0, 1]
gap_duration = [0.4, 1.5]
gap_share = [0.3, 1.0]
absence = 0.05
weekend = 0.15
"""
MAPPING = """
schema_version = 1
system = "house.toml"
[time]
column = "when"
zone = "Europe/Amsterdam"
[place]
latitude = 52.0
longitude = 5.0
[variables.warmth]
column = "room"
unit = "degC"
compare = { column = "room 2", unit = "degF" }
[variables.gas]
column = "kilowatts"
unit = "kW"
reading = "mean"
[variables.people]
column = "presence"
unit = "presence"
persons = 2.0
reading = "mean"
[variables.air]
column = "valve"
unit = "m3/h"
scale = 2.4
reading = "mean"
fill = 0.0
[weather.temp_air]
column = "outside"
unit = "degC"
[weather.ghi]
column = "sun"
unit = "W/m2"
"""
HOURLY = MAPPING.replace("[place]", "[grid]\nstep = 3600.0\n[place]")


def warmth(hours):
    return 21.0 + 2.0 * np.sin(2 * np.pi * hours / 24)


def measured(days=6, minutes=10, first=datetime(2022, 10, 27, 22, 0, tzinfo=UTC), jitter=0.0):
    """Rows of a logger on the wall clock across the end of daylight saving; time in hours since the first row."""
    rng = np.random.default_rng(3)
    minute = np.arange(0, days * 1440 + 1, minutes, dtype=float)
    minute[1:-1] += jitter * minutes * rng.uniform(-0.4, 0.4, len(minute) - 2)
    when = [first + timedelta(minutes=round(m, 1)) for m in minute]
    hours = np.array([(t - first).total_seconds() / 3600 for t in when])
    frame = pd.DataFrame(
        {
            "when": [t.astimezone(ZONE).replace(tzinfo=None).isoformat(sep=" ") for t in when],
            "room": warmth(hours),
            "room 2": (warmth(hours) - 0.5) * 1.8 + 32,
            "kilowatts": 1.0 + np.cos(2 * np.pi * hours / 24),
            "presence": ((hours % 24 > 9) & (hours % 24 <= 17)).astype(int),
            "valve": np.full(len(hours), 50.0),
            "outside": 8.0 + 3.0 * np.sin(2 * np.pi * hours / 24),
            "sun": np.maximum(300 * np.sin(2 * np.pi * (hours % 24 - 7) / 20), 0) * (hours % 24 < 17),
            "not mapped": 1.0,
        }
    )
    return frame, hours
