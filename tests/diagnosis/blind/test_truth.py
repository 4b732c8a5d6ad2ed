"""The truth's FMU: the model where nothing is added, other laws where something is; and its random processes."""

import zipfile

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import sample_parameters
from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from diagnosis.blind.room import Window, autoregressive, erring, live, process_signal
from diagnosis.blind.truth import (
    Daily,
    Damped,
    Episodes,
    Fault,
    Glare,
    Hump,
    Occupant,
    Spans,
    Wander,
    load_truth,
)
from diagnosis.recording import DAY, HOUR
from fmus.render import render_model_description
from fmus.truth import build as truth_build
from shared.errors import SystemDescriptionError

PPM = 28.9647 / 44.0095 * 1e6
STILL = Piecewise.constant(0.0)
T_OUT, N, FLOW, POWER = 273.15, 6.0, 0.12, 1800.0


@pytest.fixture(scope="module")
def model(default_system):
    return Simulator(default_system)


@pytest.fixture(scope="module")
def room(truth, default_system):
    return Simulator(truth.described(default_system))


@pytest.fixture(scope="module")
def values(default_system):
    return {p.name: float(p.from_unit(0.5)) for p in default_system.parameters}


def test_shipped_file_belongs_to_its_sources(truth):
    with zipfile.ZipFile(truth.path.parent / truth.fmu) as archive:
        names = {name: archive.read(name) for name in archive.namelist()}
    table = truth_build.truth_table()
    assert names["resources/source.sha256"].decode().strip() == table.source_hash, "run python fmus/truth/build.py"
    assert names["modelDescription.xml"].decode() == render_model_description(table)
    for name, text in truth_build.truth_sources(table).items():
        assert names[f"sources/{name}"].decode() == text
    assert sum(name.startswith("binaries/") for name in names) == 4
    assert (truth.path.parent / truth.fmu).stat().st_size < 300_000
    assert validate_fmu(str(truth.path.parent / truth.fmu)) == []


@pytest.mark.parametrize("day", [15, 195])
def test_finer_walls_alone_stay_near_the_model(model, room, truth, day):
    """No effect: what is left is the walls', within 0.1 K root mean square (a sensor's noise) and 0.4 K at worst."""
    start, stop = day * DAY, (day + 14) * DAY
    outputs = []
    drawn = dict(zip(model.system.parameter_names, sample_parameters(model.system, 8, day), strict=True))
    for simulator in (model, room):
        table = build_inputs(simulator.system, root_seed=8, index=day, start=start - 5 * DAY, stop=stop)
        made = simulator.run(
            drawn, table, start=start - 5 * DAY, stop=stop, record_from=start, step=HOUR, tolerance=1e-7
        )
        outputs.append(made.outputs)
    left = outputs[1] - outputs[0]
    assert np.ptp(outputs[0][0]) > 3.0
    assert 1e-3 < np.sqrt(np.mean(left[0] ** 2)) < 0.1
    assert np.abs(left[0]).max() < 0.4
    assert np.abs(left[1]).max() < 0.5
    assert np.abs(left[3]).max() < 1e-3


def steady(simulator, values, **more):
    """TRoo [K], CO2 [ppm] after two months of the same day, actuators replayed."""
    level = {"TDryBul": T_OUT, "TSky": T_OUT, "winSpe": 5.0, "CO2Out": 420.0, "nPer": N, "QHea_in": POWER}
    level |= {"mOA_in": FLOW, "TAdj": 285.0, "CO2Adj": 900.0}
    level |= {name: more.pop(name) for name in list(more) if name in simulator.system.input_names}
    signals = {name: Piecewise.constant(level.get(name, 0.0)) for name in simulator.system.input_names}
    parameters = {**values, **{name.replace("__", "."): value for name, value in more.items()}}
    made = simulator.run(
        parameters,
        merge(signals, 0.0, 60 * DAY),
        start=0.0,
        stop=60 * DAY,
        record_from=59 * DAY,
        replay=True,
        step=HOUR,
    )
    return made.outputs[0, -1], made.outputs[1, -1]


def added(values, flow, outdoor=420.0):
    return outdoor + values["gaiCO2.k"] * N / flow * PPM


def test_air_exchange_laws_by_hand(room, values):
    """Flows by hand from the temperature that results, checked on the CO2 balance."""
    _, co2 = steady(room, values, truth__infiltration__wind=0.05)
    assert co2 == pytest.approx(added(values, FLOW + 0.05 * (5 / 4) ** 1.3), abs=0.1)
    T, co2 = steady(room, values, truth__infiltration__stack=0.05)
    stack = 0.05 * ((T - T_OUT) / 20) ** 0.65
    assert co2 == pytest.approx(added(values, FLOW + stack), abs=0.1)
    T, co2 = steady(room, values, truth__window__A=0.4, yWin=0.5)
    stack, wind = 0.2 * np.sqrt(9.81 * 1.2 * (T - T_OUT) / 290), 0.025 * 5
    assert co2 == pytest.approx(added(values, FLOW + 1.2 * 0.2 * np.hypot(stack, wind)), abs=0.1)
    _, co2 = steady(room, values, truth__mixing__fra=0.5)
    assert co2 == pytest.approx(added(values, FLOW * (1 - 0.5 * FLOW / (FLOW + 0.25))), abs=0.1)
    _, co2 = steady(room, values, truth__door__m=0.06, yDoo=1.0)
    outdoor = (420 * FLOW + 900 * 0.06) / (FLOW + 0.06)
    assert co2 == pytest.approx(added(values, FLOW + 0.06, outdoor), abs=0.1)


def test_heat_laws_by_hand(room, values):
    """In the steady state each law's heat replaces heater power watt by watt."""
    laws = {
        "truth__bridge__UA": (40.0, lambda T: 40.0 * (T_OUT - T)),
        "truth__adjacent__UA": (80.0, lambda T: 80.0 * (285.0 - T)),
        "truth__recovery__eta": (0.3, lambda T: 0.3 * FLOW * 1006 * (T - T_OUT)),
        "truth__furniture__C": (3e6, lambda T: 0.0),
    }
    for name, (amplitude, heat) in laws.items():
        T, _ = steady(room, values, **{name: amplitude})
        same, _ = steady(room, values, QHea_in=POWER + heat(T))
        assert same == pytest.approx(T, abs=5e-3), name
    base, _ = steady(room, values)
    behind, _ = steady(room, values, truth__heater__wall=0.4)
    weaker, _ = steady(room, values, QHea_in=0.6 * POWER)
    assert weaker < behind < base - 0.05  # some of what goes into the wall still reaches the room


def test_hour_by_hour_is_the_same_as_in_one_go(room, values):
    """The occupant who never opens: cutting a simulation into hours changes nothing but rounding."""
    table = {name: Piecewise.constant(0.0) for name in room.system.input_names}
    times = np.arange(0.0, 5 * DAY, HOUR)
    table["TDryBul"] = Piecewise(times, 275.0 + 5 * np.sin(2 * np.pi * times / DAY))
    table["TSky"] = Piecewise(times, 265.0 + 5 * np.sin(2 * np.pi * times / DAY))
    table["nPer"] = Piecewise(times, np.where(times % DAY > 8 * HOUR, 5.0, 0.0), "previous")
    table |= {"CO2Out": Piecewise.constant(420.0), "TSet": Piecewise.constant(294.15)}
    process = Occupant(
        kind="occupant", room="TRoo", outdoor="TDryBul", presence="nPer", offset=-1e6, indoors=0.0, outdoors=0.0,
        cold=293.0, forgets=0.0,
    )  # fmt: skip
    span = {"begin": 0.0, "stop": 4 * DAY, "step": 600.0, "tolerance": 1e-9}
    window = ("yWin", "TRoo", Window(process, table, np.random.default_rng(0)))
    whole, cut = live(room, values, table, **span), live(room, values, table, **span, window=window)
    np.testing.assert_allclose(cut.time, whole.time)
    late = whole.time > DAY
    np.testing.assert_allclose(cut.outputs[0, late], whole.outputs[0, late], atol=2e-4)
    np.testing.assert_allclose(cut.outputs[1, late], whole.outputs[1, late], atol=0.02)
    np.testing.assert_allclose(cut.states["facade.T[1]"][late], whole.states["facade.T[1]"][late], atol=2e-4)


def test_occupant_opens_when_it_is_warm_and_leaves_it_closed_when_nobody_is_there():
    process = Occupant(
        kind="occupant", room="T", outdoor="out", presence="n", offset=-25.5, indoors=1.0, outdoors=0.0,
        cold=293.65, forgets=0.0,
    )  # fmt: skip
    signals = {"n": Piecewise(np.array([0.0, 1000 * HOUR]), np.array([4.0, 0.0]), "previous")}
    signals["out"] = Piecewise.constant(288.15)
    opened = {}
    for room in (273.15 + 22.5, 273.15 + 27.5):
        count = 0
        for seed in range(400):
            window = Window(process, signals, np.random.default_rng(seed))
            count += window(0.0, room) > 0
        opened[room] = count / 400
    expected = {T: 1 / (1 + np.exp(25.5 - (T - 273.15))) for T in opened}
    for T, share in opened.items():
        assert share == pytest.approx(expected[T], abs=0.05)
    window = Window(process, signals, np.random.default_rng(1))
    window.opening = 0.6
    assert window(0.0, 300.0) == 0.6  # stays open while it is warm
    assert window(0.0, 292.0) == 0.0  # and is closed when it is cold
    window.opening = 0.6
    assert window(1001 * HOUR, 300.0) == 0.0  # or when the last one leaves
    forgetful = Window(process.model_copy(update={"forgets": 1.0}), signals, np.random.default_rng(1))
    forgetful.opening = 0.6
    assert forgetful(1001 * HOUR, 290.0) == 0.6


def test_processes_have_the_stated_statistics():
    rng, stop = np.random.default_rng(3), 400 * DAY
    ar = autoregressive(rng, 100_000, 10.0)
    assert np.std(ar) == pytest.approx(1.0, abs=0.05)
    assert np.corrcoef(ar[10:], ar[:-10])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)
    wander = process_signal(Wander(kind="wander", mean=2.0, sd=0.5, hours=10.0, low=1.0), {}, 0.0, stop, rng)
    assert wander.values.min() == 1.0
    assert np.mean(wander.values) == pytest.approx(2.0, abs=0.1)
    spans = process_signal(
        Spans(kind="spans", hours=[(22.0, 6.0)], probability=0.75, jitter=0.5, level=(0.5, 1.0)), {}, 0.0, stop, rng
    )
    at = spans.at(np.arange(2 * DAY, stop - 2 * DAY, 600.0))
    assert np.mean(at > 0) == pytest.approx(0.75 * 8 / 24, abs=0.02)
    assert np.mean(at[at > 0]) == pytest.approx(0.75, abs=0.03)
    persons = {"n": Piecewise(np.array([0.0, 200 * DAY]), np.array([0.0, 3.0]), "previous")}
    episodes = process_signal(
        Episodes(kind="episodes", presence="n", rate=0.05, hours=(1.0, 3.0)), persons, 0.0, stop, rng
    )
    hours = np.arange(0, stop, HOUR)
    assert not episodes.at(hours[hours < 200 * DAY]).any()
    assert np.mean(episodes.at(hours[hours > 200 * DAY])) == pytest.approx(1 - np.exp(-0.05 * 2.0), abs=0.02)
    hump = process_signal(Hump(kind="hump", peak=23.0, width=2.0), {}, 0.0, 2 * DAY, rng)
    assert hump.at(25 * HOUR) == pytest.approx(np.exp(-0.5))
    daily = process_signal(Daily(kind="daily", mean=5.0, swing=2.0, peak=6.0), {}, 0.0, DAY, rng)
    np.testing.assert_allclose(daily.at([6 * HOUR, 18 * HOUR]), [7.0, 3.0])
    wind = {"v": Piecewise.constant(4.0), "sun": Piecewise.constant(500.0)}
    damped = Damped(kind="damped", series="sun", reference=1000.0, by="v", by_reference=2.0)
    assert process_signal(damped, wind, 0.0, DAY, rng).at(HOUR) == pytest.approx(0.5 / 3)


def test_blinds_close_at_glare_and_open_on_another_morning():
    hours = np.arange(0, 60 * 24) * HOUR
    sun = np.where((hours % DAY > 11 * HOUR) & (hours % DAY < 15 * HOUR) & (hours // DAY % 2 == 0), 600.0, 50.0)
    signals = {
        "sun": Piecewise(hours, sun),
        "n": Piecewise(hours, ((hours % DAY) >= 8 * HOUR).astype(float), "previous"),
    }
    glare = Glare(kind="glare", series="sun", presence="n", limit=(200.0, 300.0), patience=0.0)
    closed = process_signal(glare, signals, 0.0, 60 * DAY, np.random.default_rng(0))
    assert closed.at(12 * HOUR) == 1
    assert closed.at(23 * HOUR) == 1  # nobody opens them in the evening
    assert closed.at(DAY + 7 * HOUR) == 1
    assert closed.at(DAY + 8 * HOUR) == 0
    assert closed.at(DAY + 12 * HOUR) == 0  # no sun on odd days


@pytest.mark.parametrize(
    ("fault", "size", "expected"),
    [
        ({"kind": "curve", "about": 290.0, "span": 4.0}, 0.1, lambda y, t: y + 0.1 * (y - 290) * np.abs(y - 290) / 4),
        ({"kind": "wander", "sd": 0.0}, 0.6, lambda y, t: y + 0.6),
        ({"kind": "state", "series": "wall"}, 0.25, lambda y, t: 0.75 * y + 0.25 * 280.0),
        ({"kind": "series", "series": "dew", "origin": 280.0, "reference": 5.0}, 2.0, lambda y, t: y + 2.0),
    ],
)
def test_faults_by_hand(fault, size, expected):
    time = 600.0 * np.arange(1, 1000)
    y = 293.0 + 3 * np.sin(2 * np.pi * time / DAY)
    followed = {"wall": np.full(999, 280.0), "dew": Piecewise.constant(285.0)}
    shown = erring(Fault(outputs=["T"], **fault), size, y, time, followed, STILL)
    np.testing.assert_allclose(shown, expected(y, time), atol=1e-9)


def test_clock_and_lags_delay_as_they_should():
    time = 600.0 * np.arange(1, 4321)
    y = np.sin(2 * np.pi * time / DAY)
    late = erring(Fault(outputs=["T"], kind="clock"), 1800.0, y, time, {}, STILL)
    middle = len(time) // 2
    assert late[middle] == pytest.approx(np.sin(2 * np.pi * (time[middle] + 1800.0) / DAY), abs=2e-3)
    slow = erring(Fault(outputs=["T"], kind="slow"), 7200.0, y, time, {}, STILL)
    w = 2 * np.pi * 3600.0 / DAY
    expected = np.sin(2 * np.pi * time / DAY - 2 * np.arctan(w)) / (1 + w**2)
    np.testing.assert_allclose(slow[-144:], expected[-144:], atol=1e-3)
    drift = erring(Fault(outputs=["T"], kind="walk", sd=0.0), 2.0, y, time, {}, STILL) - y
    assert drift[0] == 0
    assert drift[-1] == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('system = "MixedAirCO2"', 'system = "Other"', "is the truth of 'Other'"),
        ('effect = "plug"', 'effect = "plugs"', "'plugs' is not an effect"),
        ("step = 600.0", "step = -1.0", "step: Input should be greater than 0"),
        ('noise = "sensor"', 'noise = "sensors"', "measuring.noise is 'sensors'; expected one of none, .*sensor"),
        ("amplitudes = [", "amplitudes = [0.0, 4.0] # [", "amplitudes are 0 to 4; expected 0 < first <= last"),
    ],
)
def test_a_wrong_truth_is_refused_with_a_sentence(truth, default_system, tmp_path, old, new, sentence):
    text = truth.path.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "truth.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(SystemDescriptionError, match=sentence):
        load_truth(path, default_system)
