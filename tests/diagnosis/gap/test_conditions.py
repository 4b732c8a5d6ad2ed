"""The whole diagnosis of four days of the default room under every condition: what it says holds, what limits it."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from jsonschema import validate

from datagen.simulating.simulator import Simulator
from diagnosis.cli import app
from diagnosis.fitting.fit import pruned
from diagnosis.fitting.problem import Problem
from diagnosis.gap import Report, diagnose
from diagnosis.gap.limits import Otherwise, _counted, expected
from diagnosis.gap.linear import applicable, linearised, widened
from tests.diagnosis.fitting.crowd_cases import as_counted, on_persons, warm_room
from tests.diagnosis.gap.room_cases import ROOM, recorded, room, some

HOURS = 96.0
WARM_UP = 24.0
"""Enough for this [h]."""


def held_together(report):
    """What any report must fulfil."""
    raw = json.loads(report.model_dump_json())
    validate(raw, Report.model_json_schema())
    assert Report.model_validate(raw) == report
    named = {one.name for one in report.effects if one.named}
    assert named == {name for one in report.sets for name in one}
    assert bool(named) == (report.verdict in ("effect", "ambiguous"))
    single = report.none_of_these + report.no_gap + sum(one.probability for one in report.effects)
    # of several sets each sums to one, and of a name that is in two the larger counts
    assert 1.0 - 1e-6 <= single <= max(len(report.sets), 1) + 1e-6
    assert len({(one.channel, one.kind, json.dumps(one.cell)) for one in report.where}) == len(report.where)
    assert [one.p_value for one in report.where] == sorted(one.p_value for one in report.where)
    assert {one.name for one in report.sources} == {"heat", "CO2"}
    assert len(report.summary) == 3
    return named


@cache
def drifting(folder):
    """A room whose sensor of temperature drifts by three quarters of a kelvin in them: six in thirty days bound it."""

    def readings(outputs, time):
        outputs[0] += 0.75 * (time - time[0]) / (time[-1] - time[0])
        return outputs

    return recorded(folder / "drifting.nc", room(), hours=HOURS, readings=readings)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("rooms")


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Simulator and recording of a room that is warm enough for its persons to open a window."""
    return warm_room(tmp_path_factory.mktemp("warm") / "room.nc")


def test_had_persons_been_counted_by_the_hour_nobody_would_know_when_within_it_they_came(folder):
    """Against the same room where they were: what candidates would be expected to show."""
    record = recorded(folder / "hours.nc", room(), hours=HOURS)
    simulator = Simulator(room())
    causes = some(room(), "sensor.CO2.lag", "sensor.CO2.bias", "infiltration.constant")
    settings = {"uncertain": False, "warm_up": WARM_UP * 3600.0}
    known = Problem(simulator, record, occupancy="measured", **settings)
    z = np.zeros(known.size)
    counted, around = widened(*pruned(known, known.linearise(z)))
    wanted = Otherwise("counted", linearised(counted, z, around, causes), counted.observed)
    unknown = Problem(simulator, record, occupancy="unknown", **settings)
    z, heights = as_counted(unknown, record, 7.0)
    nuisance = unknown.nuisance
    standard = np.linalg.lstsq(nuisance.factor, heights - nuisance.mean, rcond=None)[0]
    around = replace(unknown.linearise(z, standard), heights=heights)
    linear = linearised(unknown, z, around, causes)
    before = unknown.simulations
    lin = _counted(linear)
    assert unknown.simulations > before
    found = Otherwise("counted", lin, unknown.observed)
    sizes = [expected(one, {}, unknown.floor) for one in (found, wanted)]
    for cause in causes:
        assert sizes[0][cause.name] == pytest.approx(sizes[1][cause.name], rel=0.3)


def test_persons_whom_nobody_counted_are_not_moved_in_time(warm):
    simulator, recording = warm
    moved = [on_persons(simulator.system, one) for one in ("shift", "gain")]
    usable, why = applicable(Problem(simulator, recording, occupancy="measured"), moved[:1])
    assert (usable, why) == (moved[:1], {})
    problem = Problem(simulator, recording, occupancy="unknown")
    usable, why = applicable(problem, moved[:1])
    assert (usable, why) == ([], {"persons": "it moves persons in time, and nobody counted when they were there"})
    assert applicable(problem, moved[1:]) == (moved[1:], {})


@pytest.mark.slow
def test_persons_not_counted_costs_what_the_report_says(folder):
    effects = some(room(), "infiltration.constant", "sensor.temperature.drift")
    done = diagnose(room(), drifting(folder), occupancy="unknown", effects=effects, warm_up=WARM_UP)
    report = done.report
    # they were, and must not be looked at: twins draw others
    assert report.assumed["nPer"] == "recorded, but not used: inferred with the prior of the description"
    assert "nPer" not in done.where.correlations.inputs
    assert not {"occupied", "empty"} & {one.label for one in done.where.cells.regimes}
    assert "sensor.temperature.drift" in held_together(report)
    (found,) = [one.amplitude for one in report.effects if one.name == "sensor.temperature.drift"]
    assert found == pytest.approx(0.75 * 30 * 24 / HOURS, rel=0.1)
    (other,) = report.otherwise
    assert other.condition == "counted"
    now = {one.name: one.smallest for one in report.detectability}
    both = [name for name, size in other.smallest.items() if size is not None and now[name] is not None]
    assert both
    # knowing more hides no effect, but for what may happen within a step: of counts it is taken for twice as wide
    assert all(other.smallest[name] <= now[name] * 1.02 for name in both)
    # and shows some that are hidden, or smaller ones. Which they are depends on where the fit ended, and that on the
    # processor: a gain of the CO2 sensor is seen on one, and not at all on another
    assert any(size < 0.999 * (now[name] or np.inf) for name, size in other.smallest.items() if size is not None)
    assert any(one.startswith("Persons were not counted") for one in report.limits)


@pytest.mark.slow
def test_replayed_actuators_cost_what_the_report_says(folder):
    effects = some(room(), "heater.derated", "sensor.temperature.drift")
    report = diagnose(room(), drifting(folder), replay=True, effects=effects, warm_up=WARM_UP).report
    held_together(report)
    assert report.replayed == ["QHea", "mOA"]
    assert "heater.derated" in report.excluded
    (other,) = report.otherwise
    assert other.condition == "controlled"
    assert set(other.smallest) <= {one.name for one in report.detectability}
    (said,) = [one for one in report.limits if one.startswith("The recorded actuators")]
    assert "With the control loops simulated" in said


@pytest.mark.slow
def test_the_command_begins_with_the_shipped_estimator(folder, capsys):
    path = folder / "command.nc"
    recorded(path, room(), hours=24.0, fmu={"effect.heater.derate": 0.7})
    words = ["run", ROOM, str(path), "--out", str(folder / "out"), "--run", "MixedAirCO2", "--json", "--warm-up", "24"]
    assert app(words) == 0
    report = Report.model_validate_json(capsys.readouterr().out)
    held_together(report)
    assert report == Report.model_validate_json((folder / "out" / "report.json").read_text(encoding="utf-8"))
    assert report.verdict != "no_gap"
