"""Comparisons: two FMUs, and one FMU against recorded trajectories that we know."""

import json
import subprocess
import sys
import zipfile
from copy import copy
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from datagen.comparing.comparison import Comparison, compare
from datagen.comparing.matching import handed_on, inputs_for, unmatched
from datagen.comparing.recorded import load_recorded, series_of
from datagen.comparing.report import NUMBERS, PICTURE, TABLE, write_report
from datagen.driving.inputs import build_inputs
from datagen.driving.tables import InputTable, Piecewise
from datagen.driving.weather import read_weather
from datagen.fmi.fmu import Fmu
from datagen.simulating.simulator import Simulator
from shared.errors import RecordingError, SystemDescriptionError
from shared.system import load_system, parse_system
from tests.datagen.places import GREENSBORO

ROOT = Path(__file__).resolve().parents[3]
TOML = ROOT / "fmus" / "MixedAirCO2" / "system.toml"
DAYS = 4


@pytest.fixture(scope="module")
def finer(tmp_path_factory):
    """The default system with walls of nine nodes in place of three."""
    pytest.importorskip("ziglang")
    folder = tmp_path_factory.mktemp("finer")
    fmu = folder / "fine.fmu"
    command = [sys.executable, "fmus/build.py", "--nodes", "9", "--platforms", "native", "--out", str(fmu)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return parse_system(TOML.read_text(encoding="utf-8").replace("../MixedAirCO2.fmu", fmu.name), folder / "fine.toml")


@pytest.fixture(scope="module")
def default():
    return load_system(TOML)


# ---------------------------------------------------------------- two FMUs


def test_a_system_is_like_itself(default):
    found = compare(default, default, systems=2, hours=48)
    assert found.first.shape == (2, 4, 48)
    assert np.array_equal(found.first, found.second)
    assert all((row.rms == 0).all() and (row.largest == 0).all() for row in found.rows())


@pytest.mark.slow
def test_finer_walls_move_the_temperature_but_not_the_air(default, finer):
    found = compare(default, finer, systems=2, hours=720, seed=3)
    rows = {row.cell: row for row in found.rows()}
    temperature, co2, _, flow = rows["all"].rms
    # the walls are the only difference: the room feels it, the air exchange must not
    assert 0.005 < temperature < 0.15
    assert co2 < 0.02
    assert flow < 1e-4
    # a wall of three nodes stores as much heat as one of nine: no lasting bias
    assert abs(rows["all"].bias[0]) < 0.3 * temperature
    picked = found.differences[:, 0]
    assert rows["all"].rms[0] == pytest.approx(np.sqrt(np.mean(picked**2)))
    assert rows["1"].largest[0] == pytest.approx(np.abs(picked[1]).max())
    assert rows["nPer: occupied"].steps + rows["nPer: empty"].steps == picked.size


def test_both_get_the_same_inputs_whatever_their_order(default, finer):
    turned = finer.model_copy(update={"fmu": str(default.fmu_path), "inputs": finer.inputs[::-1]})
    found = compare(default, turned, systems=1, hours=72)
    np.testing.assert_allclose(found.second, found.first, rtol=1e-9)


def test_what_does_not_fit_is_refused(default):
    parameters = [one for one in default.parameters if one.name != "roo.V"]
    with pytest.raises(SystemDescriptionError, match=r"has no parameter 'roo.V'"):
        compare(default, default.model_copy(update={"parameters": parameters}))
    inputs = [one.model_copy(update={"unit": "degC"}) if one.name == "TSky" else one for one in default.inputs]
    with pytest.raises(SystemDescriptionError, match="inputs 'TSky' has unit 'degC'; expected 'K'"):
        compare(default, default.model_copy(update={"inputs": inputs}))
    table = InputTable(
        ("TSky",), np.array([0.0, 1.0]), np.full((1, 1), 280.0), np.full((1, 1), 281.0), np.zeros(2, bool)
    )
    some = default.model_copy(update={"inputs": [one for one in default.inputs if one.name in ("CO2Out", "TSky")]})
    made = inputs_for(some, table)
    assert dict(zip(made.names, made.left[0], strict=True)) == {"TSky": 280.0, "CO2Out": 420.0}
    with pytest.raises(SystemDescriptionError, match="'TDryBul' comes from weather"):
        inputs_for(default, table)
    with pytest.raises(SystemDescriptionError, match="compared with nothing"):
        compare(default)


def test_what_only_one_has_is_told(default, tmp_path, caplog):
    """The second estimates one parameter more, which the FMU was made with at a value of its own."""
    fewer = [one for one in default.parameters if one.name != "roo.V"]
    first = default.model_copy(update={"parameters": fewer})
    with zipfile.ZipFile(default.fmu_path) as archive:
        tree = ElementTree.fromstring(archive.read("modelDescription.xml"))
    start = tree.find(".//ScalarVariable[@name='roo.V']/Real").get("start")
    with caplog.at_level("WARNING", "zeroshot"):
        found = compare(first, default, systems=1, hours=24)
    said = "parameters of MixedAirCO2.fmu that MixedAirCO2.fmu does not draw are held at its own values: "
    said += f"roo.V ({start} m3)"
    assert found.notes == (said,)
    assert said in caplog.text
    write_report(found, tmp_path)
    assert f"\n- {said}\n\n| |" in (tmp_path / TABLE).read_text()
    fixed = default.model_copy(update={"parameters": fewer, "fixed": {**default.fixed, "roo.V": float(start)}})
    assert np.array_equal(compare(fixed, fixed, systems=1, hours=24).first, found.second)


def test_what_the_first_holds_fixed_the_second_gets_too(default):
    """One FMU for both, so that equal values show as equal trajectories."""
    volume = next(one for one in default.parameters if one.name == "roo.V").max
    fewer = {"parameters": [one for one in default.parameters if one.name != "roo.V"]}
    ours = {**default.fixed, "roo.V": volume, "CO2_start": 1500.0}
    first = default.model_copy(update={**fewer, "fixed": ours})
    drawn = compare(first, default, systems=1, hours=24)  # the second would draw the volume, and leaves CO2_start
    assert np.array_equal(drawn.first, drawn.second)
    assert drawn.notes == ()
    otherwise = default.model_copy(update={**fewer, "fixed": {**ours, "CO2_start": 600.0}})
    found = compare(first, otherwise, systems=1, hours=24)
    said = "values under [fixed] of MixedAirCO2.fmu are not those of MixedAirCO2.fmu: CO2_start (600 in place of 1500)"
    assert found.notes == (said,)
    alone = compare(otherwise, otherwise, systems=1, hours=24)
    assert np.array_equal(found.second, alone.first)
    assert not np.array_equal(found.first, alone.first)


def test_what_the_second_cannot_hold_fixed_is_told(default):
    first = default.model_copy(update={"fixed": {"CO2_start": 500.0}})
    fmus = Fmu(default.fmu_path), Fmu(default.fmu_path)
    assert handed_on(first, default, fmus) == {"CO2_start": 500.0}
    found = fmus[1].variables.pop("CO2_start")
    assert handed_on(first, default, fmus) == {}
    said = "parameters that MixedAirCO2.fmu has under [fixed] are none of MixedAirCO2.fmu: CO2_start"
    assert unmatched(first, default, fmus[1]) == [said]
    fmus[1].variables["CO2_start"] = copy(found)  # its description is another Fmu's, too
    fmus[1].variables["CO2_start"].unit = "kg/kg"
    with pytest.raises(SystemDescriptionError, match=r"fixed 'CO2_start' has unit 'ppm' in .* and 'kg/kg' in"):
        handed_on(first, default, fmus)


def test_inputs_that_only_one_has_are_told(default):
    names = ("CO2Out", "nPer")
    some = default.model_copy(update={"inputs": [one for one in default.inputs if one.name not in names]})
    fmu = Fmu(default.fmu_path)
    assert unmatched(default, some, fmu) == ["inputs of MixedAirCO2.fmu are not used by MixedAirCO2.fmu: CO2Out, nPer"]
    constant = default.model_copy(update={"inputs": [one for one in default.inputs if one.name != "CO2Out"]})
    (said,) = unmatched(constant, default, fmu)
    assert said.endswith("does not have rest at their declared values: CO2Out (420 ppm)")
    assert compare(default, default, systems=1, hours=24).notes == ()


# ---------------------------------------------------------------- recorded trajectories

MAPPING = """
[recorded]
cases = "rooms.csv"
name = "room"
series = "room{name}.csv"
shared = "weather.csv"
time = "t"
jumps = "after"
discard_hours = 24.0
[recorded.parameters]
PARAMETERS
[recorded.inputs]
TDryBul = { column = "outdoor_degC", add = 273.15 }
TSky = { column = "sky" }
winSpe = { column = "wind" }
HFac = { column = "sun" }
nPer = { column = "n", interpolation = "previous" }
[recorded.outputs]
TRoo = { column = "T_degC", add = 273.15 }
CO2 = { column = "ppm", add = 420.0 }
QHea = { column = "kW", factor = 1000.0 }
[recorded.fixed]
CO2_start = 420.0
"""


@pytest.fixture(scope="module")
def recording(default, tmp_path_factory):
    """What another tool would write about two rooms: here the default FMU itself, row by row, in other units.

    The heater power of the second room is 250 W higher than it was.
    """
    folder = tmp_path_factory.mktemp("recording")
    simulator = Simulator(
        default.model_copy(update={"outputs": [one.model_copy(update={"method": "point"}) for one in default.outputs]})
    )
    rng = np.random.default_rng(5)
    hours = np.arange(24 * DAYS + 1)
    stop = 3600.0 * hours[-1]
    drawn = build_inputs(default, root_seed=1, index=0, start=0.0, stop=stop + 3600.0, excitation=False)
    at = dict(zip(drawn.names, drawn.at(3600.0 * hours).T, strict=True))
    persons = rng.integers(0, 12, len(hours))
    overrides = {name: Piecewise(3600.0 * hours, at[name]) for name in ("TDryBul", "TSky", "winSpe", "HFac")}
    overrides["nPer"] = Piecewise(3600.0 * hours, persons.astype(float), "previous")
    columns = {name: f"p{k}" for k, name in enumerate(default.parameter_names)}
    rooms = []
    for room in (1, 2):
        values = {p.name: float(p.from_unit(0.3 * room)) for p in default.parameters}
        table = build_inputs(
            default, root_seed=0, index=0, start=0.0, stop=stop + 1.0, excitation=False, overrides=overrides
        )
        begin = 1e-3  # values just after each hour, as a tool writes them that handles the event first
        made = simulator.run(
            {**values, "CO2_start": 420.0}, table, start=0.0, record_from=begin, stop=stop + begin, step=3600.0
        )
        T, co2, heat, _ = np.concatenate([np.full((4, 1), np.nan), made.outputs], axis=1)
        T[0], co2[0], heat[0] = 293.15, 420.0, 0.0
        frame = {"t": 3600.0 * hours, "T_degC": T - 273.15, "ppm": co2 - 420.0, "n": persons}
        frame["kW"] = (heat + 250.0 * (room == 2)) / 1000.0
        pd.DataFrame(frame).to_csv(folder / f"room{room}.csv", index=False)
        rooms.append({"room": room, **{columns[name]: value for name, value in values.items()}})
    pd.DataFrame(rooms).to_csv(folder / "rooms.csv", index=False)
    weather = {"t": 3600.0 * hours, "outdoor_degC": at["TDryBul"] - 273.15, "sky": at["TSky"]}
    pd.DataFrame({**weather, "wind": at["winSpe"], "sun": at["HFac"]}).to_csv(folder / "weather.csv", index=False)
    lines = "\n".join(f'"{name}" = "{column}"' for name, column in columns.items())
    (folder / "mapping.toml").write_text(MAPPING.replace("PARAMETERS", lines))
    return folder


def test_a_recording_of_the_fmu_itself_is_met(default, recording):
    found = compare(default, recorded=recording / "mapping.toml")
    assert [one.name for one in found.outputs] == ["TRoo", "CO2", "QHea"]
    assert found.first.shape == (2, 3, 24 * (DAYS - 1) - 1)  # less a day, and the row with no after
    rows = {row.cell: row for row in found.rows()}
    assert rows["1"].largest[0] < 1e-3
    assert rows["1"].largest[1] < 1e-2
    # set points jump at hours, so a heater power read on the other side of the jump would be far off
    assert rows["1"].largest[2] < 1.0
    np.testing.assert_allclose(rows["2"].bias, [0.0, 0.0, 250.0], atol=0.1)
    assert found.time.min() > 86400.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "room"', 'name = "house"', "rooms.csv: no column 'house'; found room, p0"),
        ('TSky = { column = "sky" }', "", "no column for 'TSky', which comes from weather"),
        ("TRoo =", "TRoom =", "recorded.outputs: 'TRoom' is not declared"),
        ('"roo.V" = "p3"', "", "no column for 'roo.V'"),
        ("discard_hours = 24.0", "discard_hours = -1.0", "recorded.discard_hours"),
        ("[recorded]", "[measured]", "tables are measured"),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused(default, recording, tmp_path, old, new, said):
    text = (recording / "mapping.toml").read_text()
    assert old in text
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(text.replace(old, new, 1) if old != "[recorded]" else text.replace("[recorded", "[measured"))
    with pytest.raises(RecordingError, match=said.replace("[", r"\[")):
        compare(default, recorded=mapping, data=recording)


def test_gaps_and_uneven_times_are_refused(default, recording, tmp_path):
    for path in recording.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    room = pd.read_csv(recording / "room1.csv")
    room.drop(index=7).to_csv(tmp_path / "room1.csv", index=False)
    with pytest.raises(RecordingError, match="'t' is not evenly spaced"):
        compare(default, recorded=tmp_path / "mapping.toml")
    room.assign(ppm=room["ppm"].where(room.index != 4)).to_csv(tmp_path / "room1.csv", index=False)
    with pytest.raises(RecordingError, match=r"'ppm' has .nan. in row 5"):
        compare(default, recorded=tmp_path / "mapping.toml")
    assert len(load_recorded(tmp_path / "mapping.toml", default)[1]) == 2


def test_times_that_are_rounded_are_of_the_mean_step(default, recording, tmp_path):
    """Each step a millionth longer than those before it at most; together they are far from a multiple of the first."""
    for path in recording.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    for path in (tmp_path / "room1.csv", tmp_path / "weather.csv"):
        table = pd.read_csv(path)
        times = table["t"].to_numpy()
        late = np.maximum(0.0, np.arange(len(times)) - 10)
        table.assign(t=times + 0.9e-6 * (times[1] - times[0]) * late).to_csv(path, index=False)
    found = compare(default, recorded=tmp_path / "mapping.toml", systems=1)
    assert found.rows()[0].rms[0] < 1e-2  # our set points jump a part of a second before the rows
    room = pd.read_csv(tmp_path / "room1.csv")
    times = np.arange(20_000) * 3600.0
    times[10_000:] += 0.9e-6 * 3600 * np.arange(10_000)  # half an hour in the end
    pd.DataFrame({name: np.resize(room[name], len(times)) for name in room}).assign(t=times).to_csv(
        tmp_path / "room1.csv", index=False
    )
    with pytest.raises(RecordingError, match="'t' is not evenly spaced"):
        compare(default, recorded=tmp_path / "mapping.toml", systems=1)


def test_a_mapping_reads_the_sun_of_a_weather_file(default, recording, file_rows, tmp_path):
    for path in recording.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    time, columns, place = file_rows
    weather = pd.read_csv(tmp_path / "weather.csv")
    rows = slice(0, len(weather) - 1)
    for name, values in zip(("dni", "dhi", "ghi"), columns, strict=True):
        weather[name] = np.append(0.0, values[rows])  # time zero is the end of the year's last night
    weather.to_csv(tmp_path / "weather.csv", index=False)
    mapping = tmp_path / "mapping.toml"
    text = mapping.read_text().replace('HFac = { column = "sun" }\n', "")
    sun = '[recorded.sun]\ninput = "HFac"\nmethod = "mean"\n' + "".join(f'{k} = "{k}"\n' for k in ("dni", "dhi", "ghi"))
    mapping.write_text(text + sun + "".join(f"{name} = {value}\n" for name, value in place.items()))
    spec, cases = load_recorded(mapping, default)
    table = series_of(spec, cases[0], default)[2]
    at = time[: 24 * (DAYS - 1)]
    found = table.at(at)[:, table.names.index("HFac")]
    wanted = read_weather(default.weather, GREENSBORO, default.path.parent).values("poa_global")[1 : len(at) + 1]
    np.testing.assert_allclose(found, wanted, atol=0.01)
    mapping.write_text(mapping.read_text().replace('"mean"', '"point"'))
    with pytest.raises(RecordingError, match=r"weather.csv: recorded.sun: method is 'point'"):
        series_of(load_recorded(mapping, default)[0], cases[0], default)
    room = pd.read_csv(tmp_path / "room1.csv")
    room.assign(ghi=0.0).to_csv(tmp_path / "room1.csv", index=False)
    with pytest.raises(RecordingError, match=r"has the column 'dni' of recorded.sun, others are in .*room1.csv"):
        series_of(load_recorded(mapping, default)[0], cases[0], default)


# ---------------------------------------------------------------- report


def test_report_holds_the_numbers_of_the_comparison(default, tmp_path):
    time = np.tile(3600.0 * np.arange(1, 25), (1, 1))
    first = np.zeros((1, 2, 24))
    second = first + np.array([3.0, -4.0])[None, :, None]
    mask = np.zeros((1, 24), dtype=bool)
    mask[0, :6] = True
    second[0, 0, :6] = 5.0
    made = Comparison(("a", "b"), default.outputs[:2], ["0"], time, first, second, {("regime", "night"): mask})
    write_report(made, tmp_path)
    table = pd.read_csv(tmp_path / NUMBERS).set_index(["cell", "output"])
    assert table.loc[("night", "TRoo"), "bias"] == 5.0
    assert table.loc[("night", "TRoo"), "steps"] == 6
    assert table.loc[("all", "TRoo"), "rms"] == pytest.approx(np.sqrt((6 * 25 + 18 * 9) / 24))
    assert table.loc[("all", "CO2"), "bias"] == -4.0
    assert "| regime | night | 6 | +5, 5, 5 | -4, 4, 4 |" in (tmp_path / TABLE).read_text()
    assert (tmp_path / PICTURE).read_bytes()[:4] == b"\x89PNG"


def test_command_prints_what_the_function_finds(default, recording, tmp_path, capsys):
    from datagen.commands.compare import compare as command

    words = {"recorded": recording / "mapping.toml", "systems": 1, "out": tmp_path, "as_json": True}
    assert command(default.path, **words) == 0
    found = {(one["cell"], one["output"]): one for one in json.loads(capsys.readouterr().out)}
    assert found["all", "TRoo"]["unit"] == "K"
    assert found["all", "TRoo"]["rms"] < 1e-3
    assert (tmp_path / PICTURE).exists()
