"""A hall of one capacity for heat and one for air: its description, with names of its own, and its exact recursion."""

from pathlib import Path

import numpy as np

from diagnosis.recording import Recording
from shared.system import parse_system

HALL = """
schema_version = 1
name = "Hall"
fmu = "none.fmu"
estimator = { channels = ["warmth"] }
experiment = { step = 3600.0, hours = 336.0 }
parameters = [
  { name = "breath", unit = "kg/s", min = 8e-6, max = 1.2e-5 },
  { name = "air", unit = "m3", min = 150.0, max = 300.0 },
  { name = "draught", unit = "kg/s", min = 0.05, max = 0.5 },
]
inputs = [
  { name = "outside", unit = "degC", source = "weather", column = "temp_air" },
  { name = "shine", unit = "W/m2", source = "weather", column = "poa_global" },
  { name = "fresh", unit = "ppm", source = "constant", value = 420.0 },
  { name = "heads", unit = "1", source = "occupancy" },
  { name = "wish", unit = "degC", source = "schedule", schedule = "wish" },
]
outputs = [
  { name = "warmth", unit = "degC", accuracy = 0.01, noise = { sensor = { sd = 0.1 } } },
  { name = "breathed", unit = "ppm", accuracy = 1.0, noise = { sensor = { sd = 10.0 } } },
  { name = "fan", unit = "kg/s", accuracy = 0.001, method = "mean" },
]
sources = [{ name = "breath", unit = "kg/s", input = "heads", per = "breath" }]
weather = { files = ["pvlib:723170TYA.CSV"] }
schedules = { wish = { weekday = [[0.0, 20.0]] } }
[occupancy]
headcount = [5, 20]
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
FAN = 0.1
"""Outdoor air [kg/s]."""


def hall():
    """The description."""
    return parse_system(HALL, Path("hall.toml"))


def lived(days=14, step=3600.0, seed=0, begin=0):
    """A recording from day ``begin`` on: weather and persons that differ from day to day, and noise of the sensors."""
    rng = np.random.default_rng(seed)
    count, first = round(86400 / step), round(5 * 86400 / step)
    time = step * np.arange(1, count * (days + 5) + 1) + 86400.0 * (begin - 5)
    hour, day = (time - step / 2) % 86400 / 3600, ((time - step / 2) // 86400).astype(int)
    each = day - day[0]
    cloud = np.repeat(rng.uniform(0.1, 1.0, len(time) // 4 + 1), 4)[: len(time)]
    shine = np.maximum(600 * np.sin(np.pi * (hour - 6.5) / 11), 0) * (abs(hour - 12) < 5.5) * cloud
    outside = 5 + rng.normal(0, 3, days + 6)[each] + 4 * np.sin(np.pi * (hour - 9) / 12) + 0.003 * shine
    come, leave, crowd = rng.uniform(7, 10, days + 6), rng.uniform(15, 19, days + 6), rng.integers(5, 20, days + 6)
    heads = np.where((hour > come[each]) & (hour < leave[each]) & (day % 7 < 5), crowd[each], 0).astype(float)
    warmth, breathed = np.full(len(time), 20.0), np.full(len(time), 420.0)
    air, conductance, capacity = 240.0, 250.0, 2.5e7
    for k in range(1, len(time)):
        heat = 3500 + 3.0 * shine[k] + 90 * heads[k]
        kept = np.exp(-step * conductance / capacity)
        warmth[k] = kept * warmth[k - 1] + (1 - kept) * (outside[k] + heat / conductance)
        kept = np.exp(-step * FAN / (1.2 * air))
        full = 420 + heads[k] * 1e-5 / FAN * 1e6 * 28.97 / 44.01
        breathed[k] = kept * breathed[k - 1] + (1 - kept) * full
    outputs = np.array([warmth, breathed, np.full(len(time), FAN)])[:, first:]
    outputs[:2] += rng.normal(0, 1, (2, outputs.shape[1])) * np.array([[0.1], [10.0]])
    inputs = {"outside": outside, "shine": shine, "heads": heads, "wish": np.full(len(time), 20.0)}
    inputs = {name: values[first:] for name, values in inputs.items()}
    return Recording(Path("hall.nc"), step, time[first:], outputs, inputs)
