"""Recorded trajectories that cannot be one table are refused before anything is simulated."""

import numpy as np
import pandas as pd
import pytest

from datagen.comparing import comparison, recorded
from datagen.comparing.comparison import compare
from shared.errors import RecordingError
from shared.system import load_system

HOURS = np.arange(13)


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


def test_recordings_of_unequal_length_are_refused(folder):
    path, system, driven = folder
    write(path / "roomb.csv", driven, HOURS[:-3])
    said = r"roomb\.csv: has 7 steps to compare, .*rooma\.csv has 10; expected as many of each"
    with pytest.raises(RecordingError, match=said):
        compare(system, recorded=path / "mapping.toml")
    with pytest.raises(AssertionError, match="simulated"):  # the other one is not asked for
        compare(system, recorded=path / "mapping.toml", systems=1)


@pytest.mark.parametrize(("jumps", "hours", "spans"), [("before", 12, 12), ("after", 11, 11), ("before", 9000, 12)])
def test_a_start_that_leaves_nothing_is_refused(folder, jumps, hours, spans):
    """Of twelve hours the last row has no after: the eleventh is the last that can be compared."""
    path, system, _ = folder
    mapping = path / "mapping.toml"
    text = mapping.read_text().replace('"before"', f'"{jumps}"')
    mapping.write_text(text.replace("discard_hours = 2.0", f"discard_hours = {hours}"))
    said = rf"mapping\.toml: recorded\.discard_hours is {hours}; expected less than the {spans} h that .*rooma\.csv"
    with pytest.raises(RecordingError, match=said):
        compare(system, recorded=mapping)
    mapping.write_text(text.replace("discard_hours = 2.0", f"discard_hours = {spans - 0.1}"))
    with pytest.raises(AssertionError, match="simulated"):
        compare(system, recorded=mapping)


def test_the_steps_that_count_are_those_after_the_start(folder):
    path, system, _ = folder
    spec, _ = recorded.load_recorded(path / "mapping.toml", system)
    rows, counts = recorded.compared(spec, 3600.0 * HOURS)
    np.testing.assert_array_equal(rows[1:][counts], 3600.0 * np.arange(3, 13))


def test_two_rooms_of_one_name_are_refused(folder):
    """The report has a row for each name: the second would stand in place of the first."""
    path, system, _ = folder
    rooms = pd.read_csv(path / "rooms.csv")
    pd.concat([rooms, rooms.iloc[:1]]).to_csv(path / "rooms.csv", index=False)
    said = r"rooms\.csv: column 'room' has 'a' in more than one row; expected another name in each"
    with pytest.raises(RecordingError, match=said):
        compare(system, recorded=path / "mapping.toml")
