"""Candidates whose amplitudes have bounds: their evidence, by brute force as well, and what they look like."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, trapezoid
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from diagnosis.effects.base import Nothing
from diagnosis.fitting.grams import AMPLITUDE, Grams
from diagnosis.fitting.refit import Refit
from diagnosis.gap.evidence import evidence_before
from diagnosis.gap.limits import smallest
from diagnosis.gap.scan import LEVEL, PRIORS, mass, scan
from diagnosis.gap.stages import PLAIN
from diagnosis.gap.twins import draw_twins
from tests.diagnosis.fitting.test_lines import HOUR, SURE, WHITE, dense, problem_of, seen, stacked

BOUNDS = [(0.0, np.inf), (-np.inf, np.inf), (-0.3, 0.3), (-3.0, 0.2)]


def scanned(lin, twins=None):
    """The scan of a linear recording, and its twins."""
    grams = Grams(lin, np.ones(lin.residual.shape, dtype=bool))
    fresh = draw_twins(grams, SURE, 399 if twins is None else 2)
    twins = fresh if twins is None else replace(twins, left=fresh.left)
    return scan(twins, lin.effects, twins.left.square), twins


def with_bounds(lin, *bounds):
    lin.effects = tuple(Nothing(f"effect {k}", lower=low, upper=high) for k, (low, high) in enumerate(bounds))
    return lin


@pytest.mark.parametrize("bounds", [(-1.0, 2.0), (-2.0, -1.0), (0.3, np.inf), (-1e-9, 1e-9)])
def test_what_a_normal_holds_between_bounds(bounds):
    expected = np.log(quad(norm.pdf, *bounds, epsabs=0)[0])
    assert float(mass(*map(np.array, bounds))) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("bounds", BOUNDS)
@pytest.mark.parametrize("truth", [-0.6, 1.0])
def test_the_evidence_of_a_candidate_is_over_the_amplitudes_that_it_may_have(bounds, truth):
    rng = np.random.default_rng(21)
    lin = with_bounds(problem_of(rng, effects=1), bounds)
    lin.residual = rng.standard_normal(lin.residual.shape) + truth * lin.by_effect[..., 0]
    found, twins = scanned(lin)
    size, score = float(twins.left.information[0, 0]), float(twins.left.score[0])
    reach = np.clip(np.array([-30.0, 30.0]), *bounds)
    a = np.linspace(*reach, 400_001)
    parts = []
    for sd in PRIORS:
        inside = norm(0, sd).cdf(bounds[1]) - norm(0, sd).cdf(bounds[0])
        values = norm(0, sd).logpdf(a) - np.log(inside) + a * score - 0.5 * a**2 * size
        parts.append(np.log(trapezoid(np.exp(values - values.max()), a)) + values.max())
    assert found.evidence[0] == pytest.approx(logsumexp(parts) - np.log(len(PRIORS)), abs=1e-5)


def test_a_candidate_is_no_gap_by_amplitudes_that_it_may_not_have():
    rng = np.random.default_rng(3)
    lin = with_bounds(problem_of(rng), (0.0, 5.0), (-5.0, 0.0), (-0.3, 0.3))
    lin.by_effect[..., 1] = 0.7 * lin.by_effect[..., 0] + 0.3 * lin.by_effect[..., 1]
    lin.by_effect[..., 2] = lin.by_effect[..., 1]
    lin.residual = rng.standard_normal(lin.residual.shape) + lin.by_effect[..., 0]
    found, _ = scanned(lin)
    assert found.evidence[0] > 2 * PLAIN
    assert found.ratio[1] == 0
    assert found.evidence[1] <= 0
    assert found.evidence[2] < found.ratio[2]
    assert found.order == [0, 2, 1]


@pytest.mark.parametrize("bounds", [*BOUNDS, (-5.0, 0.05)])
@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_the_evidence_of_a_refit_is_over_the_amplitudes_that_it_may_have(bounds, scale):
    rng = np.random.default_rng(23)
    lin = problem_of(rng, effects=0, chosen=1)
    lin.chosen = (Nothing("chosen", scale=scale, lower=bounds[0] * scale, upper=bounds[1] * scale),)
    lin.residual = rng.standard_normal(lin.residual.shape) - lin.by_unknown @ lin.z + 0.3 * lin.by_unknown[..., 2]
    observed = seen(lin)
    grams = Grams(lin, observed)
    colours = {0: (1.0, 0.5, 5 * HOUR), 1: WHITE}
    found = Refit(lin, grams, 0.0, np.eye(3), True, True).evidence_with(colours)
    # the amplitude by brute force, all others integrated out
    rows, spread = dense(lin, observed, colours, lin.by_nuisance, lin.by_unknown[..., :2])
    along = stacked(observed, lin.by_unknown[..., 2])
    reach = np.linspace(*np.clip([-8.0, 8.0], *bounds), 4001)
    values = multivariate_normal(np.zeros(len(rows)), spread).logpdf(rows - reach[:, None] * along)
    prior = norm(0, AMPLITUDE)
    values = values + prior.logpdf(reach) - np.log(prior.cdf(bounds[1]) - prior.cdf(bounds[0]))
    expected = np.log(trapezoid(np.exp(values - values.max()), reach)) + values.max()
    assert found == pytest.approx(expected, abs=1e-4)


def test_a_second_effect_is_not_credited_with_what_the_first_gains_by_its_bounds():
    """A second candidate that moves nothing gains nothing over the first alone, whatever the first one's bounds."""
    rng = np.random.default_rng(26)
    lin = problem_of(rng, effects=0, chosen=1)
    lin.chosen = (Nothing("chosen", lower=0.0),)
    lin.residual = rng.standard_normal(lin.residual.shape) + 0.4 * lin.by_unknown[..., 2]
    both = SimpleNamespace(**vars(lin))
    both.chosen = (*lin.chosen, Nothing("still"))
    both.z = np.append(lin.z, 0.0)
    both.by_unknown = np.concatenate([lin.by_unknown, np.zeros_like(lin.by_unknown[..., :1])], axis=2)
    first, second = (Refit(one, Grams(one, seen(lin)), 0.0, np.eye(len(one.z)), True, True) for one in (lin, both))
    stage = SimpleNamespace(grams=first.grams, colours=SURE)
    before = evidence_before(SimpleNamespace(last=stage, settled=[first]))
    assert second.evidence_with(SURE.best) == pytest.approx(before, abs=1e-9)
    assert before - first.grams.evidence(SURE.best) == pytest.approx(np.log(2), abs=0.1)  # half of its prior is left
    assert evidence_before(SimpleNamespace(last=stage, settled=[])) == first.grams.evidence(SURE.best)


def opposed(first, second, cosine=-0.99):
    """The scan of two candidates of opposite signatures, and a third that is like neither."""
    rng = np.random.default_rng(24)
    lin = problem_of(rng)
    one, other = lin.by_effect[..., 0], lin.by_effect[..., 1]
    lin.by_effect[..., 1] = cosine * one + np.sqrt(1 - cosine**2) * 0.1 * other
    lin.residual = rng.standard_normal(lin.residual.shape)
    return scanned(with_bounds(lin, first, second, (0.0, 5.0)))[0]


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ((0.0, 5.0), (0.0, 5.0), (False, False)),  # each would have to go below zero
        ((0.0, 5.0), (-5.0, 0.0), (True, True)),
        ((0.0, 5.0), (-0.1, 5.0), (False, False)),  # a tenth is not enough to look like two
        ((-1.5, 1.5), (0.0, 1.4), (True, True)),  # neither may be two: as large as it may be
    ],
)
def test_what_a_gap_would_be_mistaken_for_may_look_like_it(first, second, expected):
    found = opposed(first, second)
    assert abs(found.cosines[0, 1]) > 0.99
    assert [1 in found.alike(0, 2.0), 0 in found.alike(1, 2.0)] == [*expected]
    assert 2 not in found.alike(0, 2.0)


def test_nine_of_ten_effects_of_the_size_that_is_said_to_be_seen_are_seen():
    rng = np.random.default_rng(25)
    lin = problem_of(rng)
    lin.residual = np.zeros(lin.residual.shape)
    quiet, twins = scanned(lin)
    amplitude = smallest(lin.effects[1], float(quiet.expected[1]), float(quiet.threshold[1]))
    fixed = amplitude * lin.by_effect[..., 1] - lin.by_unknown @ lin.z
    count, hits = 400, 0
    for _ in range(count):
        made = lin.by_nuisance @ rng.standard_normal(4) + lin.by_unknown @ rng.standard_normal(2)
        lin.residual = fixed + made + rng.standard_normal(fixed.shape)
        hits += scanned(lin, twins)[0].adjusted[1] <= LEVEL
    assert hits / count == pytest.approx(0.9, abs=0.045)  # three standard errors
