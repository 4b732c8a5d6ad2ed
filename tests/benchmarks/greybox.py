"""A grey-box model of a room, the usual kind: two capacities for its heat and a balance of its CO2.

A baseline for ``real_rooms.py``: it is fitted to the same days and driven by the same measured inputs
as the FMU.

    Ca dTa/dt = UAam (Tm - Ta) + (UAao + cp m) (To - Ta) + UAn (Tn - Ta) + Aa I + 70 W n + s Q
    Cm dTm/dt = UAam (Ta - Tm) + UAmo (To - Tm) + Am I
    rho V f dc/dt = m (co - c) + g n

with ``m = share * flow + leak``: outdoor air; ``I`` sun, ``n`` persons, ``Q`` measured heat (cooling is negative), and
a neighbour ``Tn`` that stays. Within a step all inputs are constant, so that each step is solved exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

HEAT, DENSITY, PPM = 1006.0, 1.2, 1e6 * 28.9647 / 44.0095
"""Of air: [J/(kg K)], [kg/m3]; ppm by volume in a share by mass of CO2."""
PERSON = 70.0
"""Dry heat of a person who sits [W]. It is given: of all heats and capacities only ratios act."""

# low and high; "log" ones are fitted as logarithms; "per m3" ones are multiplied by the room's volume
BOUNDS = {
    "air_capacity": (1.0e3, 1.0e5, "log", True),  # J/K per m3; the air alone has 1.2e3
    "mass_capacity": (5.0e3, 2.0e6, "log", True),
    "air_to_mass": (0.3, 100.0, "log", True),  # W/K per m3
    "air_to_outdoors": (1e-3, 10.0, "log", True),
    "mass_to_outdoors": (1e-3, 10.0, "log", True),
    "air_to_neighbour": (1e-3, 10.0, "log", True),
    "neighbour": (285.0, 308.0, "linear", False),  # K
    "sun_to_air": (1e-5, 0.3, "log", True),  # m2 per m3
    "sun_to_mass": (1e-5, 0.3, "log", True),
    "heat_share": (0.01, 2.0, "log", False),
    "flow_share": (0.01, 2.0, "log", False),
    "leak": (1e-7, 3e-3, "log", True),  # kg/s per m3
    "emission": (2e-6, 4e-5, "log", False),  # kg/s of CO2 a person
    "mixing": (0.3, 3.0, "log", False),  # share of the volume that mixes
    "co2_offset": (-200.0, 200.0, "linear", False),  # ppm: of the sensor and of the outdoor level together
    "first_mass": (-5.0, 5.0, "linear", False),  # K: the mass above the air at first
}


@dataclass(frozen=True)
class Drive:
    """What drives a room, means over steps of ``step`` [s]; each array (steps,).

    ``outdoors`` [K], ``sun`` [W/m2], ``heat`` [W], ``flow`` of outdoor air [kg/s], ``persons``, ``outdoor_co2`` [ppm].
    """

    step: float
    volume: float
    outdoors: np.ndarray
    sun: np.ndarray
    heat: np.ndarray
    flow: np.ndarray
    persons: np.ndarray
    outdoor_co2: np.ndarray


def simulate(values: dict[str, float], drive: Drive, first: tuple[float, float]) -> np.ndarray:
    """Temperature [K] and CO2 [ppm] at the steps' ends, (2, steps), from ``first`` at the begin of the first step."""
    p = {name: value * (drive.volume if BOUNDS[name][3] else 1.0) for name, value in values.items()}
    air = p["flow_share"] * np.maximum(drive.flow, 0.0) + p["leak"]
    out = p["air_to_outdoors"] + HEAT * air
    ca, cm, between = p["air_capacity"], p["mass_capacity"], p["air_to_mass"]
    a11, a12 = -(between + out + p["air_to_neighbour"]) / ca, between / ca
    a21, a22 = between / cm, -(between + p["mass_to_outdoors"]) / cm
    gains = p["sun_to_air"] * drive.sun + PERSON * drive.persons + p["heat_share"] * drive.heat
    b1 = (out * drive.outdoors + p["air_to_neighbour"] * p["neighbour"] + gains) / ca
    b2 = (p["mass_to_outdoors"] * drive.outdoors + p["sun_to_mass"] * drive.sun) / cm
    determinant = a11 * a22 - a12 * a21
    settled = np.stack([(a12 * b2 - a22 * b1) / determinant, (a21 * b1 - a11 * b2) / determinant])
    # exp(A h) of two by two: the eigenvalues are real, because the two off-diagonal elements have one sign
    half = (a11 + a22) / 2
    root = np.sqrt((a11 - a22) ** 2 / 4 + a12 * a21)
    fast, slow = np.exp((half - root) * drive.step), np.exp((half + root) * drive.step)
    mean, slope = (fast + slow) / 2, (slow - fast) / (2 * root)
    e11, e12 = (mean + slope * (a11 - half)).tolist(), (slope * a12).tolist()
    e21, e22 = (slope * a21).tolist(), (mean + slope * (a22 - half)).tolist()
    decay = np.exp(-air * drive.step / (DENSITY * drive.volume * p["mixing"])).tolist()
    level = drive.outdoor_co2 + p["co2_offset"] + PPM * p["emission"] * drive.persons / air
    made = np.empty((2, len(air)))
    ta, tm, c = first[0], first[0] + p["first_mass"], first[1]
    for k, (sa, sm, sc) in enumerate(zip(*settled.tolist(), level.tolist(), strict=True)):
        da, dm = ta - sa, tm - sm
        ta, tm = sa + e11[k] * da + e12[k] * dm, sm + e21[k] * da + e22[k] * dm
        c = sc + decay[k] * (c - sc)
        made[0, k], made[1, k] = ta, c
    return made


def values_of(free: np.ndarray) -> dict[str, float]:
    """Parameters by name of the numbers between 0 and 1 that are fitted."""
    found = {}
    for x, (name, (low, high, scale, _)) in zip(free, BOUNDS.items(), strict=True):
        found[name] = float(low * (high / low) ** x if scale == "log" else low + (high - low) * x)
    return found


def fit(drive: Drive, measured: np.ndarray, context: int, starts: int = 6, seed: int = 0) -> dict[str, float]:
    """Parameters that fit the first ``context`` steps of the readings (2, steps) best, of several starts.

    A reading counts in standard deviations of its own channel, so that both channels weigh the same. Missing readings
    are NaN.
    """
    seen = np.isfinite(measured[:, :context])
    scale = np.nanstd(np.where(seen, measured[:, :context], np.nan), axis=1, keepdims=True)
    scale = np.where(np.isfinite(scale) & (scale > 0), scale, 1.0)
    first = first_of(measured)
    part = Drive(drive.step, drive.volume, *(getattr(drive, name)[:context] for name in SERIES))

    def residual(free: np.ndarray) -> np.ndarray:
        off = (simulate(values_of(free), part, first) - measured[:, :context]) / scale
        return np.asarray(off[seen])

    rng = np.random.default_rng(seed)
    begins = [np.full(len(BOUNDS), 0.5), *rng.uniform(0.2, 0.8, (starts - 1, len(BOUNDS)))]
    ends = [least_squares(residual, begin, bounds=(0.0, 1.0), x_scale=0.1, max_nfev=100) for begin in begins]
    return values_of(min(ends, key=lambda one: one.cost).x)


def first_of(measured: np.ndarray) -> tuple[float, float]:
    """The first reading of each channel."""
    temperature, co2 = (float(one[np.isfinite(one)][0]) for one in measured)
    return temperature, co2


SERIES = ("outdoors", "sun", "heat", "flow", "persons", "outdoor_co2")
