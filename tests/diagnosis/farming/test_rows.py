"""Recordings of a farm: what is drawn, and that what was drawn is what acts."""

from collections import Counter

import numpy as np
import pytest

from datagen.driving.tables import Piecewise
from diagnosis.blind.draw import Case, Cause
from diagnosis.effects import library
from diagnosis.farming.laws import Process, Warped, course, outside, process
from diagnosis.farming.rows import BACKGROUND, GAPS, STRATA, Drawn, draw, gap_of, generator, live
from shared.system import load_system

HOURS = 48.0
DAY = 86400.0


@pytest.fixture(scope="module")
def made_by():
    return generator(load_system("MixedAirCO2"), HOURS, "sensor")


def case(*causes, replay=False):
    return Case(5, 2, "listed", causes, False, replay)


def effect(name):
    return next(one for one in library(load_system("MixedAirCO2")) if one.name == name)


def test_strata_come_as_often_as_they_should_and_what_is_withheld_is_no_right_answer(made_by):
    drawn = [draw(made_by, 3, index, 0) for index in range(600)]
    counts = Counter(one.stratum for one in drawn)
    for name, share in STRATA.items():
        assert counts[name] / 600 == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 600))
    for one in drawn:
        assert len(one.case.causes) == {"listed": 1, "withheld": 1, "two": 2}.get(one.stratum, 0)
        assert len(one.processes) == 1 + (one.stratum == "outside")
        assert BACKGROUND[0] <= one.processes[0][1] <= BACKGROUND[1]
        assert not one.withheld or one.withheld not in one.true
        modes = {mode for cause in one.case.causes for mode in [("replay" if one.case.replay else "control")]}
        assert all(modes <= {*cause.acts.spec.modes} for cause in one.case.causes)


def test_a_number_stands_for_one_recording(made_by):
    first, again, other = (draw(made_by, 3, 8, attempt) for attempt in (0, 0, 1))
    assert repr(first) == repr(again) != repr(other)
    assert first.stratum == other.stratum


@pytest.mark.parametrize("name", ["plug.timetable", "outdoor.temperature.offset", "sensor.CO2.gain"])
def test_a_law_whose_course_is_one_is_the_candidate_s_own(made_by, name):
    """On an input, on what drives it, and at a sensor."""
    exact = effect(name)
    same = Warped(exact, Piecewise.constant(1.0))
    none = Warped(exact, Piecewise.constant(0.0))
    size = exact.scale
    lived = [made_by.make_case(case(Cause(one, size))).clean for one in (exact, same)]
    base = made_by.make_case(case()).clean
    np.testing.assert_allclose(lived[1], lived[0], atol=0.01 * np.abs(lived[0] - base).max())
    np.testing.assert_allclose(made_by.make_case(case(Cause(none, size))).clean, base, atol=1e-3)
    assert (same.name, same.unit, same.changes) == (exact.name, exact.unit, exact.changes)


def test_courses_are_about_one_and_never_negative_and_processes_about_nothing():
    courses = [course(np.random.default_rng(k), 0.0, 200 * DAY).values for k in range(60)]
    assert min(one.min() for one in courses) >= 0
    always = [one.mean() for one in courses if (one > 0).all()]
    assert np.mean(always) == pytest.approx(1.0, abs=0.15)
    assert 0.3 < len(always) / len(courses) < 0.9  # some keep hours, some begin midway
    processes = [process(np.random.default_rng(k), 0.0, 200 * DAY).values for k in range(200)]
    assert abs(np.mean([one.mean() for one in processes])) < 0.3


def test_a_process_acts_at_its_port_alone_and_every_kind_of_port_comes(made_by):
    system = made_by.system
    found = [outside(system, np.random.default_rng(k), 0.0, DAY, "sensor") for k in range(200)]
    ports = {one.port for one in found}
    assert {one.input for one in system.sources} <= ports
    assert {f"output:{name}" for name in system.output_names} <= ports
    assert {one.name for one in system.inputs if one.source == "weather"} <= ports
    sensor = next(one for one in found if one.output == 1)
    shown = made_by.make_case(case(Cause(sensor, 3.0))).clean - made_by.make_case(case()).clean
    assert np.abs(shown[[0, 2, 3]]).max() < 1e-9
    assert isinstance(sensor, Process)


@pytest.mark.parametrize("gap", [GAPS[0], GAPS[1]])
def test_a_process_makes_the_gap_that_was_drawn(made_by, gap):
    """Within what a room is not linear."""
    acts = next(
        one
        for k in range(50)
        if (one := outside(made_by.system, np.random.default_rng(k), 0.0, 1e8, "sensor")).port == "TDryBul"
    )
    drawn = Drawn(case(), "outside", ((acts, gap),))
    moved = live(made_by, drawn).clean - live(made_by, Drawn(case(), "none", ())).clean
    assert gap_of(made_by.system, "sensor", moved) == pytest.approx(gap, rel=0.3)
