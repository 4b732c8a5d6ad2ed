"""What is said of the variables that a recording has, and of those that it lacks."""

import io
from pathlib import Path

from rich.console import Console

from diagnosis.measurements.output import print_report, sentences_of
from shared.system import parse_system
from tests.diagnosis.measurements.house_cases import HOUSE, measured


def test_outputs_persons_and_inputs_that_are_missing_are_told_apart():
    system = parse_system(HOUSE, Path("house.toml"))
    assert sentences_of(["warmth", "gas", "people", "sky", "sunshine"], system) == [
        "not measured: warmth, gas: fits know nothing of it, and an estimator may need it",
        "occupants were not counted (people): fits treat them as unknown",
        "not recorded: sky, sunshine: needed by a simulation of this recording",
    ]
    assert sentences_of([], system) == []


def test_steps_that_were_read_in_part_are_in_the_table(house):
    """Two thirds of each noon's half hour."""
    frame, hours = measured()
    noon = (hours % 24 > 12.4) & (hours % 24 < 12.6)
    report = house(frame.assign(kilowatts=frame["kilowatts"].where(~noon)))
    gas = next(one for one in report.variables if one.name == "gas")
    assert gas.partly == noon.sum() == 6
    said = io.StringIO()
    print_report(report, Console(file=said, width=300))
    (row,) = [line for line in said.getvalue().splitlines() if line.strip().startswith("gas")]
    assert "6 partly" in row and said.getvalue().count("partly") == 1
