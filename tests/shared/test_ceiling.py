"""Ceilings are found for their own condition only, and hold for their own season, weather and constants."""

import json

import pytest

from shared.ceiling import Ceiling, Ceilings, Origin, fitting, read_ceilings, unknown_constants, write_ceilings
from shared.errors import ZeroshotError
from shared.variables import Uncertain


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


JULY = Origin(start=(4344.0, 4344.0), hours=720.0, weather={"a.csv": "1" * 64})
YEAR = Origin(start=(0.0, 0.0), hours=8760.0)
CONDITION = {"context_hours": 168.0, "step": 3600.0, "noise": "none", "channels": ["C", "T"], "constants": {}}


def pipe(relative=0.3, **changes):
    """What is drawn where the walls of a pipe are uncertain."""
    return unknown_constants([Uncertain(name="pipe", parameters=["w", "v"], relative=relative, **changes)])


def test_found_whatever_the_order_and_the_known_inputs(ceilings):
    assert ceilings.find(**CONDITION) == ceilings.ceilings
    assert ceilings.find(**{**CONDITION, "channels": ["T", "weather", "C", "time_of_day"]}) == ceilings.ceilings


@pytest.mark.parametrize(
    "change",
    [{"context_hours": 24.0}, {"noise": "sensor"}, {"channels": ["T", "C", "n"]}],
)
def test_not_found_for_another_condition(ceilings, change):
    assert ceilings.find(**{**CONDITION, **change}) == []


@pytest.mark.parametrize(("systems", "kept"), [(1, 0.9), (2, 0.5)])
def test_of_two_for_one_condition_that_of_more_systems_stays(ceilings, systems, kept):
    for count, value in ((2, 0.9), (systems, 0.5)):
        ceilings.put_unless_fewer(ceiling(systems=count, r2_mean=value, noise="sensor", origin=JULY))
    (found,) = [one for one in ceilings.ceilings if one.noise == "sensor" and one.origin == JULY]
    assert found.r2_mean == kept


def test_seasons_stand_beside_each_other(ceilings):
    for origin, value in ((JULY, 0.6), (YEAR, 0.8), (JULY, 0.7)):
        ceilings.put(ceiling(origin=origin, r2_mean=value))
    assert [c.r2_mean for c in ceilings.find(**CONDITION)] == [0.8, 0.7]  # of the year, also in place of the old one
    assert fitting(ceilings.ceilings, JULY, {})[0].r2_mean == 0.7
    assert fitting(ceilings.ceilings, YEAR, {})[0].r2_mean == 0.8
    other = JULY.model_copy(update={"weather": {"a.csv": "2" * 64}})
    said = "it is of weather a.csv with sha256 111111111111; this dataset's has 222222222222"
    assert fitting(ceilings.ceilings, other, {}) == (None, said)
    assert fitting([], YEAR, {}) == (None, "it has none")


@pytest.mark.parametrize(
    ("start", "hours"),
    [((0.0, 8040.0), 720.0), ((24.0, 24.0), 8736.0), ((0.0, 0.0), 2e4)],
)
def test_a_whole_year_is_one_season_however_it_is_recorded(start, hours):
    whole = Origin(start=start, hours=hours)
    assert whole.season() is None
    assert fitting([ceiling()], whole, {})[1] == ""  # an older file, which does not say


def test_another_season_is_a_sentence():
    january, later = (Origin(start=(first, first), hours=336.0) for first in (0.0, 8760.0))
    assert january.season() == later.season() == (0.0, 336.0)
    reason = fitting([ceiling()], january, {})[1]
    assert reason == "it is of the whole year; this dataset is of hours 0 to 336 of the year"
    turn = Origin(start=(8424.0, 8592.0), hours=336.0)
    assert (
        turn.unlike(january) == "it is of hours 8424 to 8928 of the year; this dataset is of hours 0 to 336 of the year"
    )


def test_a_ceiling_holds_for_its_own_constants(ceilings):
    ceilings.put(ceiling(constants=pipe(), r2_mean=0.5, origin=YEAR))
    assert fitting(ceilings.ceilings, YEAR, {})[0].r2_mean == 0.9
    assert fitting(ceilings.ceilings, YEAR, pipe())[0].r2_mean == 0.5
    assert fitting(ceilings.ceilings, YEAR, pipe(0.4)) == (None, "it has none with constants drawn (pipe 0.4)")
    assert fitting(ceilings.ceilings[1:], YEAR, {}) == (None, "it has none with constants as declared")
    # of those with the dataset's constants it is told why they do not hold
    assert fitting(ceilings.ceilings, JULY, pipe())[1].startswith("it is of the whole year; ")


def test_files_that_are_none(tmp_path):
    with pytest.raises(ZeroshotError, match="no such file"):
        read_ceilings(tmp_path / "c.json")
    (tmp_path / "c.json").write_text("{}")
    with pytest.raises(ZeroshotError, match=r"system_name: Field required .*expected a file of"):
        read_ceilings(tmp_path / "c.json")


def test_files_of_the_first_version_are_read_and_kept_as_the_second(ceilings, tmp_path):
    """The second has no interval for a single system, which the first one's readers do not know."""
    path = tmp_path / "c.json"
    raw = json.loads(ceilings.model_dump_json())
    assert raw["schema_version"] == 2
    for old in ({**raw, "schema_version": 1}, {name: value for name, value in raw.items() if name != "schema_version"}):
        path.write_text(json.dumps(old))
        found = read_ceilings(path)
        assert found == ceilings
        found.put(ceiling(r2_mean_low=None, r2_mean_high=None, systems=1))
        write_ceilings(path, found)
        assert json.loads(path.read_text())["schema_version"] == 2
    path.write_text(json.dumps({**raw, "schema_version": 3}))
    with pytest.raises(ZeroshotError, match=r"c\.json: schema version is 3; .* reads up to 2: update it"):
        read_ceilings(path)
