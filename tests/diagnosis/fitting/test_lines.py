"""Linear Gaussian arithmetic against scipy's multivariate normal, and p-values against their definition."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Nothing
from diagnosis.fitting.grams import AMPLITUDE, FLOORS, Colours, Grams, discrepancy, estimated_colours, projected
from diagnosis.fitting.lines import widened
from diagnosis.fitting.problem import Problem
from diagnosis.gap.scan import ratios, scan
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.gap.stages import STRONG
from diagnosis.gap.twins import draw_twins
from diagnosis.recording import HOUR, read_recording
from shared.system import load_system


def test_what_is_no_output_has_no_meter(tmp_path):
    """The office's heater is not logged and its valve is no output: nobody said how well either is known."""
    system, path = load_system("fmus/MixedAirCO2/office.toml").with_experiment(hours=30.0), tmp_path / "r.nc"
    simulate(system, hours=30.0, seed=1, index=0, out=path)
    base = Problem(Simulator(system), read_recording(path, system), replay=True, warm_up=24 * HOUR)
    after = widened(base, base.linearise(np.zeros(base.size)))[0]
    assert after.drive.replayed
    assert not set(after.drive.replayed) & set(after.system.output_names)
    assert after.nuisance.size == base.nuisance.size


def test_computed_sun_may_be_wrong_while_it_shines(default_system, tmp_path):
    """What the line says of a pulse is what the room does with so much more sun."""
    system, path = default_system.with_experiment(hours=48.0), tmp_path / "r.nc"
    simulate(system, hours=48.0, seed=1, index=0, out=path)
    record = read_recording(path, system)
    plain = Problem(Simulator(system), replace(record, computed={"HFac": "computed"}), warm_up=24 * HOUR)
    z = np.zeros(plain.size)
    problem, around = widened(plain, plain.linearise(z))
    pulses = problem.nuisance
    (new,) = np.nonzero((pulses.column == system.input_names.index("HFac")) & pulses.recorded)
    assert 4 <= len(new) <= 10  # of sixteen parts of two days, those of the day
    noon = new[np.argmax(pulses.sd[new])]
    steps = (record.time > pulses.begin[noon]) & (record.time <= pulses.end[noon])
    more = dict(record.inputs, HFac=record.inputs["HFac"] + np.where(steps, 10.0, 0.0))
    other = Problem(Simulator(system), replace(record, inputs=more), warm_up=24 * HOUR)
    heater = system.output_names.index("QHea")
    saved = (other.simulate(z, plain.nuisance.mean) - plain.simulate(z, plain.nuisance.mean))[heater].sum()
    assert saved < 0
    assert 10 * around.response[heater, :, noon].sum() == pytest.approx(saved, rel=0.3)


STEPS = 60


def problem_of(rng, *, effects=3, chosen=0, outputs=2, steps=STEPS, nuisance=4, parameters=2):
    """A linearised recording of random smooth columns, without any simulator."""
    time = HOUR * np.arange(1, steps + 1)

    def smooth(*shape):
        raw = rng.standard_normal((outputs, steps + 12, *shape))
        return np.stack([raw[:, k : k + steps] for k in range(12)]).mean(axis=0) * np.sqrt(12)

    some = tuple(Nothing(f"chosen {k}", lower=-5.0, upper=5.0) for k in range(chosen))
    return SimpleNamespace(
        problem=SimpleNamespace(
            time=time,
            system=SimpleNamespace(parameters=[None] * parameters),
            nuisance=SimpleNamespace(guessed=np.zeros(nuisance, dtype=bool)),
        ),
        chosen=some,
        z=0.3 * rng.standard_normal(parameters + chosen),
        residual=np.zeros((outputs, steps)),
        by_nuisance=smooth(nuisance),
        by_unknown=smooth(parameters + chosen),
        by_effect=smooth(effects),
        effects=tuple(Nothing(f"effect {k}", lower=-5.0 if k else 0.0, upper=5.0) for k in range(effects)),
        slope={},
    )


def noisy_problem(seed, **shape):
    """A linearised recording with a residual of white noise, and which of its readings are observed."""
    rng = np.random.default_rng(seed)
    lin = problem_of(rng, **shape)
    lin.residual = rng.standard_normal(lin.residual.shape)
    return lin, seen(lin)


def seen(lin, share=0.9, seed=5):
    return np.random.default_rng(seed).random(lin.residual.shape) < share


def covariance_of(colour, time):
    white, slow, memory = colour
    return white**2 * np.eye(len(time)) + slow**2 * np.exp(-np.abs(time[:, None] - time) / memory)


WHITE = (1.0, 0.0, HOUR)
SURE = Colours({0: WHITE, 1: WHITE}, {k: [(WHITE, 1.0)] for k in (0, 1)}, 0.0)


def stacked(observed, rows):
    """What is observed of rows (2, steps, ...), channel after channel."""
    return np.concatenate([rows[k, observed[k]] for k in range(2)])


def dense(lin, observed, colours, *columns):
    """Readings, and their covariance by noise and by columns whose unknowns have a prior of one."""
    a = stacked(observed, np.concatenate(columns, axis=2))
    noise = block_diag(*(covariance_of(colours[k], lin.problem.time[observed[k]]) for k in range(2)))
    return stacked(observed, lin.residual + lin.by_unknown @ lin.z), noise + a @ a.T


@pytest.mark.parametrize("chosen", [0, 1])
def test_the_evidence_is_that_of_a_multivariate_normal(chosen):
    lin, observed = noisy_problem(1, chosen=chosen)
    colours = {0: (1.0, 0.5, 5 * HOUR), 1: (0.7, 0.0, HOUR)}
    spread = np.array([1.0, 1.0] + [AMPLITUDE] * chosen)
    r, covariance = dense(lin, observed, colours, lin.by_nuisance, lin.by_unknown * spread, 2.0 * lin.by_effect)
    expected = multivariate_normal.logpdf(r, np.zeros(len(r)), covariance)
    assert Grams(lin, observed).evidence(colours, 2.0) == pytest.approx(expected, abs=1e-6)


def test_what_is_left_is_what_generalised_least_squares_leaves():
    lin, observed = noisy_problem(2)
    colours = {0: (1.0, 0.0, HOUR), 1: (2.0, 0.0, HOUR)}
    grams = Grams(lin, observed)
    left = projected(grams.total(colours), grams.inner.size)
    r, covariance = dense(lin, observed, colours, lin.by_nuisance, lin.by_unknown)
    e, weight = stacked(observed, lin.by_effect), np.linalg.inv(covariance)
    np.testing.assert_allclose(left.information, e.T @ weight @ e, atol=1e-8)
    np.testing.assert_allclose(left.score, e.T @ weight @ r, atol=1e-8)
    assert left.square == pytest.approx(r @ weight @ r)


def drawn(rng, lin, colours, amplitude=0.0):
    """A recording of the linear model with one effect."""
    made = lin.by_nuisance @ rng.standard_normal(lin.by_nuisance.shape[2]) + amplitude * lin.by_effect[..., 1]
    for k, colour in colours.items():
        root = np.linalg.cholesky(covariance_of(colour, lin.problem.time))
        made[k] += root @ rng.standard_normal(len(lin.problem.time))
    return made


def test_without_a_gap_p_values_are_small_no_oftener_than_they_say_and_with_one_the_effect_is_found():
    rng = np.random.default_rng(3)
    p, misfit, right = [], [], 0
    for k in range(60):
        lin = problem_of(rng)
        observed = seen(lin)
        clean = lin.residual
        for amplitude in (0.0, 3.0):
            lin.residual = clean + drawn(rng, lin, SURE.best, amplitude)
            twins = draw_twins(Grams(lin, observed), SURE, 99, seed=k)
            found = scan(twins, lin.effects, twins.left.square)
            if amplitude:
                right += found.order[0] == 1 and found.p_value <= 0.05
            else:
                p.append(found.p_value)
                misfit.append(found.misfit_p)
    assert right == 60
    assert np.mean(misfit) == pytest.approx(0.5, abs=0.15)  # a uniform mean has a standard error of 0.037 here
    assert np.mean(np.array(misfit) <= 0.1) < 0.25
    assert np.mean(np.array(p) <= 0.1) < 0.2
    assert np.mean(p) > 0.4  # what is tested is more than a negligible amplitude: errs to the safe side


def test_a_candidate_that_noise_imitates_does_not_hide_one_that_it_does_not():
    """An offset reaches much where noise may be slow; what a ripple reaches is judged by what ripples reach."""
    rng = np.random.default_rng(8)
    lin = problem_of(rng)
    slow = (1.0, 3.0, 40 * HOUR)
    lin.by_effect[..., 0] = 1.0
    lin.by_effect[..., 1] = (-1.0) ** np.arange(STEPS)
    unsure = Colours(SURE.best, {k: [(WHITE, 0.9), (slow, 0.1)] for k in (0, 1)}, 0.0)
    lin.residual = rng.standard_normal(lin.residual.shape) + 0.5 * lin.by_effect[..., 1]
    observed = np.ones(lin.residual.shape, dtype=bool)
    twins = draw_twins(Grams(lin, observed), unsure, 399)
    found = scan(twins, lin.effects, twins.left.square)
    low, high = (np.array([getattr(one, end) / one.scale for one in lin.effects]) for end in ("lower", "upper"))
    _, null = ratios(twins.left, twins.left.score_of(twins.scores), low, high)
    assert np.mean(null.max(axis=0) >= found.ratio[1]) > 0.05  # in units of its own it stands out, not of the offset's
    assert found.adjusted[1] <= 0.02
    assert found.threshold[0] > 3 * found.threshold[1]


def test_an_effect_of_negligible_size_is_no_gap_however_clear():
    rng = np.random.default_rng(7)
    lin = problem_of(rng)
    lin.by_effect *= 100.0
    noise = drawn(rng, lin, SURE.best) + lin.by_unknown @ -lin.z
    for amplitude, seen_ in ((0.05, False), (0.3, True)):
        lin.residual = noise + amplitude * lin.by_effect[..., 1]
        twins = draw_twins(Grams(lin, np.ones(noise.shape, dtype=bool)), SURE, 99)
        found = scan(twins, lin.effects, twins.left.square)
        assert found.ratio[1] > 30
        assert (found.p_value <= 0.02) == seen_


def test_what_the_parameters_imitate_cannot_be_detected():
    rng = np.random.default_rng(4)
    lin = problem_of(rng)
    lin.by_unknown = 30 * lin.by_unknown
    lin.by_effect[..., 2] = lin.by_unknown[..., 0] / 30
    lin.by_effect[..., 1] = lin.by_effect[..., 0] * 1.5
    lin.residual = rng.standard_normal(lin.residual.shape)
    twins = draw_twins(Grams(lin, seen(lin)), SURE, 49)
    found = scan(twins, lin.effects, twins.left.square)
    assert found.share[2] < 0.01 < 0.2 < found.share[0]
    assert found.cosines[0, 1] == pytest.approx(1.0)
    assert found.alike(0, 10.0) == [1]
    assert found.alike(2, 2.0) == []  # it is not told from nothing


def kept_by(warm, **more):
    """What is kept of hours with this weather."""
    time = HOUR * np.arange(1, len(warm) + 1)
    return kept_for_scoring(
        SimpleNamespace(time=time, start=0.0, stop=float(time[-1]), step=HOUR, inputs={"x": warm, **more})
    )


def test_the_part_that_is_kept_is_chosen_from_inputs_alone_and_unlike_the_rest():
    time = HOUR * np.arange(1, 28 * 24 + 1)
    warm = np.sin(2 * np.pi * time / (28 * 24 * HOUR)) * 10 + np.sin(2 * np.pi * time / (24 * HOUR))
    kept = kept_by(warm, c=time * 0)
    assert 0.15 < kept.mean() < 0.35
    assert not kept[: 3 * 24].any()
    assert (np.diff(np.flatnonzero(np.diff(kept.astype(int)))) >= 24).all()
    assert abs(warm[kept]).mean() > 1.2 * abs(warm[~kept]).mean()


@pytest.mark.parametrize(("days", "more"), [(4, 1), (9, 23), (28, 1)])
def test_hours_more_than_whole_days_are_no_block_of_their_own(days, more):
    """The odd hours of an evening are far from the mean of a day: kept alone, they would be all that is scored."""
    time = HOUR * np.arange(1, days * 24 + more + 1)
    warm = np.sin(2 * np.pi * time / (24 * HOUR)) + 0.01 * np.random.default_rng(days).standard_normal(len(time))
    kept = kept_by(warm)
    for one in (kept, kept_by(warm[: days * 24])):
        assert np.diff(np.flatnonzero(np.diff(one.astype(int), prepend=0, append=0)))[::2].min() >= 24
    assert 0.1 < kept.mean() < 0.5


def test_a_slow_noise_is_recognised_and_a_discrepancy_measured():
    rng = np.random.default_rng(6)
    lin = problem_of(rng, steps=400)
    observed = np.ones(lin.residual.shape, dtype=bool)
    true = {0: (np.sqrt(0.5), np.sqrt(0.5), 10 * HOUR), 1: (1.0, 0.0, HOUR)}
    lin.residual = drawn(rng, lin, true)
    grams = Grams(lin, observed)
    found = estimated_colours(grams, np.ones(2))
    assert found.best[0][1] > 0.5
    assert found.best[1][1] < 0.3
    gain, _ = discrepancy(grams, found, np.ones(2))
    assert gain == 0.0
    lin.residual = drawn(rng, lin, {0: (1.0, 5.0, 8 * HOUR), 1: (1.0, 0.0, HOUR)})
    grams = Grams(lin, observed)
    gain, colours = discrepancy(grams, estimated_colours(grams, np.ones(2)), np.ones(2))
    assert gain > 30
    assert colours[0][1] > 2 > colours[1][1]


@pytest.mark.parametrize("memory", [10.0, 40.0])
def test_a_slow_error_of_the_models_own_is_none_and_a_larger_one_is_a_discrepancy(memory):
    """What a model that is nearly right lacks must not be called a gap, nor take up one that is there."""
    rng = np.random.default_rng(8)

    def gains(size):
        made = []
        for _ in range(10):
            lin = problem_of(rng, steps=336, effects=1)
            slow = np.linalg.cholesky(covariance_of((1e-6, size, memory * HOUR), lin.problem.time))
            lin.residual = rng.standard_normal((2, 336)) + rng.standard_normal((2, 336)) @ slow.T
            grams = Grams(lin, seen(lin))
            made.append(discrepancy(grams, estimated_colours(grams, np.ones(2)), np.ones(2))[0])
        return np.array(made)

    assert np.mean(gains(FLOORS[0]) > STRONG) <= 0.1
    assert np.mean(gains(1.5) > STRONG) >= 0.8
