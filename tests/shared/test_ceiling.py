"""Ceilings are found for their own condition only."""

import pytest

from shared.ceiling import Ceiling, Ceilings, read_ceilings, write_ceilings
from shared.errors import ZeroshotError


def ceiling(**changes):
    values = {
        "context_hours": 168.0,
        "step": 3600.0,
        "noise": "none",
        "channels": ["T", "C"],
        "r2": {"p": 0.9},
        "r2_mean": 0.9,
        "r2_mean_low": 0.8,
        "r2_mean_high": 0.95,
        "systems": 3,
        "seed": 1,
    }
    return Ceiling(**{**values, **changes})


@pytest.fixture
def ceilings():
    return Ceilings(
        system_name="s", system_hash="a", fmu_sha256="b", outputs=["T", "C", "Q"], nuisances=["n"], ceilings=[ceiling()]
    )


CONDITION = {"context_hours": 168.0, "step": 3600.0, "noise": "none", "channels": ["C", "T"]}


def test_found_whatever_the_order_and_the_known_inputs(ceilings):
    assert ceilings.find(**CONDITION) is ceilings.ceilings[0]
    assert ceilings.find(**{**CONDITION, "channels": ["T", "weather", "C", "time_of_day"]}) is ceilings.ceilings[0]


@pytest.mark.parametrize(
    "change",
    [{"context_hours": 24.0}, {"step": 300.0}, {"noise": "sensor"}, {"channels": ["T"]}, {"channels": ["T", "C", "n"]}],
)
def test_not_found_for_another_condition(ceilings, change):
    assert ceilings.find(**{**CONDITION, **change}) is None


def test_put_replaces_and_file_round_trips(ceilings, tmp_path):
    ceilings.put(ceiling(r2_mean=0.5))
    ceilings.put(ceiling(noise="sensor"))
    assert [c.r2_mean for c in ceilings.ceilings] == [0.5, 0.9]
    write_ceilings(tmp_path / "c.json", ceilings)
    assert read_ceilings(tmp_path / "c.json") == ceilings


def test_files_that_are_none(tmp_path):
    with pytest.raises(ZeroshotError, match="no such file"):
        read_ceilings(tmp_path / "c.json")
    (tmp_path / "c.json").write_text("{}")
    with pytest.raises(ZeroshotError, match=r"system_name: Field required .*expected a file of"):
        read_ceilings(tmp_path / "c.json")
