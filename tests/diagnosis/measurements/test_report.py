"""What is said of the variables that a recording has, and of those that it lacks."""

from pathlib import Path

from diagnosis.measurements.output import sentences_of
from shared.system import parse_system
from tests.diagnosis.measurements.house_cases import HOUSE


def test_outputs_persons_and_inputs_that_are_missing_are_told_apart():
    system = parse_system(HOUSE, Path("house.toml"))
    assert sentences_of(["warmth", "gas", "people", "sky", "sunshine"], system) == [
        "not measured: warmth, gas: fits know nothing of it, and an estimator may need it",
        "occupants were not counted (people): fits treat them as unknown",
        "not recorded: sky, sunshine: needed by a simulation of this recording",
    ]
    assert sentences_of([], system) == []
