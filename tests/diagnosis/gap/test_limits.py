"""Sentences of what limits an answer, from reports that hold as much as each needs."""

import json
import re

import numpy as np
import pytest
from jsonschema import validate

from datagen import simulate
from diagnosis.cli import app
from diagnosis.fitting.failures import NO_TIME
from diagnosis.fitting.lines import applicable
from diagnosis.fitting.problem import Problem
from diagnosis.gap.diagnosed import diagnose
from diagnosis.gap.limits import ends_left_out, limits, noiseless, strained
from diagnosis.gap.schema import Report
from diagnosis.gap.sentences import summary
from tests.diagnosis.conftest import WARM_UP
from tests.diagnosis.fitting.crowd_cases import on_persons
from tests.diagnosis.gap.gap_cases import candidates
from tests.diagnosis.gap.report_cases import constant, named, report, seen, stage
from tests.diagnosis.gap.room_cases import room


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


def test_persons_whom_nobody_counted_are_not_moved_in_time(warm):
    simulator, recording = warm
    moved = [on_persons(simulator.system, one) for one in ("shift", "gain")]
    usable, why = applicable(Problem(simulator, recording, occupancy="measured"), moved[:1])
    assert (usable, why) == (moved[:1], {})
    problem = Problem(simulator, recording, occupancy="unknown")
    usable, why = applicable(problem, moved[:1])
    assert (usable, why) == ([], {"persons": "it moves persons in time, and nobody counted when they were there"})
    assert applicable(problem, moved[1:]) == (moved[1:], {})


def test_persons_who_were_not_counted_are_not_looked_at(house, house_recording):
    """They were, and must not be: replicates draw others."""
    system = house("me")
    effects, path = candidates(system)[:2], house_recording(hours=72)
    done = diagnose(system, path, occupancy="unknown", effects=effects, warm_up=WARM_UP, how_far=False)
    assert done.report.assumed["N"] == "recorded, but not used: inferred with the prior of the description"
    assert "occupancy (N)" not in done.where.correlations.inputs
    assert not {"occupied", "empty"} & {one.label for one in done.where.cells.regimes}
    assert any(one.startswith("Persons were not counted") for one in done.report.limits)


@pytest.mark.slow
def test_the_command_replays_actuators_which_are_no_evidence_then(tmp_path, capsys):
    path, out, system = tmp_path / "room.nc", tmp_path / "out", tmp_path / "few.toml"
    simulate(room(), hours=24.0, seed=11, out=path)
    tables = re.split(r"(?m)^(?=\[)", room().path.read_text(encoding="utf-8"))
    few = [one for one in tables if "[[effects]]" not in one or re.search('name = "(plug|heater.derated)"', one)]
    system.write_text("".join(few).replace("../MixedAirCO2.fmu", str(room().fmu_path)), encoding="utf-8")
    words = ["run", str(system), str(path), "--out", str(out), "--run", "MixedAirCO2", "--warm-up", "24", "--replay"]
    assert app([*words, "--json"]) == 0
    report = Report.model_validate_json(capsys.readouterr().out)
    held_together(report)
    assert report == Report.model_validate_json((out / "report.json").read_text(encoding="utf-8"))
    assert report.verdict == "no_gap"
    assert report.replayed == ["QHea", "mOA"]
    assert "heater.derated" in report.excluded
    assert any(one.startswith("The recorded actuators (QHea, mOA)") for one in report.limits)


def test_what_probabilities_come_from_is_said_with_what_such_answers_held():
    first = limits(report())[0]
    assert first == (
        "Probabilities come from 100 recordings of 168 h that were made with room (2026-01-01, seed 7), 50 of them"
        " without a cause. There a gap was answered in 2 of 50 without a cause, and of 50 answers with a name 40 held a"
        " true cause in the first set."
    )
    other = limits(report(uncalibrated="verdict.json is missing beside system.toml"))[0]
    assert other.startswith(first) and "run `diagnosis farm` for it" in other


def test_parameters_of_an_unexplained_gap_are_not_to_be_believed():
    for verdict in ("none_of_these", "effect", "ambiguous", "no_gap"):
        said = any("Do not take the parameters" in one for one in limits(report(verdict=verdict)))
        assert said == (verdict == "none_of_these")
        warned = any(one.startswith("An answer is of the candidates") for one in limits(report(verdict=verdict)))
        assert warned == (verdict in ("effect", "ambiguous"))


def test_uncertain_constants_far_outside_of_the_description_are_a_limit():
    """Twice 0.3 in the logarithm is x1.82, and x0.55."""
    given = report(constants=[constant("floor", 3.0, 1.8), constant("wall", 0.5, 1.83), constant("roof", 2.5, None)])
    relative = {"floor": 0.3, "wall": 0.3, "roof": 0.5}
    before, after = strained(given, relative)
    assert before == (
        "In the base model floor x3 (expected: x0.55 to x1.8), wall x0.5 (expected: x0.55 to x1.8) are far outside of"
        " what the description expects: do not trust parameters that depend on them."
    )
    assert after.startswith("With the effects found wall x1.8 (expected: x0.55 to x1.8) is far outside")
    assert strained(report(constants=[constant("floor", 1.7, None)]), relative) == []
    _, rejected = strained(given.model_copy(update={"verdict": "none_of_these"}), relative)
    assert rejected.startswith("With the nearest candidate wall x1.8 (expected: x0.55 to x1.8) is")


def test_readings_at_the_ends_that_count_for_none_are_told():
    read = np.ones((3, 48), dtype=bool)
    read[0, 10] = False
    counts = read.copy()
    counts[2] = False  # replayed
    assert ends_left_out(counts, read, 0.5) == []
    counts[:, :3], counts[1, -6:] = False, False
    said = ends_left_out(counts, read, 0.5)[0]
    assert said.startswith("Readings of the first 1.5 h and the last 3 h count for none")


def test_sensors_without_declared_noise_are_named():
    assert noiseless({}) == []
    (said,) = noiseless({"room": "0.01 K", "CO2": "1 ppm"})
    assert said.startswith("No noise is declared for the sensor of room (to 0.01 K), CO2 (to 1 ppm): ")
    assert "in the description's [[outputs]] as noise.sensor" in said


AT_END = named("valve").model_copy(update={"at_bound": True, "amplitude": -4.0})
OTHER = named("bridge", answer=False).model_copy(update={"at_bound": True})


@pytest.mark.parametrize(
    ("fields", "words", "said"),
    [
        (
            {"sources_unknown": {"heat": "its simulation fails"}},
            "Missing",
            ["Missing sources that could not be worked out: heat (its simulation fails)."],
        ),
        ({"converged_after": False}, "not converged", ["The fit with the effects found had"]),
        (
            {"verdict": "none_of_these", "converged_after": False},
            "not converged",
            ["The fit with the nearest candidate had not"],
        ),
        ({"converged_after": True}, "not converged", []),
        ({"verdict": "no_gap"}, "not converged", []),
        (  # what an answer names could be seen
            {"effects": [named("valve")], "sets": [["valve"]], "detectability": seen(valve=None, load=None)},
            "nine of ten",
            ["At no size that is allowed would nine of ten recordings like this one show: load."],
        ),
        (
            {"effects": [AT_END, OTHER, named("load")]},
            "lies at the end of what",
            ["The size of valve lies at the end of what its description allows (-4 W"],
        ),
    ],
)
def test_what_limits_an_answer_is_said(fields, words, said):
    found = [one for one in limits(report(**fields)) if words in one]
    assert len(found) == len(said) and all(one.startswith(text) for one, text in zip(found, said, strict=True)), found


def test_a_candidate_that_could_not_be_simulated_was_not_looked_for():
    found = limits(report(detectability=seen(a=None, b=None), excluded={"b": "its simulation fails"}))
    (blind,) = [one for one in found if one.startswith("At no size that is allowed would")]
    assert blind.endswith(": a.")
    assert any("Not tried: b (its simulation fails)" in one for one in found)
    none = report(
        verdict="none_of_these",
        effects=[named("a", answer=False), named("b", answer=False)],
        failed={"b": "it is stiff"},
        none_of_these=0.5,
        stages=[stage(0.001, 0.001)],
    )
    assert "none of the 1 candidates" in summary(none)[1]


def test_what_an_answer_lacks_is_the_first_limit_and_how_to_go_on_is_said_where_time_was_lacking():
    short = report(unfinished={"how far the gap shrinks": NO_TIME}, failed={"b": "it is stiff"})
    first, *others = limits(short)
    assert first.startswith("The answer lacks: how far the gap shrinks (the time was up).") and "goes on" in first
    assert "Failed: b (it is stiff)." in others
    assert "the time was up" in summary(report(**vars(short) | {"stages": [stage(0.5, 0.5, ["b"])]}))[2]
    assert "goes on" not in limits(report(unfinished={"the optimum": "it is stiff"}))[0]


def test_without_time_no_candidate_is_named_but_what_straight_lines_say():
    cut = report(
        verdict="unfinished",
        effects=[named("a", 0.4, answer=False), named("b", 0.01, answer=False)],
        none_of_these=0.31,
        no_gap=0.07,
        unfinished={"the search for the cause": NO_TIME},
        stages=[stage(0.001, 0.001)],
    )
    assert summary(cut)[1].endswith("In the linearised model the foremost are a (40%).")
    assert cut.untried == pytest.approx(1 - 0.4 - 0.01 - 0.31 - 0.07)
