"""How persons came and went within an hour, against other draws of the same occupancy and against what must be so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from datagen import simulate
from datagen.driving.occupancy import occupancy_prior
from datagen.driving.tables import Piecewise, merge
from diagnosis.fitting import inputs as meters
from diagnosis.fitting.inputs import HAAR, MEMORIES, MEMORY, SLOW, cleared, counted, crowd, drive, replayed
from diagnosis.recording import DAY, HOUR, Recording, read_recording
from shared.errors import RecordingError, SystemDescriptionError

DAYS = 7


def recording(tmp_path, hours: int, step: float = HOUR) -> Recording:
    time = step * np.arange(1, hours + 1)
    return Recording(tmp_path / "one.nc", step, time, np.zeros((1, hours)), {})


def covariances(nuisance, hours: int) -> np.ndarray:
    """Prior covariance of the deviations of quarters, shape (hours, 4, 4), from the pulses' own definition."""
    deviations = np.zeros((4 * hours, nuisance.size))
    middle = HOUR / 4 * (np.arange(4 * hours) + 0.5)
    for k in range(nuisance.size):
        turn = 0.5 * (nuisance.begin[k] + nuisance.end[k])
        deviations[(middle > nuisance.begin[k]) & (middle < turn), k] = 1.0
        deviations[(middle > turn) & (middle < nuisance.end[k]), k] = -1.0
    root = (deviations @ nuisance.factor).reshape(hours, 4, -1)
    return np.einsum("hik,hjk->hij", root, root)


@pytest.fixture(scope="module")
def rooms(default_system, tmp_path_factory):
    """True deviations of quarters, what is expected of them, and its covariance, over rooms of another seed."""
    edges = 3 * DAY + HOUR / 4 * np.arange(4 * 24 * DAYS + 1)
    quarters = occupancy_prior(default_system.occupancy, edges, 60, seed=5).reshape(60, -1, 4)
    record = recording(tmp_path_factory.mktemp("within"), 24 * DAYS)
    true, mean, spread = [], [], []
    for room in quarters:
        hourly = room.mean(axis=1)
        signal = Piecewise(record.time - HOUR, hourly, "previous")
        nuisance, shown = counted(default_system.occupancy, 0, record, signal)
        found = shown.at((HOUR / 4) * (np.arange(4 * 24 * DAYS) + 0.5)).reshape(-1, 4)
        np.testing.assert_allclose(found.mean(axis=1), hourly, atol=1e-9)
        true.append(room - hourly[:, None])
        mean.append(found - hourly[:, None])
        spread.append(covariances(nuisance, 24 * DAYS))
    return np.stack(true), np.stack(mean), np.stack(spread)


def test_what_is_expected_is_nearer_than_the_mean_and_not_biased(rooms):
    true, mean, _ = rooms
    left = np.sum((true - mean) ** 2, axis=-1)
    assert left.mean() < 0.4 * np.sum(true**2, axis=-1).mean()
    # as much of the second half over the first as there is, up or down: no part of the expected rise is left over
    rise, expected = (one[..., 2:].sum(axis=-1) - one[..., :2].sum(axis=-1) for one in (true, mean))
    slope = np.sum((rise - expected) * expected) / np.sum(expected**2)
    assert abs(slope) < 0.05


def test_the_covariance_is_as_large_as_the_errors_are(rooms):
    """And somewhat larger: what happens rarely is given more room than a Gaussian of the usual would have."""
    true, mean, spread = rooms
    errors = np.sum((true - mean) ** 2, axis=-1)
    believed = np.trace(spread, axis1=-2, axis2=-1)
    assert 0.6 < errors.mean() / believed.mean() < 1.0
    # also in the quarter of the steps that is believed to be most uncertain
    most = believed > np.quantile(believed[believed > 0], 0.75)
    assert 0.6 < errors[most].mean() / believed[most].mean() < 1.1
    # and in units of the covariance: three degrees of freedom
    some = believed > 0.05
    left = (true - mean)[some] @ HAAR.T
    covariance = HAAR @ spread[some] @ HAAR.T + 1e-4 * np.eye(3)
    distance = np.einsum("ni,nij,nj->n", left, np.linalg.inv(covariance), left)
    assert distance.mean() < 1.5 * 3
    assert np.mean(distance > 16.3) < 0.03


def test_a_single_change_is_found_where_it_was(default_system, tmp_path):
    """Twelve persons from 8:20 to 16:50 on one of two days: the means over hours tell when they came and went."""
    minutes = np.zeros(48 * 60)
    minutes[8 * 60 + 20 : 16 * 60 + 50] = 12.0
    record = recording(tmp_path, 48)
    means = Piecewise(record.time - HOUR, minutes.reshape(48, 60).mean(axis=1), "previous")
    nuisance, shown = counted(default_system.occupancy, 0, record, means)
    found = shown.at(HOUR / 4 * (np.arange(4 * 48) + 0.5))
    # held at the mean of their hour, quarters would be wrong by up to eight persons
    assert np.abs(found - minutes.reshape(-1, 15).mean(axis=1)).max() < 0.2 * 12.0
    assert (nuisance.begin >= 4 * HOUR).all()
    assert (nuisance.end <= 20 * HOUR).all()


def test_short_steps_and_an_empty_room_have_nothing_within(default_system, tmp_path):
    record = recording(tmp_path, 24, 300.0)
    signal = Piecewise(record.time - 300.0, np.arange(24.0), "previous")
    nuisance, shown = counted(default_system.occupancy, 0, record, signal)
    assert nuisance.size == 0
    assert shown is signal
    record = recording(tmp_path, 24)
    nuisance, shown = counted(default_system.occupancy, 0, record, Piecewise.constant(0.0))
    assert nuisance.size == 0
    assert not shown.at(record.time - 1.0).any()
    assert replayed(0, record, Piecewise.constant(3.0)).size == 0


def test_a_replayed_actuator_that_jumps_once_varies_as_a_uniform_time_says(tmp_path):
    """From 1 to 2 at a uniform time of one step: nobody knows when, and quarters spread by sqrt(1/2) of the halves."""
    record = recording(tmp_path, 6)
    values = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    nuisance = replayed(0, record, Piecewise(record.time - HOUR, values, "previous"))
    spread = covariances(nuisance, 6)
    assert (np.trace(spread, axis1=1, axis2=2) > 0).tolist() == [False, False, True, True, False, False]
    np.testing.assert_allclose(HAAR @ spread[2] @ HAAR.T, 0.25 * np.diag([1.0, 0.5, 0.5]), atol=1e-12)


@pytest.mark.parametrize(("lowest", "last"), [(0.0, 0.2), (-1.0, 0.0)])
def test_an_actuator_that_never_ran_backwards_did_not_within_a_step_either(tmp_path, lowest, last):
    """Beside steps of 5 it gave ``last`` above the least that it ever gives: no half of that step differs by more."""
    record = recording(tmp_path, 6)
    values = np.array([5.0, 5.0, lowest + last, 5.0, 5.0, lowest])
    nuisance = replayed(0, record, Piecewise(record.time - HOUR, values, "previous"))
    halves = np.sqrt((HAAR @ covariances(nuisance, 6) @ HAAR.T)[:, 0, 0])
    assert halves[2] == pytest.approx(last, abs=1e-9)
    assert halves[5] == pytest.approx(0.0, abs=1e-9)
    assert halves[1] == pytest.approx(0.5 * (5.0 - lowest - last))


STEPS, SD = 168, 0.01
WIDE = 10.0


def process(rng, steps: int, size: float, hours: float) -> np.ndarray:
    """An Ornstein-Uhlenbeck process, drawn step by step."""
    decay, values = np.exp(-1 / hours), np.empty(steps)
    values[0] = size * rng.standard_normal()
    for i in range(1, steps):
        values[i] = decay * values[i - 1] + size * np.sqrt(1 - decay**2) * rng.standard_normal()
    return values


def meter(rng, true: np.ndarray) -> np.ndarray:
    """Readings of it: noise of SD in all, of which a part is slow."""
    slow = process(rng, len(true), np.sqrt(SLOW) * SD, MEMORY / HOUR)
    return true + slow + np.sqrt(1 - SLOW) * SD * rng.standard_normal(len(true))


def rooms_read(count: int, steps: int = STEPS):
    """Air flows that hardly vary, and their readings."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        size = SD * np.exp(rng.uniform(*np.log([meters.SMALLEST, 2.0])))
        true = 0.2 + process(rng, steps, size, rng.choice(MEMORIES) / HOUR)
        yield true, meter(rng, true)


def test_it_is_the_expectation_of_gaussian_processes(monkeypatch):
    monkeypatch.setattr(meters, "NEGLIGIBLE", 0.0)
    _, readings = next(rooms_read(1, 40))
    readings[[3, 20, 21]] = np.nan
    found = cleared(readings, SD, HOUR)
    seen, time = np.isfinite(readings), np.arange(40.0)
    mean, spread = readings[seen].mean(), readings[seen].std()
    apart = np.abs(time[:, None] - time)
    noise = SD**2 * (SLOW * np.exp(-apart * HOUR / MEMORY) + (1 - SLOW) * np.eye(40))
    total, values, covariance = [], [], []
    for size in np.geomspace(meters.SMALLEST * SD, 3 * max(spread, SD), meters.SIZES):
        for memory in MEMORIES:
            own = size**2 * np.exp(-apart * HOUR / memory) + WIDE**2  # the level, as good as unknown
            both = (own + noise)[np.ix_(seen, seen)]
            gain = np.linalg.solve(both, own[seen]).T
            left = readings[seen] - mean
            total.append(-0.5 * (left @ np.linalg.solve(both, left) + np.linalg.slogdet(both)[1]))
            values.append(mean + gain @ left)
            covariance.append(own - gain @ own[seen])
    share = np.exp(np.array(total) - max(total))
    share /= share.sum()
    expected = share @ np.array(values)
    np.testing.assert_allclose(found.values, expected, atol=1e-6)
    away = np.array(values) - expected
    wide = np.einsum("k,kij->ij", share, np.array(covariance)) + (share * away.T) @ away
    np.testing.assert_allclose(found.covariance(np.eye(40)), wide, atol=1e-8)
    day = np.kron(np.eye(5), np.full(8, 1 / 8))
    np.testing.assert_allclose(found.covariance(day), day @ wide @ day.T, atol=1e-8)


def test_errors_are_smaller_and_as_large_as_it_says():
    apart, before, ratio = [], [], []
    for true, readings in rooms_read(40):
        found = cleared(readings, SD, HOUR)
        for hours in (1, 6):
            means = np.kron(np.eye(STEPS // hours), np.full(hours, 1 / hours))
            ratio.append(np.mean((means @ (found.values - true)) ** 2 / np.diag(found.covariance(means))))
        apart.append(np.mean((found.values - true) ** 2))
        before.append(np.mean((readings - true) ** 2))
    assert np.mean(apart) < 0.4 * np.mean(before)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("sd", [0.0, SD])
def test_without_noise_or_variation_readings_are_held(sd):
    readings = np.full(30, 5.0) if sd else np.linspace(1.0, 2.0, 30)
    lost = readings.copy()
    lost[[0, 7]] = np.nan
    found = cleared(lost, sd, HOUR)
    expected = readings.copy()
    expected[0], expected[7] = readings[1], readings[6]
    np.testing.assert_array_equal(found.values, expected)
    assert not found.covariance(np.eye(30)).any()


@pytest.fixture(scope="module")
def record(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "room.nc"
    simulate(default_system, hours=72.0, seed=9, out=path)
    return read_recording(path, default_system)


def test_inputs_are_the_recordings(record, default_system):
    """An instant is joined to the next by a straight line; a mean holds over its step."""
    driven = drive(default_system, record, warm_up=DAY)
    assert (driven.begin, driven.start, driven.stop) == (record.start - DAY, record.start, record.stop)
    table = merge(driven.signals, driven.begin, driven.stop)
    k = default_system.input_names.index("TDryBul")
    np.testing.assert_allclose(table.at(record.time)[:, k], record.inputs["TDryBul"], atol=1e-4)
    n = default_system.input_names.index("nPer")
    edges = np.concatenate([[record.start], record.time])
    np.testing.assert_allclose(table.means(edges)[:, n], record.inputs["nPer"], atol=1e-4)


def test_weather_that_an_import_computed_is_doubted(record, default_system):
    """A sky that sends 20 W/m2 more or less by Stefan and Boltzmann's law, and nothing at night of the sun."""
    assert drive(default_system, record, warm_up=DAY).doubted == {}
    worked_out = replace(record, computed=dict.fromkeys(["HFac", "TSky", "TDryBul"], "computed"))
    driven = drive(default_system, worked_out, warm_up=DAY)
    assert list(driven.doubted) == ["TSky", "HFac"]  # no import computes an air temperature
    assert driven.assumed["HFac"] == "computed"
    sky, sun = record.inputs["TSky"], record.inputs["HFac"]
    sent = 5.670374e-8 * (sky + driven.doubted["TSky"].sd) ** 4 - 5.670374e-8 * sky**4
    np.testing.assert_allclose(sent, 20.0, rtol=0.05)
    dark = sun == 0
    assert dark.any() and (driven.doubted["HFac"].sd[dark] == 0).all() and (driven.doubted["HFac"].sd[~dark] > 0).all()
    days = np.kron(np.eye(3), np.full(24, 1 / 24))
    covariance = driven.doubted["TSky"].covariance(days)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(days @ driven.doubted["TSky"].sd)
    assert covariance[0, 1] == pytest.approx(meters.SHARED * np.sqrt(covariance[0, 0] * covariance[1, 1]))


@pytest.mark.parametrize(("hours", "days"), [(1, 1), (25, 2)])
def test_whole_first_days_stand_before_the_recording(record, default_system, hours, days):
    driven = drive(default_system, record, warm_up=hours * HOUR)
    assert driven.begin == record.start - days * DAY
    signal = driven.signals["TDryBul"]
    first = record.time[record.time <= record.start + DAY]
    for back in range(1, days + 1):
        np.testing.assert_allclose(signal.at(first - back * DAY), signal.at(first), rtol=1e-12)
    held = driven.signals["nPer"]
    middles = first - 0.5 * record.step
    np.testing.assert_array_equal(held.at(middles - DAY), held.at(middles))


def test_nothing_is_replayed_where_no_actuator_is_measured(record, default_system):
    """The page would say that actuators were replayed."""
    inputs = [one for one in default_system.inputs if one.source != "measured"]
    with pytest.raises(SystemDescriptionError, match=r"system.toml: inputs: none has the source 'measured'"):
        drive(default_system.model_copy(update={"inputs": inputs}), record, warm_up=0.0, replay=True)


def test_what_drives_a_model_without_controllers_must_have_been_measured(house, house_recorded, tmp_path):
    """Nothing in the FMU takes its place, and the description's 0 degC is no weather."""
    system = house("me")
    record = read_recording(house_recorded(tmp_path, hours=72), system)
    assert drive(system, record, warm_up=0.0).assumed == {}
    without = {name: values for name, values in record.inputs.items() if name != "To"}
    with pytest.raises(RecordingError, match=r"simulation: To \[degC\]; .* under \[variables\.To\]"):
        drive(system, replace(record, inputs=without), warm_up=0.0)
    # an import has said so, and says it still
    stands_in = replace(record, assumed={"To": "assumed, not measured"})
    assert drive(system, stands_in, warm_up=0.0).assumed == {"To": "assumed, not measured"}


def test_uncounted_persons_of_several_inputs_are_refused(default_system):
    """Where a system is simulated they are one crowd (datagen.driving.inputs); a fit would make them two."""
    (persons,) = [one for one in default_system.inputs if one.source == "occupancy"]
    two = default_system.model_copy(
        update={"inputs": [*default_system.inputs, persons.model_copy(update={"name": "breathing"})]}
    )
    time = HOUR * np.arange(1, 25)
    counted = {name: np.ones(24) for name in (persons.name, "breathing")}
    record = Recording(Path("room.nc"), HOUR, time, np.zeros((len(two.outputs), 24)), counted)
    assert crowd(two, record, None) == "measured"
    said = rf"room\.nc: persons .*system\.toml has 2 inputs for them \({persons.name}, breathing\); expected"
    for inputs, wanted in (({}, None), ({persons.name: np.ones(24)}, None), (counted, "unknown")):
        with pytest.raises(RecordingError, match=said):
            crowd(two, replace(record, inputs=inputs), wanted)
    assert crowd(default_system, replace(record, inputs={}), None) == "unknown"
