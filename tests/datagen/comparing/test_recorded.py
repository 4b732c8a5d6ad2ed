"""Recorded trajectories: compared as they are; what cannot be one table is refused before anything is simulated."""

import numpy as np
import pandas as pd
import pytest

from datagen.comparing import comparison, recorded
from datagen.comparing.comparison import compare
from datagen.driving.inputs import build_inputs
from datagen.driving.tables import Piecewise
from datagen.simulating.simulator import Simulator
from shared.errors import RecordingError
from shared.system import load_system

HOURS = np.arange(13)
KNOWN = {"floor.layer[1].R": 0.0, "floor.layer[2].R": 0.3, "floor.layer[1].C": 2e5}
"""Constants of the recorded rooms: their floors are heavy, and bare on top."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two rooms of twelve hours each of the default system; a simulation would be one too many."""
    system = load_system("MixedAirCO2")
    lines = ["[recorded]", 'cases = "rooms.csv"', 'name = "room"', 'series = "room{name}.csv"', 'time = "t"']
    lines += ['jumps = "before"', "discard_hours = 2.0", "[recorded.parameters]"]
    lines += [f'"{name}" = "{name}"' for name in system.parameter_names]
    driven = [one.name for one in system.inputs if one.source in ("weather", "occupancy")]
    lines += ["[recorded.inputs]", *(f'{name} = {{ column = "{name}" }}' for name in driven)]
    lines += ["[recorded.outputs]", f'{system.output_names[0]} = {{ column = "y" }}']
    (tmp_path / "mapping.toml").write_text("\n".join(lines) + "\n")
    middle = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    pd.DataFrame([{"room": room, **middle} for room in "ab"]).to_csv(tmp_path / "rooms.csv", index=False)
    for room in "ab":
        write(tmp_path / f"room{room}.csv", driven, HOURS)

    def stop(*_):
        raise AssertionError("simulated")

    monkeypatch.setattr(comparison, "series_of", stop)
    return tmp_path, system, driven


def write(path, inputs, hours):
    values = {name: np.full(len(hours), 280.0) for name in inputs}
    pd.DataFrame({"t": 3600.0 * hours, "y": 293.15, **values}).to_csv(path, index=False)


def test_the_steps_that_count_are_those_after_the_start(folder):
    path, system, _ = folder
    spec, _ = recorded.load_recorded(path / "mapping.toml", system)
    rows, counts = recorded.compared(spec, 3600.0 * HOURS)
    np.testing.assert_array_equal(rows[1:][counts], 3600.0 * np.arange(3, 13))


def test_a_recorded_room_is_off_by_the_integrators_tolerance_and_another_by_what_sets_it_apart(tmp_path):
    """Both rooms are simulated finer than compared; the second has another floor than the mapping says.

    The mapping fixes constants that the description calls uncertain, one of them at 0.
    """
    system = load_system("MixedAirCO2")
    parameters = {one.name: float(one.from_unit(0.4)) for one in system.parameters}
    hours = np.arange(49)
    phase = 2 * np.pi * hours / 24
    columns = {
        "TDryBul": 278.0 - 5.0 * np.cos(phase),
        "TSky": 265.0 - 3.0 * np.cos(phase),
        "winSpe": 3.0 + np.sin(phase),
        "HFac": np.maximum(0.0, -400.0 * np.cos(phase)),
        "nPer": np.where((hours % 24 > 8) & (hours % 24 < 17), 4.0, 0.0),
    }
    held = {"nPer": "previous"}
    signals = {name: Piecewise(3600.0 * hours, one, held.get(name, "linear")) for name, one in columns.items()}
    stop = 3600.0 * hours[-1]
    table = build_inputs(system, root_seed=0, index=0, start=0.0, stop=stop, excitation=False, overrides=signals)
    points = [one.model_copy(update={"method": "point"}) for one in system.outputs]
    simulator = Simulator(system.model_copy(update={"outputs": points}))
    rooms = {"same": KNOWN, "other": KNOWN | {"floor.layer[1].C": 2e4}}
    made = {}
    for room, constants in rooms.items():
        run = simulator.run({**parameters, **constants}, table, start=0.0, stop=stop, step=3600.0, tolerance=1e-9)
        made[room] = run.outputs
        values = {name: np.append(np.nan, one) for name, one in zip(system.output_names, run.outputs, strict=True)}
        data = pd.DataFrame({"t": 3600.0 * hours, **columns, **values}).fillna(0.0)  # the first row is not compared
        data.to_csv(tmp_path / f"room-{room}.csv", index=False)
    pd.DataFrame([{"room": room, **parameters} for room in rooms]).to_csv(tmp_path / "rooms.csv", index=False)
    lines = ["[recorded]", 'cases = "rooms.csv"', 'name = "room"', 'series = "room-{name}.csv"', 'time = "t"']
    lines += ["[recorded.parameters]", *(f'"{name}" = "{name}"' for name in parameters), "[recorded.inputs]"]
    for name in columns:
        lines.append(f'{name} = {{ column = "{name}", interpolation = "{held.get(name, "linear")}" }}')
    lines += ["[recorded.outputs]", *(f'{name} = {{ column = "{name}" }}' for name in system.output_names)]
    lines += ["[recorded.fixed]", *(f'"{name}" = {value}' for name, value in KNOWN.items())]
    (tmp_path / "mapping.toml").write_text("\n".join(lines) + "\n")
    rows = {row.cell: row for row in compare(system, recorded=tmp_path / "mapping.toml").rows()}
    scale = np.abs(made["same"]).max(axis=1)
    assert (rows["same"].rms < 30 * system.experiment.tolerance * scale).all()
    apart = made["other"] - made["same"]
    assert rows["other"].rms[0] > 100 * rows["same"].rms[0]
    np.testing.assert_allclose(rows["other"].rms, np.sqrt(np.mean(apart**2, axis=1)), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('"roo.V" = 50.0', r"recorded\.fixed: 'roo\.V' is an estimated parameter; .* under \[recorded\.parameters\]"),
        ('"floor.layer[1].X" = 1.0', r"recorded\.fixed: 'floor\.layer\[1\]\.X' is not a variable of .*; did you mean"),
        ("TSky = 260.0", r"recorded\.fixed: 'TSky' is one of \[\[inputs\]\]"),
    ],
)
def test_constants_that_the_fmu_does_not_have_are_told_of_the_mapping(folder, line, said):
    path, system, _ = folder
    with (path / "mapping.toml").open("a") as file:
        file.write(f"[recorded.fixed]\n{line}\n")
    with pytest.raises(RecordingError, match=rf"mapping\.toml: {said}"):
        compare(system, recorded=path / "mapping.toml")
