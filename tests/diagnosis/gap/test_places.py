"""A recording without places is refused before anything is fitted."""

import numpy as np
import pytest
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.app.project import as_toml
from diagnosis.fitting.problem import Problem
from diagnosis.gap import diagnosed
from diagnosis.gap.diagnosed import diagnose
from diagnosis.gap.places import labels_of, operators
from diagnosis.recording import read_recording
from shared.errors import RecordingError, SystemDescriptionError
from shared.system import load_system, parse_system
from shared.variables import Source
from tests.diagnosis.conftest import TRUTH, WARM_UP, exact_house
from tests.diagnosis.gap.gap_cases import candidates, changed
from tests.diagnosis.gap.room_cases import recorded, room


def with_sources(system, **of_heat):
    """The house with its heater as the input that carries missing heat."""
    heat = {"name": "heat", "description": "missing heat", "unit": "kW", "input": "P", **of_heat}
    return system.model_copy(update={"sources": [Source(**heat)]})


def test_an_operator_is_what_the_house_s_exact_recursion_says(house, house_recording):
    """One kW for three hours, from the difference of two exact runs."""
    system = with_sources(house("me"))
    path = house_recording(hours=96, noise=0.0)
    problem = Problem(Simulator(system), read_recording(path, system), warm_up=WARM_UP * 3600.0)
    z = problem.unknowns(TRUTH)
    (found,), failed = operators(problem, z, problem.nuisance.mean)
    assert (found.name, found.unit, failed) == ("heat", "kW", {})
    hours = 96
    nobody, rest = np.zeros(2 * hours), np.zeros(hours)
    pulse = np.zeros(hours)
    pulse[30:33] = 1.0
    runs = [exact_house(TRUTH, rest, rest, nobody, heater) for heater in (rest, pulse)]
    j = int(np.searchsorted(found.edges, found.edges[0] + 30 * 3600.0))
    assert found.edges[j + 1] - found.edges[j] == pytest.approx(3 * 3600.0)
    assert found.response[0, :, j] == pytest.approx((runs[1] - runs[0])[:hours], abs=2e-3)


def test_what_one_unit_brings_and_what_else_it_brings_is_taken_off(house, house_recording):
    """Persons less their heat do nothing in a house without a gas; per half a kW everything is half as large."""
    system = with_sources(house("me"), per=2.0)
    gas = Source(name="gas", unit="kg/s", input="N", per="a", less={"heat": 0.2})
    system = system.model_copy(update={"sources": [*system.sources, gas]})
    path = house_recording(hours=48, noise=0.0)
    problem = Problem(Simulator(system), read_recording(path, system), warm_up=WARM_UP * 3600.0)
    z = problem.unknowns(TRUTH)
    (heat, left), _ = operators(problem, z, problem.nuisance.mean)
    whole = operators(
        Problem(Simulator(with_sources(house("me"))), read_recording(path, system), warm_up=WARM_UP * 3600.0),
        z,
        problem.nuisance.mean,
    )[0][0]
    assert heat.response == pytest.approx(whole.response / 2, abs=1e-6)
    # a person is 0.1 kW, which are 0.2 of a source of which one unit of the input brings two
    assert np.abs(left.response).max() * TRUTH["a"] < 0.02 * np.abs(whole.response).max()


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("input", "Q", "acts on 'Q', which is not an input"),
        ("per", "R", "measured per 'R', which is not an estimated parameter"),
        ("per", 0.0, "has per = 0"),
        ("less", {"cold": 1.0}, "is less 'cold', which is no source that is declared before it"),
    ],
)
def test_a_source_that_does_not_fit_is_refused_with_a_sentence(house, field, value, sentence):
    system = house("me")
    text = system.path.read_text(encoding="utf-8")
    fields = {"name": "heat", "unit": "kW", "input": "P", field: value}
    with pytest.raises(SystemDescriptionError, match=f"sources: 'heat' .*{sentence}"):
        parse_system(f"{text}\n{as_toml({'sources': [fields]})}", system.path)


def test_sources_are_no_part_of_what_is_simulated(house):
    assert with_sources(house("me")).hash() == house("me").hash()
    assert [one.unit for one in load_system("fmus/MixedAirCO2").sources] == ["W", "kg/s"]


@pytest.mark.slow
def test_missing_heat_is_found_with_its_size(house, house_recording):
    """In the afternoons of the second half the sun heats the house by 0.6 kW more."""
    system = with_sources(house("me"))
    heat = np.zeros(240)
    heat[120:][np.arange(120) % 24 // 6 == 2] = 0.6
    nobody, rest = np.zeros(2 * 240), np.zeros(240)
    warm, base = (exact_house(TRUTH, rest, rest, nobody, heater, start=0.0) for heater in (heat, rest))
    path = changed(house_recording(hours=240, seed=6, before=240), lambda t, y: y + warm - base)
    done = diagnose(system, path, effects=candidates(system)[:1])
    (source,) = done.report.sources
    assert source.p_value <= 0.01
    assert source.verdict == done.report.balance == "balance"
    one = done.where.sources.sources[0]
    # a house of two days' memory tells the days, not the hours
    daily, truth = one.estimate.reshape(-1, 8).mean(axis=1), heat.reshape(-1, 24).mean(axis=1)
    assert np.corrcoef(daily, truth)[0, 1] > 0.85
    assert daily[5:].mean() - daily[:5].mean() == pytest.approx(0.15, rel=0.4)
    assert "missing heat" in done.report.summary[0]


@pytest.mark.slow
def test_missing_co2_does_what_a_mass_balance_says(tmp_path):
    """A bottle that leaks CO2 from noon to six on every day of a week."""
    system = room()
    record = recorded(tmp_path / "room.nc", system)
    leak, problem = 4e-5, Problem(Simulator(system), record, occupancy="measured")
    z = problem.unknowns({"gaiCO2.k": 1e-5})
    (_, gas), _ = operators(problem, z, problem.nuisance.mean)
    noon = (gas.edges[:-1] % 86400.0 >= 12 * 3600.0) & (gas.edges[:-1] % 86400.0 < 18 * 3600.0)
    # no more than in a well mixed room that the least of the air flow dilutes for ever, and some of that
    alone = gas.response[1] @ np.where(noon, leak, 0.0)
    settled = leak / np.nanmin(record.outputs[3]) * 28.97 / 44.01 * 1e6
    assert 0.1 * settled < alone.max() < settled
    assert np.abs(gas.response[0] @ np.where(noon, leak, 0.0)).max() < 0.2


@pytest.fixture
def refused(house, monkeypatch):
    """``refused(path)``: what is said of a recording; fails where the base model is fitted."""

    def begun(*_):
        raise AssertionError("the base model was fitted")

    monkeypatch.setattr(diagnosed, "begun", begun)

    def call(path):
        with pytest.raises(RecordingError) as told:
            diagnosed.diagnose(house("me"), path, effects=candidates(house("me"))[:1])
        return str(told.value)

    return call


def test_readings_of_the_first_steps_alone(house_recording, refused):
    path = changed(house_recording(hours=48), lambda t, y: np.where(t <= t[2], y, np.nan))
    assert refused(path) == (
        f"{path}: no output that counts was measured after the first 3 steps; expected readings of one throughout"
    )


def test_a_day_of_three_steps(house_recording, refused, tmp_path):
    data = xr.load_dataset(house_recording(hours=24), decode_times=False).isel(time=slice(7, None, 8))
    path = tmp_path / "third.nc"
    data.to_netcdf(path)
    assert refused(path) == f"{path}: has 3 steps of 8 h; expected at least 4"


def test_outputs_with_the_same_description_are_told_apart(house):
    system = house("me")
    (one,) = system.outputs
    outputs = [
        one.model_copy(update={"name": name, "long_name": long})
        for name, long in (("north", "air"), ("south", "air"), ("west", "wall"), ("top", None))
    ]
    assert labels_of(system.model_copy(update={"outputs": outputs})) == ["air (north)", "air (south)", "wall", "top"]
