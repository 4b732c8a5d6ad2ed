"""Recordings of a farm: what is drawn, and that what was drawn is what acts."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise
from diagnosis.blind.generator import Case, Cause
from diagnosis.effects import library
from diagnosis.farming.laws import Span, course, outside, warped
from diagnosis.farming.rows import BACKGROUND, STRATA, Drawn, draw, gap_of, generator, live
from shared.system import load_system

HOURS = 48.0
DAY = 86400.0
SPAN = Span(-DAY, 0.0, 200 * DAY)


@pytest.fixture(scope="module")
def made_by():
    return generator(load_system("MixedAirCO2"), HOURS, "sensor")


def case(*causes, replay=False):
    return Case(5, 2, "listed", causes, False, replay)


def effect(name):
    return next(one for one in library(load_system("MixedAirCO2")) if one.name == name)


def port(system, name, *, unknown=False):
    """A process at a port."""
    found = (outside(system, np.random.default_rng(k), SPAN, "sensor", unknown=unknown) for k in range(200))
    return next(one for one in found if one.port == name)


def test_strata_come_as_often_as_they_should_and_what_is_withheld_is_no_right_answer(made_by):
    drawn = [draw(made_by, 3, index, 0) for index in range(600)]
    counts = Counter(one.stratum for one in drawn)
    for name, share in STRATA.items():
        assert counts[name] / 600 == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 600))
    for one in drawn:
        assert len(one.case.causes) == {"listed": 1, "withheld": 1, "two": 2}.get(one.stratum, 0)
        assert (one.outside is not None) == (one.stratum == "outside")
        assert BACKGROUND[0] <= one.background[1] <= BACKGROUND[1]
        assert not one.withheld or not one.true
        mode = "replay" if one.case.replay else "control"
        assert all(mode in cause.acts.spec.modes for cause in one.case.causes)


def test_a_number_stands_for_one_recording_and_another_draw_of_it_has_its_conditions(made_by):
    first, again, other = (draw(made_by, 3, 8, attempt) for attempt in (0, 0, 1))
    assert repr(first) == repr(again) != repr(other)
    for one in ("replay", "unknown_occupancy", "stratum"):
        assert getattr(first.case, one) == getattr(other.case, one)


@pytest.mark.parametrize("name", ["plug.timetable", "outdoor.temperature.offset", "sensor.CO2.gain"])
def test_a_law_whose_course_is_one_is_the_candidate_s_own(made_by, name):
    """On an input, on what drives it, and at a sensor."""
    exact = effect(name)
    same, none = (warped(exact, made_by.system, Piecewise.constant(value)) for value in (1.0, 0.0))
    size = exact.scale
    lived = [made_by.make_case(case(Cause(one, size))).clean for one in (exact, same)]
    base = made_by.make_case(case()).clean
    np.testing.assert_allclose(lived[1], lived[0], atol=0.01 * np.abs(lived[0] - base).max())
    np.testing.assert_allclose(made_by.make_case(case(Cause(none, size))).clean, base, atol=1e-3)
    assert (same.name, same.unit, same.changes, same.by_parameters) == (exact.name, exact.unit, exact.changes, False)


def test_what_acts_by_parameters_follows_its_course_at_the_outputs(made_by):
    """Half of the time it does nothing, and then what it does."""
    bridge = effect("bridge")
    time = made_by.make_case(case()).time
    half = Piecewise(np.array([time[0] - DAY, time[len(time) // 2]]), np.array([0.0, 1.0]), "previous")
    acts = warped(bridge, made_by.system, half)
    assert acts.by_parameters
    quiet = (port(made_by.system, "output:CO2"), 0.05)
    base, with_ = (live(made_by, Drawn(case(*some), "listed", quiet))[0].clean for some in ((), (Cause(bridge, 60.0),)))
    made, gap = live(made_by, Drawn(case(Cause(acts, 60.0)), "listed", quiet))
    before = time < half.times[1]
    np.testing.assert_allclose(made.clean[:, before], base[:, before], atol=1e-6)
    np.testing.assert_allclose(made.clean[:, ~before], with_[:, ~before], atol=1e-6)
    assert gap == pytest.approx(gap_of(made_by.system, "sensor", made.clean - base))


@pytest.mark.parametrize("name", ["clock", "sensor.CO2.lag"])
def test_what_moves_in_time_keeps_its_own_law(made_by, name):
    exact = effect(name)
    assert warped(exact, made_by.system, Piecewise.constant(0.5)) is exact


def test_courses_are_about_one_and_never_negative():
    courses = [course(np.random.default_rng(k), SPAN).values for k in range(60)]
    assert min(one.min() for one in courses) >= 0
    always = [one.mean() for one in courses if (one > 0).all()]
    assert np.mean(always) == pytest.approx(1.0, abs=0.15)
    assert 0.3 < len(always) / len(courses) < 0.9  # some keep hours, some begin midway


def test_a_process_acts_at_its_port_alone_and_every_kind_of_port_comes(made_by):
    system = made_by.system
    found = [outside(system, np.random.default_rng(k), SPAN, "sensor", unknown=False) for k in range(200)]
    ports = {one.port for one in found}
    assert {one.input for one in system.sources} <= ports
    assert {f"output:{name}" for name in system.output_names} <= ports
    assert {one.name for one in system.inputs if one.source == "weather"} <= ports
    sensor = next(one for one in found if one.output == 1)
    shown = made_by.make_case(case(Cause(sensor, 3.0))).clean - made_by.make_case(case()).clean
    assert np.abs(shown[[0, 2, 3]]).max() < 1e-9


def test_who_was_there_is_no_cause_where_nobody_counted(made_by):
    found = [outside(made_by.system, np.random.default_rng(k), SPAN, "sensor", unknown=True) for k in range(200)]
    assert "nPer" not in {one.port for one in found}


@pytest.mark.parametrize("gap", [0.5, 4.0])
def test_a_process_makes_the_gap_that_was_drawn(made_by, gap):
    """Within what a room is not linear; and one that moves nothing is none."""
    quiet = (port(made_by.system, "output:CO2"), 0.05)
    _, made = live(made_by, Drawn(case(), "outside", quiet, (port(made_by.system, "TDryBul"), gap)))
    assert made == pytest.approx(gap, rel=0.3)
    still = replace(port(made_by.system, "TDryBul"), course=Piecewise.constant(0.0))
    assert live(made_by, Drawn(case(), "outside", quiet, (still, gap)))[1] == 0.0
