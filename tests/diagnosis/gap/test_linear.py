"""Linear Gaussian arithmetic against scipy's multivariate normal, and p-values against their definition."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Nothing
from diagnosis.fitting.fit import fit
from diagnosis.fitting.inputs import SLOW
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Colours, Grams, projected
from diagnosis.gap.linear import widened
from diagnosis.gap.scan import ratios, scan
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.gap.twins import draw_twins
from diagnosis.recording import HOUR, read_recording
from shared.system import load_system

ROOT = Path(__file__).parents[3]
HOURS = 30.0


def before_and_after(name, folder, **experiment):
    """A problem in replay, and the same as wide as it is."""
    system = load_system(ROOT / "fmus" / "MixedAirCO2" / name).with_experiment(hours=HOURS, **experiment)
    path = folder / "recording.nc"
    simulate(system, hours=HOURS, seed=1, index=0, out=path)
    base = fit(Problem(Simulator(system), read_recording(path, system), replay=True, warm_up=24 * HOUR), rounds=1)
    return base.problem, widened(base.problem, base.around)[0]


@pytest.mark.slow
def test_a_meter_s_error_drives_the_model(tmp_path):
    """In pulses of three hours."""
    count = 10
    before, after = before_and_after("system.toml", tmp_path, step=HOUR)
    system = after.system
    for name in after.drive.replayed:
        place = next(k for k, one in enumerate(system.inputs) if one.source == "measured" and one.column == name)
        own = after.nuisance.recorded & ~after.nuisance.turns & (after.nuisance.column == place)
        assert own.sum() == count
        steps = len(after.recording.time) // count
        means = np.kron(np.eye(count), np.full(steps, 1 / steps))
        meter = after.drive.meters[system.inputs[place].name]
        np.testing.assert_allclose(after.nuisance.sd[own] ** 2, np.diag(meter.covariance(means)), rtol=1e-6)
        # what drives the model is what is expected, not what was read
        middles = after.recording.time - 0.5 * after.recording.step
        np.testing.assert_allclose(after.drive.signals[system.inputs[place].name].at(middles), meter.values)
        assert not np.array_equal(meter.values, after.recording.outputs[system.output_names.index(name)])
        # what is known of a reading's neighbours makes it surer than the meter is
        sd = system.outputs[system.output_names.index(name)].noise["sensor"].sd
        assert (after.nuisance.sd[own] < sd * np.sqrt(SLOW + (1 - SLOW) / steps)).all()
    assert after.nuisance.size > before.nuisance.size


def test_what_is_no_output_has_no_meter(tmp_path):
    """The office's heater is not logged and its valve is no output: nobody said how well either is known."""
    before, after = before_and_after("office.toml", tmp_path)
    assert after.drive.replayed
    assert not set(after.drive.replayed) & set(after.system.output_names)
    assert after.nuisance.size == before.nuisance.size


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


@pytest.mark.parametrize("chosen", [0, 1])
def test_the_evidence_is_that_of_a_multivariate_normal(chosen):
    lin, observed = noisy_problem(1, chosen=chosen)
    colours = {0: (1.0, 0.5, 5 * HOUR), 1: (0.7, 0.0, HOUR)}
    spread = np.array([1.0, 1.0] + [AMPLITUDE] * chosen)
    columns = np.concatenate([lin.by_nuisance, lin.by_unknown * spread, 2.0 * lin.by_effect], axis=2)
    rows = [columns[k, observed[k]] for k in range(2)]
    a = np.concatenate(rows)
    noise = [covariance_of(colours[k], lin.problem.time[observed[k]]) for k in range(2)]
    s = np.block(
        [[noise[0], np.zeros((len(noise[0]), len(noise[1])))], [np.zeros((len(noise[1]), len(noise[0]))), noise[1]]]
    )
    r = np.concatenate([(lin.residual + lin.by_unknown @ lin.z)[k, observed[k]] for k in range(2)])
    expected = multivariate_normal.logpdf(r, np.zeros(len(r)), s + a @ a.T)
    assert Grams(lin, observed).evidence(colours, 2.0) == pytest.approx(expected, abs=1e-6)


def test_what_is_left_is_what_generalised_least_squares_leaves():
    lin, observed = noisy_problem(2)
    colours = {0: (1.0, 0.0, HOUR), 1: (2.0, 0.0, HOUR)}
    grams = Grams(lin, observed)
    left = projected(grams.total(colours), grams.inner.size)
    size = np.concatenate([np.full(observed[0].sum(), 1.0), np.full(observed[1].sum(), 2.0)])
    inner = np.concatenate([lin.by_nuisance, lin.by_unknown], axis=2)
    a = np.concatenate([inner[k, observed[k]] for k in range(2)]) / size[:, None]
    e = np.concatenate([lin.by_effect[k, observed[k]] for k in range(2)]) / size[:, None]
    r = np.concatenate([(lin.residual + lin.by_unknown @ lin.z)[k, observed[k]] for k in range(2)]) / size
    weight = np.linalg.inv(np.eye(len(r)) + a @ a.T)
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
    colours = {0: (1.0, 0.0, HOUR), 1: (1.0, 0.0, HOUR)}
    sure = Colours(colours, {k: [(one, 1.0)] for k, one in colours.items()}, 0.0)
    p, misfit, right = [], [], 0
    for k in range(60):
        lin = problem_of(rng)
        observed = seen(lin)
        clean = lin.residual
        for amplitude in (0.0, 3.0):
            lin.residual = clean + drawn(rng, lin, colours, amplitude)
            twins = draw_twins(Grams(lin, observed), sure, 99, seed=k)
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
    slow, white = (1.0, 3.0, 40 * HOUR), (1.0, 0.0, HOUR)
    lin.by_effect[..., 0] = 1.0
    lin.by_effect[..., 1] = (-1.0) ** np.arange(STEPS)
    unsure = Colours({0: white, 1: white}, {k: [(white, 0.9), (slow, 0.1)] for k in (0, 1)}, 0.0)
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
    colours = {0: (1.0, 0.0, HOUR), 1: (1.0, 0.0, HOUR)}
    sure = Colours(colours, {k: [(one, 1.0)] for k, one in colours.items()}, 0.0)
    noise = drawn(rng, lin, colours) + lin.by_unknown @ -lin.z
    for amplitude, seen_ in ((0.05, False), (0.3, True)):
        lin.residual = noise + amplitude * lin.by_effect[..., 1]
        twins = draw_twins(Grams(lin, np.ones(noise.shape, dtype=bool)), sure, 99)
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
    colours = {0: (1.0, 0.0, HOUR), 1: (1.0, 0.0, HOUR)}
    sure = Colours(colours, {k: [(one, 1.0)] for k, one in colours.items()}, 0.0)
    twins = draw_twins(Grams(lin, seen(lin)), sure, 49)
    found = scan(twins, lin.effects, twins.left.square)
    assert found.share[2] < 0.01 < 0.2 < found.share[0]
    assert found.cosines[0, 1] == pytest.approx(1.0)
    assert found.alike(0, 10.0) == [1]
    assert found.alike(2, 2.0) == []  # it is not told from nothing


def test_the_part_that_is_kept_is_chosen_from_inputs_alone_and_unlike_the_rest():
    time = HOUR * np.arange(1, 28 * 24 + 1)
    warm = np.sin(2 * np.pi * time / (28 * 24 * HOUR)) * 10 + np.sin(2 * np.pi * time / (24 * HOUR))
    record = SimpleNamespace(time=time, start=0.0, stop=float(time[-1]), step=HOUR, inputs={"x": warm, "c": time * 0})
    kept = kept_for_scoring(record)
    assert 0.15 < kept.mean() < 0.35
    assert not kept[: 3 * 24].any()
    assert (np.diff(np.flatnonzero(np.diff(kept.astype(int)))) >= 24).all()
    assert abs(warm[kept]).mean() > 1.2 * abs(warm[~kept]).mean()


@pytest.mark.parametrize("days", [4, 9, 28])
@pytest.mark.parametrize("more", [1, 23])
def test_hours_more_than_whole_days_are_no_block_of_their_own(days, more):
    """The odd hours of an evening are far from the mean of a day: kept alone, they would be all that is scored."""
    time = HOUR * np.arange(1, days * 24 + more + 1)
    warm = np.sin(2 * np.pi * time / (24 * HOUR)) + 0.01 * np.random.default_rng(days).standard_normal(len(time))
    record = SimpleNamespace(time=time, start=0.0, stop=float(time[-1]), step=HOUR, inputs={"x": warm})
    kept = kept_for_scoring(record)
    whole = SimpleNamespace(
        time=time[: days * 24], start=0.0, stop=days * 24 * HOUR, step=HOUR, inputs={"x": warm[: days * 24]}
    )
    lengths = [
        np.diff(np.flatnonzero(np.diff(one.astype(int), prepend=0, append=0)))[::2]
        for one in (kept, kept_for_scoring(whole))
    ]
    for one in lengths:
        assert one.min() >= 24
    assert 0.1 < kept.mean() < 0.5
