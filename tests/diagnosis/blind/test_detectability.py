"""What nothing can imitate of a gap: against dense covariances, and against gaps whose imitators are known."""

from functools import partial

import numpy as np
import pytest

from datagen import simulate
from datagen.driving.sampling import sample_parameters
from datagen.simulating.simulator import Simulator
from diagnosis.blind.detectability import INSIDE, _colour, detectability, fitted_square
from diagnosis.blind.generator import Case, Cause, Generator, measured, published, write
from diagnosis.blind.make import answer_of
from diagnosis.blind.truth import default_truth, load_truth
from diagnosis.effects import library
from diagnosis.fitting.problem import Problem
from diagnosis.gap.linear import linearised, metered
from diagnosis.gap.refit import SETTLED
from diagnosis.recording import HOUR, read_recording
from shared.errors import SimulationError

HOURS, SLOW = 72.0, {"slow_share": 0.3, "hours": 5.0}


@pytest.fixture(scope="module")
def simulator(default_system):
    return Simulator(default_system.with_experiment(hours=HOURS))


@pytest.fixture(scope="module")
def made(simulator, tmp_path_factory):
    """A recording, and what is sealed of it but for the series."""
    system = simulator.system
    path = tmp_path_factory.mktemp("detectability") / "recording.nc"
    parameters = dict(zip(system.parameter_names, sample_parameters(system, 8, 3).tolist(), strict=True))
    simulate(system, hours=HOURS, seed=8, index=3, out=path)
    noise = {one.name: {"sd": one.noise["sensor"].sd, **SLOW} for one in system.outputs}
    return path, {"occupancy": "measured", "replay": False, "parameters": parameters, "noise": noise}


@pytest.fixture(scope="module")
def problem(simulator, made):
    return Problem(simulator, read_recording(made[0], simulator.system), occupancy="measured")


def nothing(effect, amplitude):
    raise SimulationError("no candidate")


def answered(answer, system, gap):
    base = np.zeros_like(gap)
    series = ({name: row.tolist() for name, row in zip(system.output_names, rows, strict=True)} for rows in (gap, base))
    return answer | dict(zip(("clean", "base"), series, strict=True))


def test_a_gap_is_as_long_as_dense_covariances_say(simulator, made):
    path, answer = made
    answer = answer | {"replay": True}
    system = simulator.system
    rng = np.random.default_rng(0)
    problem = Problem(simulator, read_recording(path, system), occupancy="measured", replay=True)
    shape = problem.measured.shape
    gap = np.cumsum(rng.standard_normal(shape), axis=1) * np.array([[one.noise["sensor"].sd] for one in system.outputs])
    found = detectability(simulator, path, answered(answer, system, gap), [], nothing)["length"]

    low, high = problem.bounds
    z = np.clip(problem.unknowns(answer["parameters"]), INSIDE * low, INSIDE * high)
    around = problem.linearise(z)
    exactly = linearised(problem, z, around)
    wider, around = metered(problem, around)
    lengths = [length(answer, system, one, gap) for one in (exactly, linearised(wider, z, around))]
    colours = {k: _colour(answer["noise"][one.name], one.accuracy) for k, one in enumerate(system.outputs)}
    fitted = np.sqrt(fitted_square(linearised(wider, z, around), gap, colours))
    assert found == pytest.approx(min(lengths[1], fitted), rel=1e-6)
    assert 0.7 * lengths[1] < fitted < 1.1 * lengths[1]  # parameters move little, and lines are nearly straight
    assert lengths[1] < 0.97 * lengths[0]  # whoever has only meters' readings sees less than what the actuators did


def length(answer, system, lin, gap):
    """Of a gap beyond what is unknown, from covariances written out."""
    problem, time, shape = lin.problem, lin.problem.time, gap.shape
    covariance = np.zeros((gap.size, gap.size))
    for k, one in enumerate(system.outputs):
        sd = one.noise["sensor"].sd
        slow = SLOW["slow_share"] * sd**2 * np.exp(-np.abs(np.subtract.outer(time, time)) / (SLOW["hours"] * HOUR))
        rows = slice(k * shape[1], (k + 1) * shape[1])
        covariance[rows, rows] = slow + np.eye(shape[1]) * ((1 - SLOW["slow_share"]) * sd**2 + one.accuracy**2)
    columns = np.concatenate([lin.by_nuisance, lin.by_unknown], axis=2).reshape(gap.size, -1)
    covariance += columns @ columns.T
    seen = problem.observed.ravel()
    return float(np.sqrt(gap.ravel()[seen] @ np.linalg.solve(covariance[np.ix_(seen, seen)], gap.ravel()[seen])))


def test_a_parameter_s_gap_is_imitated_and_a_sensor_s_by_its_candidate(simulator, made, problem):
    path, answer = made
    system = simulator.system
    z = problem.unknowns(answer["parameters"])
    effects = {one.name: one for one in library(system)}
    size = np.array([[one.noise["sensor"].sd] for one in system.outputs])
    gaps = [problem.simulate(z + 0.02 * step) - problem.simulate(z) for step in np.eye(len(z))]
    whole, k = max((float(np.sqrt(np.sum((gap / size) ** 2))), k) for k, gap in enumerate(gaps))
    assert whole > 5.0
    base = problem.simulate(z)

    def signature(effect, amplitude):
        one = problem.with_effects([effect])
        return one.simulate(one.unknowns(answer["parameters"] | {effect.name: amplitude})) - base

    imitated = detectability(simulator, path, answered(answer, system, gaps[k]), [], signature)
    assert imitated["length"] < 0.05 * whole  # the bend of the response, and a prior that resists by 0.02

    lin = linearised(problem, z, problem.linearise(z))
    colours = {k: _colour(answer["noise"][one.name], one.accuracy) for k, one in enumerate(system.outputs)}
    ways = [-0.5 * step for step in np.eye(len(z))[: len(system.parameters)]]
    far = {k: problem.simulate(z + way) - problem.simulate(z) for k, way in enumerate(ways)}
    straight = {k: length(answer, system, lin, gap) for k, gap in far.items()}
    sharpest = sorted(straight, key=lambda k: -straight[k])[:2]
    assert straight[sharpest[0]] > 10.0  # by straight lines it would be a gap
    for k in sharpest:  # what it costs is that the prior thinks less of the other value
        assert fitted_square(lin, far[k], colours) < 0.5**2 + 2 * np.abs(ways[k] * z).max() + 20 * SETTLED

    bias = np.zeros_like(gaps[0])
    k = 1
    bias[k] = 2.0 * size[k]
    name = f"sensor.{system.output_names[k]}.bias"
    biased = detectability(simulator, path, answered(answer, system, bias), [effects[name]], signature)
    assert biased["beside"][name] < 0.3 * biased["length"]
    assert biased["length"] > 5.0


@pytest.mark.slow
def test_a_cause_imitates_its_own_gap_where_nobody_counted_and_the_days_before_differ(default_system, tmp_path):
    """On the published recording, its first day before it and mean persons in it, the same cause made another gap."""
    truth = load_truth(default_truth(default_system), default_system)
    generator = Generator(default_system, truth, hours=HOURS)
    effect = next(one for one in generator.effects if one.name == "blinds")
    case = Case(20, 0, "library", (Cause(effect, 0.9),), unknown_occupancy=True, replay=False)
    made = generator.make_case(case)
    outputs, noises = measured(made, generator.system, truth)
    write(tmp_path / "recording.nc", published(made, outputs, generator.system, truth))
    answer = answer_of(made, noises, generator.system)
    signature = partial(generator.signature, made)
    others = [one for one in generator.effects if one.kind == "sensor"]
    found = detectability(generator.model, tmp_path / "recording.nc", answer, [effect, *others], signature)
    assert found["length"] > 5.0
    assert found["beside"][effect.name] < found["length"] / 3
    assert min(found["beside"][one.name] for one in others if one.name in found["beside"]) > found["length"] / 2


@pytest.mark.parametrize("replay", [False, True])
def test_a_signature_is_the_gap_that_its_cause_makes(default_system, replay):
    """But for the walls: a truth without a cause leaves as much."""
    truth = load_truth(default_truth(default_system), default_system)
    generator = Generator(default_system, truth, hours=HOURS)
    for name, amplitude in (("meter.flow.gain", 0.4), ("bridge", 100.0)):
        effect = next(one for one in generator.effects if one.name == name)
        cases = [
            Case(20, 11, "library", causes, unknown_occupancy=True, replay=replay)
            for causes in ((Cause(effect, amplitude),), ())
        ]
        made, without = (generator.make_case(case) for case in cases)
        gap = made.clean - made.base
        left = gap - generator.signature(made, effect, amplitude)
        walls = np.abs(without.clean - without.base).max(axis=1)
        floor = np.array([one.accuracy for one in default_system.outputs])
        assert (np.abs(gap).max(axis=1) > 4 * (walls + floor)).any()
        assert (np.abs(left).max(axis=1) < 2 * walls + 5 * floor).all()
        assert not generator.signature(made, effect, 0.0).any()
