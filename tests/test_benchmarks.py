"""The benchmarks are run by hand, for hours: that they still can be is told here."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis.blind.intervals import share
from diagnosis.blind.score_report import by_chance, percent
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Sized, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set

SCRIPTS = Path(__file__).parent / "benchmarks"


@pytest.fixture
def beside(monkeypatch):
    """What a script finds when it is run: the files beside it."""
    monkeypatch.syspath_prepend(str(SCRIPTS))


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda one: one.stem)
def test_a_benchmark_finds_all_that_it_imports(script, beside):
    assert runpy.run_path(str(script), run_name="tried")["__doc__"]


def test_shares_by_condition_are_those_of_the_score_with_its_intervals(beside, tmp_path, capsys, monkeypatch):
    """Also of a run that was stopped, of verdicts that do not say how long the processor worked."""
    said = Verdict(verdict="effect", probabilities={"a": 0.9, "b": 0.1, "c": 0.0}, named=["a"])
    said = said.model_copy(update={"sizes": {"a": Sized(value=3.0, low=2.0, high=4.0)}})
    ones = [
        Case("none", truth="no_gap", verdict=said),
        *(Case("library", (name,), room=3.0, verdict=said) for name in "aab"),
        Case("library", ("a",), room=3.0, verdict=said),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    (results / "verdicts" / "0004.json").unlink()
    monkeypatch.setattr("sys.argv", ["by_condition.py", *map(str, (folder, answers, results)), "--first", "4"])
    runpy.run_path(str(SCRIPTS / "by_condition.py"), run_name="__main__")
    told = capsys.readouterr().out
    done = score(folder, answers, results, first=4)
    alarms, right = percent(done.false_alarms), percent(done.named_rightly)
    chance = by_chance(done.names.by_size[0].chance)
    assert chance.endswith("1.0 of 4)")  # one of three candidates, in three recordings of four
    assert f"| simulated | all | {alarms} | {right} | {chance} |" in told
    assert f"| simulated | a | {right} |" in told
    assert f"| 1 | {right} | {chance} |" in told
    assert f"rightly named: {percent(share([True, True]))}" in told


def test_a_room_to_forecast_is_read_as_a_recording(beside, default_system, tmp_path):
    unseen = runpy.run_path(str(SCRIPTS / "forecast.py"), run_name="tried")["unseen"]
    record = unseen(default_system, 5, 0, "sensor", 24.0, 24.0, tmp_path)
    assert record.outputs.shape == (len(default_system.outputs), 48)
    assert np.isfinite(record.outputs).all()


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


def test_the_grey_box_model_finds_the_parameters_of_its_own_data(a_drive):
    """From a week with sensors' noise; and it forecasts the second week to twice that noise."""
    greybox, drive, truth = a_drive
    made = greybox.simulate(truth, drive, (293.0, 450.0))
    read = made + np.array([[0.05], [5.0]]) * np.random.default_rng(2).normal(size=made.shape)
    read[:, 40:45] = np.nan
    found = greybox.fit(drive, read, 168, starts=2)
    for name in ("mass_capacity", "air_to_mass", "heat_share", "flow_share", "emission", "mixing"):
        assert found[name] == pytest.approx(truth[name], rel=0.2), name
    assert found["co2_offset"] == pytest.approx(30.0, abs=3.0)
    again = greybox.simulate(found, drive, greybox.first_of(read))
    assert (np.sqrt(np.mean((again - made)[:, 168:] ** 2, axis=1)) < (0.1, 10.0)).all()


def test_a_day_is_repeated_from_where_it_was_read(beside):
    import real_rooms

    read = np.concatenate([np.arange(50.0), np.full(30, np.nan)])[None]
    read[0, 45] = np.nan
    made = real_rooms.repeated(read, 50, 24)[0, 50:]
    expected = np.concatenate([np.arange(26.0, 50.0), np.arange(26.0, 32.0)])
    expected[expected == 45] = 21.0
    assert np.array_equal(made, expected)
