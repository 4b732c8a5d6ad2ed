"""Sentences of the answer, from reports that hold as much as each needs."""

from diagnosis.gap.schema import ShrinkageOf
from diagnosis.gap.sentences import headline, summary
from diagnosis.gap.stages import PLAIN
from tests.diagnosis.gap.report_cases import named, place, report, source, stage


def shrunk(**fields):
    """What is left on held-out days of a gap of 1 K in a channel with 0.1 K of noise."""
    usual = {"channel": "room", "unit": "K", "readings": 24, "before": 1.0, "floor": 0.1}
    return ShrinkageOf(**(usual | {"placebo": 0.1, "placebo_best": 0.2} | fields))


def test_where_there_is_no_gap_what_seemed_to_be_one_is_said():
    quiet, near, line, spot = (
        summary(report(verdict="no_gap", no_gap=0.3, gap=False, stages=[stage(*ps)], where=[place("room")]))[0]
        for ps in ((0.4, 0.3), (0.4, 0.015), (0.01, 0.3), (0.4, 0.005))
    )
    assert "simulated itself (p = 0.4 over all candidates, 0.3 over all places)" in quiet
    assert "simulated itself (p = 0.4 over all candidates, 0.015 over all places)" in near  # not below its own level
    assert "a candidate stands out" in line and "none is strong evidence" in line
    assert "a place" not in line and "fan" not in line
    assert "(room: measured higher) stands out" in spot and "candidate stands out" not in spot
    quiet = {"verdict": "no_gap", "no_gap": 0.3, "stages": [stage(0.4, 0.3)]}
    given_up = summary(report(**quiet, gap=False, dropped=["clock"]))[0]
    assert "certain beyond noise" in given_up and "clock fits the recording much better" in given_up
    usual = summary(report(**quiet))
    assert "rooms without a cause look like this too often" in usual[0] and "That none acts is 30% sure" in usual[1]


def test_no_gap_that_is_improbable_is_not_told_as_if_nothing_were_needed():
    quiet = {"verdict": "no_gap", "gap": False, "stages": [stage(0.4, 0.3)]}
    assert summary(report(**quiet, no_gap=0.33))[1].endswith("no effect is named. That none acts is only 33% sure.")
    assert "no effect is needed. That none acts is 80% sure" in summary(report(**quiet, no_gap=0.8))[1]


def test_none_of_these_has_no_probability_before_a_system_is_calibrated():
    given = {
        "verdict": "none_of_these",
        "none_of_these": 0.6,
        "stages": [stage(0.01, 0.01), stage(0.01, 0.01, ["valve"])],
    }
    assert "That the cause is none of them is" in summary(report(**given))[1]
    other = summary(report(**given, uncalibrated="verdict.json is missing"))[1]
    assert "sure that is cannot be told" in other and "%" not in other


def test_a_headline_of_two_effects_tells_them_apart():
    effects = [named("valve", 0.9), named("fan", 0.3), named("lamp", 0.2)]
    done = report(verdict="ambiguous", effects=effects, sets=[["valve"], ["fan", "lamp"]])
    assert headline(done) == "2 causes: valve (90%); and one of fan (30%), lamp (20%)."


def test_the_answer_says_what_where_and_how_far_in_words():
    gone = shrunk(after=0.1, share=1.3, low=0.7, high=1.4)
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
    assert far.startswith("How far: on held-out days, this removes")
    # an interval of no width says nothing, what is left does
    for low in (1.2, 0.996):
        far = summary(done.model_copy(update={"shrinkage": [gone.model_copy(update={"low": low})]}))[2]
        left = "(the rest is 100% of the assumed noise, 0.1 K)"
        assert f"this removes all in room {left} of the gap above noise;" in far and "interval" not in far
    for after, left in ((3.04, "3%"), (0.304, "less than 1%")):
        quiet = gone.model_copy(update={"low": 1.1, "unit": "W", "after": after, "floor": 99.9})
        said = summary(done.model_copy(update={"shrinkage": [quiet]}))[2]
        assert f"(the rest is {left} of the assumed noise, 99.9 W)" in said
    # a source may have the name of an output
    alike = done.model_copy(update={"sources": [source("flow", "none", 1.0)]})
    assert summary(alike)[0].startswith("Where: room: measured higher; 2 more findings, also in flow.")
    chosen = summary(done.model_copy(update={"chosen_apart": False}))[2]
    assert "(which took part in the choice: the other days alone put another candidate first)" in chosen


def test_the_place_does_not_contradict_the_cause_that_is_named():
    """What a balance or a sensor explains is of the base model alone, an effect is fitted with its parameters."""
    stages = [stage(0.01, 0.01), stage(0.5, 0.5, ["valve"])]
    found = {"where": [place("room")], "sources": [source("heat", "balance", 120.0)], "stages": stages}

    def kind(balance, *names, **more):
        said = report(**(found | more), balance=balance, effects=[named(name) for name in names])
        return summary(said, sensors={"probe"})[0].removeprefix("Where: room: measured higher.")

    sensor = " It looks like the error of a sensor rather than of a balance."
    assert kind("sensor", "probe") == sensor and kind("sensor", "valve") == kind("sensor", "probe", "valve") == ""
    assert "in the balance" in kind("balance", "valve") and kind("balance", "probe") == ""
    # where no effect is named there is nothing to contradict
    assert kind("sensor", verdict="none_of_these", none_of_these=0.6) == sensor
    assert kind("sensor", verdict="none_of_these", none_of_these=0.6, unlike=True) == ""


def test_what_no_candidate_explains_is_said_of_the_nearest_only():
    gone = shrunk(after=0.9, share=0.1, low=-0.1, high=0.2)
    fitted = [stage(0.01, 0.01), stage(0.01, 0.01, ["valve"])]
    other = {
        "verdict": "none_of_these",
        "none_of_these": 0.61,
        "effects": [named(name, 0.01, answer=False) for name in ("most", "valve")],
    }
    _, which, far = summary(report(**other, shrinkage=[gone], stages=fitted, rejected=True))
    assert "none of the 2 candidates explains it; the nearest is valve, which is rejected on its own bootstrap" in which
    assert which.endswith(
        "That the cause is none of them is 61% sure: one of them may act by another law than described."
    )
    possible = summary(report(**other, stages=fitted, rejected=True, possible=["valve"]))[1]
    assert possible == f"{which} Not ruled out: valve (1%)."
    assert "held-out days, even the nearest (valve) removes 10% in room" in far
    unlike = {**other, "stages": fitted, "rejected": True, "unlike": True, "wider": "Room"}
    which = summary(report(**unlike))[1]
    assert "valve, which leaves more unexplained than it explains. With parameters on their bounds" in which
    assert which.endswith("the model is hardly that of this room: correct it, or try Room, which has wider ranges.")
    far = summary(report(**other, stages=fitted[:1]))[2]
    assert far == (
        "How far: no candidate explains enough of the gap to be fitted, so nothing is known that would shrink it."
    )


def test_too_few_readings_to_tell_how_far_are_not_called_a_gap_that_does_not_stand_out():
    """Of two days of six-hour steps, or one of hours, few are kept from the fit."""
    none = dict.fromkeys(("share", "low", "high", "placebo", "placebo_best"))
    few, quiet = (shrunk(channel=name, readings=count, after=0.1, **none) for name, count in (("room", 6), ("air", 24)))
    silent = few.model_copy(update={"readings": 0, "before": None, "after": None, "floor": None})
    shown = quiet.model_copy(update={"share": 0.7, "low": 0.5, "high": 0.9, "placebo": 0.1, "placebo_best": 0.2})
    fitted = [stage(0.01, 0.01), stage(0.5, 0.5, ["valve"])]
    far = summary(report(effects=[named("valve")], shrinkage=[few], stages=fitted))[2]
    assert "fewer than 12 readings of any channel, too few to say" in far and "stands out" not in far
    far = summary(report(effects=[named("valve")], shrinkage=[], stages=fitted))[2]
    assert "they or the other days have no readings" in far and "stands out" not in far
    far = summary(report(effects=[named("valve")], shrinkage=[few, quiet], stages=fitted))[2]
    untold = "There are too few readings of room on these days."
    assert "no channel's gap stands out" in far and far.endswith(untold)
    for one in (quiet, shown):  # a channel without any reading there may be the one that carries the gap
        far = summary(report(effects=[named("valve")], shrinkage=[silent, one], stages=fitted))[2]
        assert far.endswith(untold)
    far = summary(report(effects=[named("valve")], shrinkage=[quiet], stages=fitted))[2]
    assert "no channel's gap stands out" in far and "too few" not in far


def test_a_set_of_many_is_told_as_groups_and_by_the_foremost():
    kinds = {"a": "sensor", "b": "sensor", "c": "input", "h": "own"}
    effects = [named(name, 0.1, kind=kinds.get(name, "shaped")) for name in "abcdefgh"]
    groups = "4 things in the room, 2 errors of sensors, 1 input that was not as recorded, 1 other"
    stages = [stage(0.01, 0.01), stage(0.5, 0.5, ["a"])]
    sets = [list("abcdefgh"), list("de")]
    which = summary(report(verdict="ambiguous", effects=effects, sets=sets, stages=stages))[1]
    few = ", ".join(f"{name} (10%)" for name in "abc")
    assert headline(report(verdict="ambiguous", effects=effects, sets=sets[:1])) == (
        f"One of 8 causes that cannot be told apart: {groups}. Foremost: {few}."
    )
    assert which == (
        f"Which: one of 8 ({groups}), foremost {few} and one of d (10%), e (10%); the recording cannot tell these"
        " apart."
        " That one of these causes at least is among them is 90% sure."
    )
    left = report(verdict="ambiguous", effects=effects, sets=sets, stages=stages, rejected=True)
    assert summary(left)[1].endswith("is 90% sure. Something more is left that these do not explain.")


def test_of_two_effects_it_is_said_how_sure_one_of_them_is():
    stages = [stage(0.01, 0.01), stage(0.5, 0.5, ["a", "b"])]
    two = report(effects=[named("a", 0.65), named("b", 0.64)], sets=[["a"], ["b"]], stages=stages, mistaken=0.19)
    which = summary(two)[1]
    assert "with probability 65%; and the b leaks" in which
    assert which.endswith("with probability 64%. That one of them at least is a cause is 81% sure.")


def test_a_cause_beside_a_set_is_told_with_its_size():
    """Only of the set the recording does not tell which it is."""
    effects = [named("a", 0.85), named("b", 0.5), named("c", 0.3)]
    stages = [stage(0.01, 0.01), stage(0.5, 0.5, ["a", "b"])]
    for sets in ([["a"], ["b", "c"]], [["b", "c"], ["a"]]):
        assert summary(report(verdict="ambiguous", effects=effects, sets=sets, stages=stages))[1] == (
            "Which: the a leaks (a), by 2 W (1 to 3), with probability 85%;"
            " and one of b (50%), c (30%), which the recording cannot tell apart."
            " That one of these causes at least is among them is 90% sure."
        )


def test_what_is_left_is_said_to_look_like_a_cause_that_was_passed_over():
    """Of two causes the one that was found first may be neither: what would be next is then plain, and is named."""
    found = stage(0.01, 0.01, ["a", "b"])
    said = report(effects=[named("a"), named("b")], stages=[stage(0.01, 0.01), found], rejected=True)
    # what stands out most from its own twins may be another one, of little evidence
    for most, evidence, names in ((None, 0.0, False), ("valve", PLAIN - 1, False), ("valve", PLAIN, True)):
        last = found.model_copy(update={"best": "fan", "strongest": most, "evidence": evidence})
        which = summary(said.model_copy(update={"stages": [said.stages[0], last]}))[1]
        assert "Something more is left" in which
        assert ("of the other candidates valve would explain more of it than any other" in which) == names
    # one of a set that is named already is no other candidate
    last = found.model_copy(update={"strongest": "valve", "evidence": PLAIN})
    update = {"verdict": "ambiguous", "sets": [["a", "valve"]], "stages": [said.stages[0], last]}
    update["effects"] = [named("a"), named("valve")]
    which = summary(said.model_copy(update=update))[1]
    assert which.endswith("Something more is left that these do not explain.")


def test_a_share_has_no_unit():
    one = named("fan").model_copy(update={"unit": "1", "amplitude": 0.253, "low": 0.2, "high": 0.31})
    said = summary(report(effects=[one], sets=[["fan"]], stages=[stage(0.001, 0.001, ["fan"])]))[1]
    assert "by 0.253 (0.2 to 0.31), with probability" in said
