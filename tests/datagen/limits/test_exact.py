"""Reachable ceilings against problems that are solved by hand, and chains against what they must leave as it is."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

import datagen.limits.chains as chains
from datagen.cli import app
from datagen.driving.occupancy import draw_numbers, occupancy_of
from datagen.limits.chains import HALF, Problem, State, effective, sample
from datagen.limits.exact import Room, reachable_ceilings, recorded, summarised
from shared.errors import SystemDescriptionError, ZeroshotError
from shared.signals import Occupancy
from shared.system import parse_system
from tests.datagen.limits.test_ceilings_constants import HOUSE, INPUTS

SPEC = Occupancy(
    headcount=(2, 9), arrival=(7.0, 9.0), duration=(7.0, 10.0), jitter=0.5, attendance=(0.4, 1.0), gaps=(1, 2),
    gap_duration=(0.4, 1.5), gap_share=(0.3, 1.0), absence=0.1, weekend=0.3,
)  # fmt: skip
EDGES = 3600.0 * np.arange(0, 48.5, 0.5)
HOURS = EDGES[::2]


def persons_of(rng):
    return draw_numbers(SPEC, rng, EDGES[0], EDGES[-1])


def hourly(draw):
    """Mean persons of each hour, by sampling the signal itself."""
    signal = occupancy_of(SPEC, draw, EDGES[0], EDGES[-1])
    return signal.at(np.arange(30.0, EDGES[-1], 60.0)).reshape(len(HOURS) - 1, 60).mean(axis=1)


def test_of_a_linear_gaussian_problem_the_posterior_is_that_of_linear_regression():
    rng = np.random.default_rng(1)
    design = rng.normal(size=(30, 4)) * [3.0, 1.0, 0.3, 0.05]
    truth = rng.normal(size=4)
    problem = Problem(
        State(truth, None),
        design @ truth + rng.normal(size=30),
        0,
        lambda state: design @ state.x,
        design,
        np.zeros((30, 0)),
    )
    chain = sample(problem, 300, rng)
    covariance = np.linalg.inv(np.eye(4) + design.T @ design)
    assert chain.acceptance > 0.99  # the surrogate is the problem
    assert effective(chain.x).min() > 80
    np.testing.assert_allclose(chain.x.var(axis=0), np.diag(covariance), rtol=0.3)
    np.testing.assert_allclose(chain.linearised, np.diag(covariance), rtol=1e-6)
    mean = covariance @ design.T @ problem.readings
    assert (np.abs(chain.x.mean(axis=0) - mean) < 0.3 * np.sqrt(np.diag(covariance))).all()


def test_without_a_likelihood_the_sampler_s_own_occupancy_is_left(monkeypatch):
    """The surrogate takes persons and unknowns for seen, which they are not: what it prefers has to be undone."""
    monkeypatch.setattr(chains, "LENGTHS", (2, 4))
    rng = np.random.default_rng(2)
    by_person = 0.02 * rng.normal(size=(12, len(EDGES) - 1))
    by_unknown = 0.5 * rng.normal(size=(12, 3))
    truth = State(np.zeros(3), persons_of(rng))
    problem = Problem(truth, np.zeros(12), 2, lambda _: np.zeros(12), by_unknown, by_person, SPEC, EDGES)
    surrogate = chains._Surrogate(problem, rng)
    found, unknowns, accepted = [], [], []
    for _ in range(150):
        start = State(np.append(rng.uniform(-HALF, HALF, 2), rng.normal()), persons_of(rng))
        chain = chains._run(problem, surrogate, start, 8)
        found.append(hourly(chain.last.persons))
        unknowns.append(chain.last.x)
        accepted.append(chain.acceptance)
    assert 0.1 < np.mean(accepted) < 0.95  # something was undone, and something moved
    fresh = np.array([hourly(persons_of(rng)) for _ in range(3000)])
    found, unknowns = np.array(found), np.array(unknowns)
    for measure in (
        lambda h: h.sum(axis=1),  # person hours
        lambda h: h.max(axis=1),  # headcount
        lambda h: (h > 0).sum(axis=1),  # hours in which somebody is there
        lambda h: np.abs(np.diff(h, axis=1)).sum(axis=1),  # coming and going
        lambda h: h[:, 7],  # early comers
    ):
        assert ks_2samp(measure(found), measure(fresh)).pvalue > 0.005
    assert ks_2samp(unknowns[:, 0], rng.uniform(-HALF, HALF, 3000)).pvalue > 0.005
    assert ks_2samp(unknowns[:, 2], rng.normal(size=3000)).pvalue > 0.005


def room(rng):
    """A room that forgets within hours, with a gain per person and a loss that are unknown, and is not linear."""

    def outputs(state):
        gain, loss = 2 + 0.5 * state.x[0], 0.4 * np.exp(0.3 * state.x[1])
        level, found = 0.0, []
        for persons in hourly(state.persons):
            level = level * np.exp(-loss) + gain * persons * (1 - np.exp(-loss)) / loss
            found.append(level)
        return np.array(found) / 2.0

    truth = State(rng.uniform(-HALF, HALF, 2), persons_of(rng))
    middle = outputs(truth)
    by_unknown = np.stack(
        [(outputs(replace(truth, x=truth.x + step)) - middle) / 0.01 for step in 0.01 * np.eye(2)], axis=1
    )
    loss = 0.4 * np.exp(0.3 * truth.x[1])
    age = HOURS[1:, None] / 3600 - 1 - np.floor(EDGES[:-1] / 3600)
    by_person = (2 + 0.5 * truth.x[0]) / 2 * np.exp(-loss * age) * (1 - np.exp(-loss)) / loss / 2.0 * (age >= 0)
    return Problem(truth, middle + rng.normal(size=len(middle)), 2, outputs, by_unknown, by_person, SPEC, EDGES)


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say(monkeypatch):
    monkeypatch.setattr(chains, "LENGTHS", (6,))
    rng = np.random.default_rng(3)
    covered, errors, variances = [], [], []
    for _ in range(20):
        problem = room(rng)
        x = sample(problem, 100, rng).x
        low, high = np.percentile(x, [10, 90], axis=0)
        covered.append((low <= problem.truth.x) & (problem.truth.x <= high))
        errors.append((x.mean(axis=0) - problem.truth.x) ** 2)
        variances.append(x.var(axis=0))
    share = np.mean(covered)
    assert 0.65 < share < 0.95  # 0.8; two standard deviations of 40 intervals are 0.13
    assert 0.6 < np.mean(errors) / np.mean(variances) < 1.6
    assert 0.05 < np.mean(variances) < 0.95


@pytest.fixture(scope="module")
def house(small_fmu):
    fmu = small_fmu("house", attributes='canHandleVariableCommunicationStepSize="true"')
    return parse_system(
        HOUSE.format(fmu=fmu.as_posix()).replace("0.05", "2.0").replace("hours = 48.0", "hours = 24.0") + INPUTS,
        fmu.parent / "house.toml",
    )


def test_of_a_linear_fmu_both_ceilings_are_that_of_the_solution(house, tmp_path):
    """T = c + a RO S (1 - exp(-t / tau)) from the start of the past, a day before the window."""
    (found,) = reachable_ceilings(
        house, tmp_path, contexts=[24.0], conditions=[("sensor", ["room"])], systems=3, steps=100
    )
    by_area = 8.0 * 0.5 * 3 / np.sqrt(12) * (1 - np.exp(-(24 + np.arange(1.0, 25.0)) / 16.0))
    expected = 1 - 1 / (1 + (by_area**2).sum() / (2.0**2 + 0.01**2))
    assert expected < 0.99
    assert found.linearised[0] == pytest.approx(expected, abs=2e-4)
    assert found.r2[0] == pytest.approx(expected, abs=0.004)
    assert found.low[0] <= found.r2[0] <= found.high[0] and found.effective[0] > 20


def test_rooms_are_kept_and_only_added_to(house, tmp_path, monkeypatch):
    asked = {"contexts": [24.0], "conditions": [("sensor", ["room"])], "steps": 30}
    reachable_ceilings(house, tmp_path, systems=1, **asked)
    (first,) = tmp_path.iterdir()
    before = first.read_bytes()
    drawn = []
    monkeypatch.setattr("datagen.limits.exact.recorded", lambda *a: drawn.append(a[5]) or recorded(*a))
    reachable_ceilings(house, tmp_path, systems=2, **asked)
    assert drawn == [1] and first.read_bytes() == before
    with pytest.raises(ZeroshotError, match=r"is of condition .*30 steps', this is of .*31 steps'; expected another"):
        reachable_ceilings(house, tmp_path, systems=2, **{**asked, "steps": 31})


def test_too_few_effective_draws_leave_a_value_empty():
    rooms = [
        Room(
            of={}, variance=[0.2, 0.1], linearised=[0.3, 0.2], error=[0.2, 0.1], effective=[50.0, most], acceptance=0.2
        )
        for most in (40.0, 3.0)
    ]
    found = summarised(["a", "b"], 24.0, "sensor", ["room"], rooms)
    assert found.r2[0] == pytest.approx(0.8)
    assert found.r2[1:] == found.low[1:] == [None, None]
    assert found.linearised[1] == pytest.approx(0.8) and found.effective[1] == pytest.approx(2 / (1 / 40 + 1 / 3))


def test_the_command_names_both_ceilings(house, tmp_path, capsys):
    (tmp_path / "house.toml").write_text(HOUSE.format(fmu=house.fmu_path.as_posix()).replace("0.05", "2.0") + INPUTS)
    words = ["identifiability", str(tmp_path / "house.toml"), "--exact", "--context", "24", "--noise", "sensor"]
    with pytest.raises(ZeroshotError, match="--exact: has no --out; expected a folder"):
        app(words)
    words += ["--systems", "1", "--steps", "20", "--out", str(tmp_path / "rooms")]
    assert app([*words, "--quiet"], result_action="return_value") == 0
    text = capsys.readouterr().out
    assert "reachable" in text and "linearised" in text and "effective draws" in text
    assert app([*words, "--json", "--quiet"], result_action="return_value") == 0
    assert json.loads(capsys.readouterr().out)[0]["rooms"] == 1


def test_a_count_of_persons_is_refused(default_system, tmp_path):
    with pytest.raises(SystemDescriptionError, match=r"channels has \['nPer'\], a count of persons"):
        reachable_ceilings(
            default_system, tmp_path, contexts=[24.0], conditions=[("sensor", ["TRoo", "nPer"])], systems=1
        )
