"""A verdict calibrated by rows that are made up by known weights."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.farming.calibration import COVER, FOLDS, apart, calibrated, fitted
from diagnosis.farming.rows import Row, Rows
from diagnosis.gap.evidence import Evidence
from diagnosis.gap.verdict import decide, probabilities
from diagnosis.verdicts import NONE, NOTHING
from shared.errors import RecordingError

NAMES = tuple(f"candidate.{k}" for k in range(6))
HASHES = ("system_hash", "fmu_sha256", "uncertain_sha256", "candidates_sha256")
ABOUT = dict.fromkeys(HASHES, "-") | {"system": "room", "version": "0", "hours": 168.0, "noise": "sensor", "seed": 3}
TRUE = {"nothing": {"one": 1.0, "best": -0.5, "gap": -1.5}, "none": {"one": -1.0, "left": 0.6}, "power": 0.4}


def estimates(rng):
    """Errors of fits that take readings with an error of 0.2 prior standard deviations for twice as good."""
    true = rng.standard_normal(8)
    told = 1 / 0.1**2
    made = (true + 0.2 * rng.standard_normal(8)) * told / (1 + told)
    return tuple((float(one), (1 + told) ** -0.5) for one in made - true)


def rows(count, seed):
    """Evidence at random, and what was true drawn by the probabilities that the weights give it."""
    rng = np.random.default_rng(seed)
    made = []
    for index in range(count):
        gap = rng.random() < 0.6
        values = np.sort(rng.normal(10.0 if gap else -2.0, 6.0, len(NAMES)))[::-1]
        plain = {"gap": gap, "searched": True, "beside": {}, "rejected": False, "p_values": {}}
        plain["strained"] = False
        evidence = Evidence(
            replay=bool(rng.random() < 0.3),
            counted=bool(rng.random() < 0.5),
            candidates=dict(zip(rng.permutation(NAMES).tolist(), values.tolist(), strict=True)),
            chosen=(),
            before=float(rng.exponential(20.0)),
            left=float(rng.exponential(5.0)),
            **plain,
        )
        evidence = replace(evidence, chosen=(next(iter(evidence.candidates)),) if gap else ())
        chance = probabilities(evidence, **TRUE)
        what = rng.choice(["none", "outside", *chance.causes], p=[chance.nothing, chance.none, *chance.causes.values()])
        stratum = str(what) if what in ("none", "outside") else "listed"
        true = () if what in ("none", "outside") else (str(what),)
        made.append(Row(index, stratum, true, "", 1.0, evidence, estimates(rng), 1.0, 1))
    return tuple(made)


def test_weights_that_made_the_rows_are_found_again():
    weights = fitted(rows(2000, seed=1))
    assert np.exp(weights[0]) == pytest.approx(TRUE["power"], rel=0.15)
    nothing = dict(zip(NOTHING, weights[1 : 1 + len(NOTHING)].tolist(), strict=True))
    none = dict(zip(NONE, weights[1 + len(NOTHING) :].tolist(), strict=True))
    off = []
    for row in rows(300, seed=7):
        found = probabilities(row.evidence, nothing, none, float(np.exp(weights[0])))
        made = probabilities(row.evidence, **TRUE)
        off.append((abs(found.nothing - made.nothing), abs(found.none - made.none)))
    assert np.mean(off, axis=0).max() < 0.03


@pytest.fixture(scope="module")
def by():
    """A verdict that is calibrated by 1,000 rows."""
    return calibrated(Rows(ABOUT, rows(1000, seed=2)))


def test_limits_hold_on_rows_that_took_no_part(by):
    """Sets hold in 90 %, and what is told of alarms and names is so of others, by the binomial spread."""
    done = [(decide(row.evidence, by), row) for row in rows(1500, seed=4)]
    alarms = [one.verdict != "no_gap" for one, row in done if row.stratum == "none"]
    assert by.answers.alarms.true == pytest.approx(np.mean(alarms), abs=2 / np.sqrt(by.answers.alarms.count))
    caused = [(one, row) for one, row in done if one.verdict != "no_gap" and row.stratum != "none"]
    assert any(one.possible for one, _ in caused)  # an answer of none of these has a set as well
    held = [
        one.or_none or one.verdict == "none_of_these"
        if row.stratum == "outside"
        else row.true[0] in (*one.named, *one.possible)
        for one, row in caused
    ]
    assert np.mean(held) > COVER - 0.05
    named = [any(name in row.true for name in one.named) for one, row in done if one.named]
    assert by.answers.named.true == pytest.approx(np.mean(named), abs=2 / np.sqrt(by.answers.named.count))


def test_fits_that_are_twice_as_sure_as_they_should_be_are_doubted_by_two(by):
    assert by.doubt == pytest.approx(2.0, rel=0.05)


def test_a_row_has_no_say_in_what_it_is_judged_by():
    """Rows of one tenth are spoilt: their own weights and doubt stay, and those of all others change."""
    some = rows(200, seed=9)
    spoilt = [
        replace(row, errors=tuple((0.0, sd) for _, sd in row.errors), stratum="none", true=())
        if k % FOLDS == 0
        else row
        for k, row in enumerate(some)
    ]
    for k, ((_, was), (_, now)) in enumerate(
        zip(apart(Rows(ABOUT, some)), apart(Rows(ABOUT, tuple(spoilt))), strict=True)
    ):
        same = (was.nothing, was.power, was.doubt) == (now.nothing, now.power, now.doubt)
        assert same == (k % FOLDS == 0)


def test_what_is_said_is_what_is_true_bin_by_bin(by):
    for one in by.reliability:
        spread = np.sqrt(one.said * (1 - one.said) / one.count)
        assert abs(one.said - one.true) < 4 * spread + 0.02


def test_a_cause_that_is_found_as_a_second_effect_is_in_the_answer():
    """Sets hold what is true in either of both: limits do not fall to nothing for it."""

    def second(row):
        if row.stratum != "listed" or row.index % 4:
            return row
        other = {name: one for name, one in row.evidence.candidates.items() if name not in row.true}
        chosen = (next(iter(other)), *row.true)
        return replace(row, evidence=replace(row.evidence, candidates=other, beside={row.true[0]: 20.0}, chosen=chosen))

    some = rows(400, seed=8)
    by, before = calibrated(Rows(ABOUT, tuple(map(second, some)))), calibrated(Rows(ABOUT, some))
    assert by.held["all"] > 0.5 * before.held["all"] > 0.0
    assert by.none["one"] < before.none["one"] + 0.5  # it is no cause that nobody describes


@pytest.mark.parametrize("strata", [("none",) * 24 + ("listed",) * 60, ("none",) * 60])
def test_too_few_recordings_are_not_calibrated_by(strata):
    some = tuple(replace(row, stratum=one) for row, one in zip(rows(len(strata), seed=6), strata, strict=True))
    with pytest.raises(RecordingError, match="expected at least 25 of these and some with one"):
        calibrated(Rows(ABOUT, some))
