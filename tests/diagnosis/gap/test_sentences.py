"""Sentences of the answer and of its limits, from reports that hold as much as each needs."""

from diagnosis.gap.schema import (
    ConditionOf,
    Detectability,
    NamedEffect,
    ParameterOf,
    Place,
    Report,
    ShrinkageOf,
    SourceOf,
    StageOf,
)
from diagnosis.gap.sentences import limits, noiseless, strained, summary
from diagnosis.gap.stages import PLAIN


def seen(**smallest):
    return [
        Detectability(name=name, share=0.5, expected=1.0, smallest=size, confusable=[], ratio=0.0, p_value=1.0)
        for name, size in smallest.items()
    ]


def named(name, probability=0.9, *, answer=True, amplitude=2.0):
    return NamedEffect(
        name=name,
        description=f"The {name} leaks",
        probability=probability,
        named=answer,
        amplitude=amplitude,
        low=1.0,
        high=3.0,
        unit="W",
    )


def source(name, verdict, mean):
    return SourceOf(
        name=name,
        description=f"missing {name}",
        unit="W",
        mean=mean,
        peak=2 * mean,
        gain=9.0,
        p_value=0.005,
        rival="room",
        balance=5.0,
        verdict=verdict,
        roughness=0.5,
    )


def place(channel, kind="cell", text="room: measured higher"):
    return Place(channel=channel, cell={}, p_value=0.005, kind=kind, text=text, size=1.0, unit="K")


BARE = {
    "verdict": "effect",
    "occupancy": "measured",
    "replay": False,
    "replayed": [],
    "detectability": [],
    "otherwise": [],
    "sources": [],
    "sources_unknown": {},
    "effects": [],
    "excluded": {},
    "sets": [],
    "parameters": [],
    "converged": True,
    "assumed": {},
    "rejected": False,
    "balance": "none",
    "shrinkage": [],
    "chosen_apart": True,
    "where": [],
    "stages": [None],
}


def report(**fields):
    return Report.model_construct(**(BARE | fields))


def test_what_it_costs_that_persons_were_not_counted_is_said_in_numbers():
    now = seen(a=1.0, b=2.0, c=4.0, d=None, e=1.0)
    better = ConditionOf(condition="counted", smallest={"a": 1.0, "b": 1.0, "c": 1.0, "d": 3.0, "e": None})
    effects = [named(name) for name in "abcde"]
    said = next(
        one
        for one in limits(report(occupancy="unknown", detectability=now, otherwise=[better], effects=effects))
        if one.startswith("Persons")
    )
    assert "3 candidates would be seen from 50% of the size that they need here, at the median" in said
    assert "most for c from 1 instead of 4 W, b from 1 instead of 2 W" in said
    assert said.endswith("seen only then: d.")


def test_nothing_is_said_of_conditions_that_were_as_good_as_they_get():
    assert not any(one.startswith(("Persons", "The recorded")) for one in limits(report()))
    alone = limits(report(replay=True, replayed=["Q"]))
    assert any(one.startswith("The recorded actuators (Q)") and one.endswith("other outputs.") for one in alone)


def stage(p_value, where_p, effects=()):
    """``best`` is of the part that is fitted, the p-values are of all readings: they may be of different candidates."""
    return StageOf(
        effects=list(effects),
        best="fan",
        ratio=5.0,
        evidence=2.0,
        p_value=p_value,
        misfit_p=0.9,
        where_p=where_p,
        episode_p=0.5,
        left_over=0.0,
        episode_gain=0.0,
    )


def test_where_there_is_no_gap_what_seemed_to_be_one_is_said():
    quiet, near, line, spot = (
        summary(report(verdict="no_gap", no_gap=0.3, stages=[stage(*ps)], where=[place("room")]))[0]
        for ps in ((0.4, 0.3), (0.4, 0.015), (0.01, 0.3), (0.4, 0.005))
    )
    assert "of its own making (p = 0.4 over all candidates, 0.3 over all places)" in quiet
    assert "of its own making (p = 0.4 over all candidates, 0.015 over all places)" in near  # not below its own level
    assert "a candidate stands out" in line and "none is strong evidence" in line
    assert "a place" not in line and "fan" not in line
    assert "(room: measured higher) stands out" in spot and "candidate stands out" not in spot


def test_the_answer_says_what_where_and_how_far_in_words():
    gone = ShrinkageOf(
        channel="room",
        unit="K",
        readings=24,
        before=1.0,
        after=0.1,
        floor=0.1,
        share=1.3,
        low=0.7,
        high=1.4,
        placebo=0.1,
        placebo_best=0.2,
    )
    done = report(
        verdict="effect",
        where=[place("room"), place("flow"), place("heat", "source")],
        balance="balance",
        sources=[source("heat", "balance", 120.0), source("gas", "none", 1.0)],
        effects=[named("valve"), named("other", 0.1, answer=False)],
        shrinkage=[gone],
        stages=[stage(0.01, 0.01), stage(0.5, 0.5, ["valve"])],
    )
    where, which, far = summary(done)
    assert where.startswith("Where: room: measured higher; 2 more findings, also in flow.")
    assert "missing heat in the balance rather than like the error of a sensor" in where
    assert which == "Which: the valve leaks (valve), by 2 W (1 to 3), with probability 90%."
    # more than all of a gap cannot be removed
    assert "removes 100% in room (90 % interval 70% to 100%) of the gap above noise" in far
    assert far.startswith("How far: on days that took no part in the fit, this removes")
    # a source may have the name of an output
    alike = done.model_copy(update={"sources": [source("flow", "none", 1.0)]})
    assert summary(alike)[0].startswith("Where: room: measured higher; 2 more findings, also in flow.")
    chosen = summary(done.model_copy(update={"chosen_apart": False}))[2]
    assert "(but in the choice: the other days alone put another candidate first)" in chosen


def test_what_no_candidate_explains_is_said_of_the_nearest_only():
    gone = ShrinkageOf(
        channel="room",
        unit="K",
        readings=24,
        before=1.0,
        after=0.9,
        floor=0.1,
        share=0.1,
        low=-0.1,
        high=0.2,
        placebo=0.1,
        placebo_best=0.2,
    )
    fitted = [stage(0.01, 0.01), stage(0.01, 0.01, ["valve"])]
    other = {
        "verdict": "none_of_these",
        "none_of_these": 0.61,
        "effects": [named(name, 0.01, answer=False) for name in ("most", "valve")],
    }
    _, which, far = summary(report(**other, shrinkage=[gone], stages=fitted))
    assert "none of the 2 candidates explains it; the nearest is valve, which is rejected on its own twins. " in which
    assert "That the cause is none of them is 61% sure" in which
    assert "days that took no part in the fit, even the nearest (valve) removes 10% in room" in far
    far = summary(report(**other, stages=fitted[:1]))[2]
    assert far == (
        "How far: no candidate explains enough of the gap to be fitted, so nothing is known that would shrink it."
    )


def test_too_few_readings_to_tell_how_far_are_not_called_a_gap_that_does_not_stand_out():
    """Of two days of six-hour steps, or one of hours, few are kept from the fit."""
    none = dict.fromkeys(("share", "low", "high", "placebo", "placebo_best"))
    few, quiet = (
        ShrinkageOf(channel=name, unit="K", readings=count, before=1.0, after=0.1, floor=0.1, **none)
        for name, count in (("room", 6), ("air", 24))
    )
    fitted = [stage(0.01, 0.01), stage(0.5, 0.5, ["valve"])]
    far = summary(report(effects=[named("valve")], shrinkage=[few], stages=fitted))[2]
    assert "fewer than 12 readings of any channel, too few to say" in far and "stands out" not in far
    far = summary(report(effects=[named("valve")], shrinkage=[], stages=fitted))[2]
    assert "one of the two has no readings" in far and "stands out" not in far
    far = summary(report(effects=[named("valve")], shrinkage=[few, quiet], stages=fitted))[2]
    assert "no channel's gap stands out" in far and far.endswith("Of room there are too few readings on them to tell.")
    far = summary(report(effects=[named("valve")], shrinkage=[quiet], stages=fitted))[2]
    assert "no channel's gap stands out" in far and "too few" not in far


def test_parameters_of_an_unexplained_gap_are_not_to_be_believed():
    for verdict in ("none_of_these", "effect", "ambiguous", "no_gap"):
        said = any("Do not take the parameters" in one for one in limits(report(verdict=verdict)))
        assert said == (verdict == "none_of_these")


def test_of_a_set_of_many_the_foremost_are_said():
    effects = [named(name, 0.1) for name in "abcdefgh"]
    stages = [stage(0.01, 0.01), stage(0.5, 0.5, ["a"])]
    sets = [list("abcdefgh"), list("de"), ["f"]]
    which = summary(report(verdict="ambiguous", effects=effects, sets=sets, stages=stages))[1]
    few = ", ".join(f"{name} (10%)" for name in "abcdef")
    assert which == (
        f"Which: one of 8, foremost {few} and one of d (10%), e (10%) and f (10%);"
        " the recording cannot tell these apart."
    )
    left = report(verdict="ambiguous", effects=effects, sets=sets, stages=stages, rejected=True)
    assert summary(left)[1].endswith("these apart. Something more is left that these do not explain.")


def test_what_is_left_is_said_to_look_like_a_cause_that_was_passed_over():
    """Of two causes the one that was found first may be neither: what would be next is then plain, and is named."""
    found = stage(0.01, 0.01, ["a", "b"])
    said = report(effects=[named("a"), named("b")], stages=[stage(0.01, 0.01), found], rejected=True)
    for best, evidence, names in ((None, 0.0, False), ("valve", PLAIN - 1, False), ("valve", PLAIN, True)):
        last = found.model_copy(update={"best": best, "evidence": evidence})
        which = summary(said.model_copy(update={"stages": [said.stages[0], last]}))[1]
        assert "Something more is left" in which
        assert ("of the other candidates valve stands out most" in which) == names
    # one of a set that is named already is no other candidate
    last = found.model_copy(update={"best": "valve", "evidence": PLAIN})
    update = {"verdict": "ambiguous", "sets": [["a", "valve"]], "stages": [said.stages[0], last]}
    update["effects"] = [named("a"), named("valve")]
    which = summary(said.model_copy(update=update))[1]
    assert which.endswith("Something more is left that these do not explain.")


def test_without_candidates_none_of_them_may_act_otherwise():
    which = summary(report(verdict="none_of_these", none_of_these=0.6, effects=[], stages=[stage(0.5, 0.01)]))[1]
    assert which.endswith("none of the 0 candidates explains it. That the cause is none of them is 60% sure.")


def test_a_missing_source_that_could_not_be_worked_out_is_said():
    (said,) = [one for one in limits(report(sources_unknown={"heat": "its simulation fails"})) if "Missing" in one]
    assert said == "Missing sources that could not be worked out: heat (its simulation fails)."


def constant(name, before, after):
    ends = dict.fromkeys(("before_low", "before_high", "after_low", "after_high"), 1.0)
    return ParameterOf(name=name, unit="1", before=before, after=after, at_bound=False, at_bound_after=False, **ends)


def test_uncertain_constants_far_outside_of_the_description_are_a_limit():
    """Twice 0.3 in the logarithm is x1.82, and x0.55."""
    given = report(constants=[constant("floor", 3.0, 1.8), constant("wall", 0.5, 1.83), constant("roof", 2.5, None)])
    relative = {"floor": 0.3, "wall": 0.3, "roof": 0.5}
    before, after = strained(given, relative)
    assert before == (
        "In the base model floor x3 (allowed: x0.55 to x1.8), wall x0.5 (allowed: x0.55 to x1.8) are far outside of"
        " what the description allows: parameters that lean on them are not to be believed."
    )
    assert after.startswith("With the effects found wall x1.8 (allowed: x0.55 to x1.8) is far outside")
    assert strained(report(constants=[constant("floor", 1.7, None)]), relative) == []


def test_sensors_without_declared_noise_are_named():
    assert noiseless({}) == []
    (said,) = noiseless({"room": "0.01 K", "CO2": "1 ppm"})
    assert said.startswith("No noise is declared for the sensor of room (to 0.01 K), CO2 (to 1 ppm): ")
    assert "in the description's [[outputs]] as noise.sensor" in said


def test_a_size_that_stopped_at_its_bound_is_a_limit_of_an_answer_that_names_it():
    ends = named("valve").model_copy(update={"at_bound": True, "amplitude": -4.0})
    other = named("bridge", answer=False).model_copy(update={"at_bound": True})
    found = limits(report(effects=[ends, other, named("load")]))
    (said,) = [one for one in found if "stopped at the bound" in one]
    assert said.startswith("The size of valve") and "(-4 W)" in said


def test_a_share_has_no_unit():
    one = named("fan").model_copy(update={"unit": "1", "amplitude": 0.253, "low": 0.2, "high": 0.31})
    said = summary(report(effects=[one], sets=[["fan"]], stages=[stage(0.001, 0.001, ["fan"])]))[1]
    assert "by 0.253 (0.2 to 0.31), with probability" in said


def test_a_candidate_that_could_not_be_simulated_was_not_looked_for():
    found = limits(report(detectability=seen(a=None, b=None), excluded={"b": "its simulation fails"}))
    (blind,) = [one for one in found if one.startswith("Could not be seen")]
    assert blind.endswith(": a.")
    assert any("Not tried: b (its simulation fails)" in one for one in found)
    none = report(
        verdict="none_of_these",
        effects=[named("a", answer=False), named("b", answer=False)],
        excluded={"b": "its simulation fails"},
        none_of_these=0.5,
        stages=[stage(0.001, 0.001)],
    )
    assert "none of the 1 candidates" in summary(none)[1]
