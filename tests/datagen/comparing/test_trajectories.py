"""One FMU against recorded trajectories that we know."""

import json

import numpy as np
import pandas as pd
import pytest

from datagen.comparing.comparison import compare
from datagen.comparing.recorded import load_recorded, series_of
from datagen.comparing.report import PICTURE
from datagen.driving.inputs import build_inputs
from datagen.driving.tables import Piecewise
from datagen.driving.weather import read_weather
from datagen.simulating.simulator import Simulator
from shared.errors import RecordingError
from tests.datagen.places import GREENSBORO

DAYS = 4


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
        ("discard_hours = 24.0", "discard_hours = -1.0", "recorded.discard_hours"),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused(default, recording, tmp_path, old, new, said):
    text = (recording / "mapping.toml").read_text()
    assert old in text
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(text.replace(old, new, 1) if old != "[recorded]" else text.replace("[recorded", "[measured"))
    with pytest.raises(RecordingError, match=said.replace("[", r"\[")):
        compare(default, recorded=mapping, data=recording)


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


def test_command_prints_what_the_function_finds(default, recording, tmp_path, capsys):
    from datagen.commands.compare import compare as command

    words = {"recorded": recording / "mapping.toml", "systems": 1, "out": tmp_path, "as_json": True}
    assert command(default.path, **words) == 0
    found = {(one["cell"], one["output"]): one for one in json.loads(capsys.readouterr().out)}
    assert found["all", "TRoo"]["unit"] == "K"
    assert found["all", "TRoo"]["rms"] < 1e-3
    assert (tmp_path / PICTURE).exists()
