"""What a benchmark is going to do."""

import pytest

import trainer
from shared.errors import EstimatorError
from trainer.benchmarking.parts import PARTS, channel_sets
from trainer.benchmarking.planning import make_plan
from trainer.runs.checkpoint import read_card

from ..conftest import TANK, tank_system


def test_channels_come_from_the_roles_of_the_description():
    sets = channel_sets(tank_system())
    clock = ("time_of_day", "day_of_week")
    assert sets == {
        "level": ("level",),
        "+ clock": ("level", *clock),
        "+ clock, all outputs": ("level", *clock, "glow"),
    }
    weather = '[weather]\nfiles = ["x"]\nsurface_tilt = 90.0\nsurface_azimuth = 180.0\n'
    rain = '[[inputs]]\nname = "rain"\nunit = "mm"\nsource = "weather"\ncolumn = "rain"\n'
    more = '[[outputs]]\nname = "hum"\nunit = "dB"\naccuracy = 1.0\n'
    sets = channel_sets(tank_system(TANK + rain + more + weather))
    known = ("level", "rain", *clock)
    assert sets["+ weather and clock"] == known
    assert sets["+ weather and clock, hum"] == (*known, "hum")
    assert sets["+ weather and clock, all outputs"] == (*known, "glow", "hum")
    assert not any("valve" in channels for channels in sets.values())


def test_a_plan_fits_each_condition_once_and_says_what_it_skips(tanks, tmp_path):
    plan = make_plan(tanks, tmp_path / "out", seeds=2, minutes=0.5)
    assert [part.name for part in plan.parts] == list(PARTS)
    parts = {part.name: part for part in plan.parts}
    assert [row.labels for row in parts["table3"].rows] == [("4",), ("12",), ("24",)]
    lines = [row.labels for row in parts["table4"].rows]
    assert len(lines) == 3 * 6
    assert ("72", "tcn") in lines
    assert {row.condition.context_hours for row in parts["figure5"].rows} == {24.0, 48.0, 96.0, 168.0}
    skipped = [f"context {hours} h is skipped: the dataset's records are 240 h long" for hours in (360, 720)]
    assert parts["figure5"].notes == skipped
    assert [row.labels[1] for row in parts["systems"].rows] == ["80"] * 3
    assert parts["systems"].notes[0] == "80 systems are skipped: the dataset has 80 training systems"
    assert {row.labels[2] for row in parts["noise"].rows} == {"none", "gauge"}
    conditions = {row.condition for part in plan.parts for row in part.rows}
    assert len(plan.fits) == 2 * len(conditions)
    assert len({fit.key() for fit in plan.fits}) == len(plan.fits)
    assert [fit.seed for fit in plan.fits] == [0] * len(conditions) + [1] * len(conditions)
    solved = sum(fit.condition.model in ("ridge", "mean") for fit in plan.fits)
    assert plan.minutes_left() == (0.5 * (len(plan.fits) - solved), False)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"parts": ["table9"]}, "'table9' is unknown; found table3"),
        ({"seeds": 0}, "seeds: is 0"),
        ({"parts": []}, "parts: none is named; expected some of table3"),
        ({"minutes": float("nan")}, "minutes: is nan; expected a positive number"),
        ({"minutes": 1.0, "steps": 5}, "both are given"),
        ({"ours": ["forest"]}, "'forest' is not an estimator"),
    ],
)
def test_wrong_arguments_are_named(tanks, tmp_path, arguments, words):
    with pytest.raises(EstimatorError, match=words):
        make_plan(tanks, tmp_path / "out", **arguments)


def test_fewer_systems_make_a_smaller_full_dataset(short, tmp_path):
    run = trainer.fit(short, tmp_path / "run", model="mean", systems=40)
    result = trainer.evaluate(run, short)
    assert (result.protocols["paper"].systems, result.protocols["paper"].systems_trained_on) == (50, 45)
    assert result.protocols["unseen"].systems == 10
    assert read_card(tmp_path / "run").training_systems.indices[-1] < 60
