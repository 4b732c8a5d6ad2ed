"""A second system: a house of two resistances and one capacity, as an FMU of both kinds, and its exact recursion."""

import importlib.util
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from shared.system import parse_system
from tests.diagnosis.fitting.crowd_cases import warm_room
from tests.house import ROOM_AND_PERSONS

SINCE = {"units": "seconds since 2001-01-01 00:00:00"}

HOUR = 3600.0
HOUSE = """
schema_version = 1
name = "House"
fmu = "house.fmu"
experiment = { step = 3600.0, hours = 240.0, tolerance = 1e-7 }
estimator = { channels = ["room"] }
fixed = { q = 0.1 }
parameters = [
  { name = "ro", unit = "K/kW", min = 2.0, max = 20.0, scale = "log" },
  { name = "ri", unit = "K/kW", min = 0.1, max = 2.0 },
  { name = "c", unit = "kWh/K", min = 1.0, max = 10.0, scale = "log" },
  { name = "a", unit = "m2", min = 0.5, max = 6.0 },
]
inputs = [
  { name = "To", unit = "degC", source = "measured", column = "outside" },
  { name = "S", unit = "kW/m2", source = "measured", column = "sun" },
  { name = "N", unit = "1", source = "occupancy" },
  { name = "P", unit = "kW", source = "measured", column = "heater", interpolation = "previous" },
]
"""
TRUTH = {"ro": 7.0, "ri": 0.6, "c": 4.0, "a": 2.5}
WARM_UP = 48.0
"""So long before a recording the exact recursion begins, if not said otherwise [h]."""


@pytest.fixture(scope="session")
def house(tmp_path_factory):
    """``house(kind)``: the description of the house around an FMU of a kind, ``me`` or ``cs``."""
    path = Path(__file__).resolve().parents[1] / "fmus" / "small" / "builder.py"
    spec = importlib.util.spec_from_file_location("small_fmus_builder_of_houses", path)
    builder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(builder)
    folder, made = tmp_path_factory.mktemp("house"), {}

    def make(kind="me"):
        if kind not in made:
            fmu = builder.build("house", 2, (kind,), folder, attributes='canHandleVariableCommunicationStepSize="true"')
            toml = folder / f"house-{kind}.toml"
            toml.write_text(HOUSE.replace("house.fmu", fmu.name) + ROOM_AND_PERSONS, encoding="utf-8")
            made[kind] = parse_system(toml.read_text(encoding="utf-8"), toml)
        return made[kind]

    return make


def weather(rng, hours):
    """Outdoor temperature [degC], sun [kW/m2] and heater [kW] at the ends of hours, shape (hours,) each."""
    t = np.arange(1, hours + 1)
    slow = np.convolve(rng.standard_normal(hours + 48), np.ones(48) / 48, "valid")[:hours]
    outside = 5 - 4 * np.cos(2 * np.pi * (t - 3) / 24) + 15 * slow
    sun = np.maximum(0, -np.cos(2 * np.pi * t / 24)) * (0.3 + 0.4 * rng.random(hours // 24 + 1).repeat(24)[:hours])
    heater = np.where((t % 24 > 6) & (t % 24 < 20), 2.0, 0.5) + (rng.random(hours) > 0.7)
    return outside, sun, heater


def exact_house(values, outside, sun, persons, heater, start=18.0, q=0.1, parts=60):
    """Room temperature at the ends of hours, shape (hours,) [degC]: exact for inputs held over parts of an hour.

    Outdoors and sun are straight lines between the hours; persons (hours * 2) and heater (hours,) are held.
    """
    dt = 1.0 / parts
    decay = np.exp(-dt / (values["ro"] * values["c"]))
    temperature, room = start, []
    for hour in range(len(outside)):
        a, b = max(hour - 1, 0), hour
        for k in range(parts):
            share = (k + 0.5) * dt
            drive = outside[a] + share * (outside[b] - outside[a])
            gain = q * persons[2 * hour + (2 * k) // parts] + heater[hour]
            solar = values["a"] * (sun[a] + share * (sun[b] - sun[a]))
            settled = drive + values["ro"] * (gain + solar)
            temperature = settled + decay * (temperature - settled)
        room.append(temperature + values["ri"] * gain)
    return np.array(room)


@pytest.fixture(scope="session")
def house_recorded():
    """``house_recorded(folder, hours, persons, ...)``: path of a recording that the house's exact recursion made."""

    def make(folder, hours=240, persons=None, noise=0.05, seed=0, values=None, count=True, before=48):
        before = before if persons is None else len(persons) // 2 - hours
        rng = np.random.default_rng(seed)
        outside, sun, heater = weather(rng, hours + before)
        outside[:before] = np.tile(outside[before : before + 24], before // 24)
        sun[:before] = np.tile(sun[before : before + 24], before // 24)
        heater[:before] = np.tile(heater[before : before + 24], before // 24)
        crowd = np.zeros(2 * (hours + before)) if persons is None else persons
        room = exact_house({**TRUTH, **(values or {})}, outside, sun, crowd, heater)[before:]
        room = room + noise * rng.standard_normal(hours)
        data = xr.Dataset(coords={"time": ("time", HOUR * np.arange(1, hours + 1), SINCE)})
        columns = {"room": (room, "degC"), "To": (outside, "degC"), "S": (sun, "kW/m2"), "P": (heater, "kW")}
        if count:
            columns["N"] = (crowd.reshape(-1, 2).mean(axis=1), "1")
        for name, (series, unit) in columns.items():
            data[name] = ("time", series[-hours:], {"units": unit})
        path = folder / f"house-{seed}.nc"
        data.to_netcdf(path)
        return path

    return make


@pytest.fixture
def house_recording(house_recorded, tmp_path):
    """``house_recording(hours, persons, ...)``: such a recording in the test's own folder."""
    return partial(house_recorded, tmp_path)


@pytest.fixture(scope="session")
def warm(tmp_path_factory):
    """Simulator and recording of a room that is warm enough for its persons to open a window; nobody changes them."""
    return warm_room(tmp_path_factory.mktemp("warm") / "room.nc")
