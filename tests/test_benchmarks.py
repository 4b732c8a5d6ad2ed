"""The benchmarks are run by hand, for hours: that they still can be is told here."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

SCRIPTS = Path(__file__).parent / "benchmarks"


@pytest.fixture
def beside(monkeypatch):
    """What a script finds when it is run: the files beside it."""
    monkeypatch.syspath_prepend(str(SCRIPTS))


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda one: one.stem)
def test_a_benchmark_finds_all_that_it_imports(script, beside):
    assert runpy.run_path(str(script), run_name="tried")["__doc__"]


@pytest.fixture
def a_drive(beside):
    """Two weeks of an office by the hour, heated in the morning; what a grey-box model of it is, and its parameters."""
    import greybox

    rng, hour = np.random.default_rng(1), np.arange(336)
    wave = np.sin(2 * np.pi * (hour - 9) / 24)
    works = (hour % 24 > 8) & (hour % 24 < 18) & (hour // 24 % 7 < 5)
    drive = greybox.Drive(
        3600.0,
        75.0,
        outdoors=278 + 4 * wave + np.cumsum(rng.normal(0, 0.2, 336)),
        sun=400 * np.maximum(0, wave) * rng.uniform(0.3, 1, 14).repeat(24),
        heat=np.where(hour % 24 < 7, 0.0, 800 * rng.uniform(size=336)),
        flow=np.where(works, 0.08, 0.016),
        persons=np.where(works, rng.integers(0, 6, 336), 0.0),
        outdoor_co2=np.full(336, 420.0),
    )
    values = greybox.values_of(np.full(len(greybox.BOUNDS), 0.5)) | {
        "air_capacity": 4e3, "mass_capacity": 1e5, "air_to_mass": 8.0, "air_to_outdoors": 0.2, "mass_to_outdoors": 0.05,
        "air_to_neighbour": 0.1, "neighbour": 294.0, "sun_to_air": 0.005, "sun_to_mass": 0.02, "heat_share": 1.0,
        "flow_share": 1.0, "leak": 3e-5, "emission": 9e-6, "mixing": 1.0, "co2_offset": 30.0, "first_mass": 0.5,
    }  # fmt: skip
    return greybox, drive, values


def test_the_grey_box_model_solves_its_equations(a_drive):
    """Beside an integrator that knows nothing of exponentials."""
    greybox, drive, p = a_drive
    made = greybox.simulate(p, drive, (293.0, 450.0))
    v, cp = drive.volume, greybox.HEAT

    def slope(t: float, x: np.ndarray, k: int) -> list[float]:
        ta, tm, c = x
        to, air = drive.outdoors[k], p["flow_share"] * drive.flow[k] + p["leak"] * v
        gain = p["sun_to_air"] * v * drive.sun[k] + greybox.PERSON * drive.persons[k] + p["heat_share"] * drive.heat[k]
        exchange = (p["air_to_outdoors"] * v + cp * air) * (to - ta) + p["air_to_neighbour"] * v * (p["neighbour"] - ta)
        inward = p["mass_to_outdoors"] * v * (to - tm) + p["sun_to_mass"] * v * drive.sun[k]
        fresh = (
            air * (drive.outdoor_co2[k] + p["co2_offset"] - c)
            + 1e6 * 28.9647 / 44.0095 * p["emission"] * (drive.persons[k])
        )
        between = p["air_to_mass"] * v * (tm - ta)
        return [
            (between + exchange + gain) / (p["air_capacity"] * v),
            (inward - between) / (p["mass_capacity"] * v),
            fresh / (1.2 * v * p["mixing"]),
        ]

    state = np.array([293.0, 293.0 + p["first_mass"], 450.0])
    for k in range(30):
        state = solve_ivp(slope, (0, 3600), state, args=(k,), rtol=1e-9, atol=1e-9, method="LSODA").y[:, -1]
        assert made[:, k] == pytest.approx(state[[0, 2]], abs=1e-5)
