"""What nothing can imitate of a gap: against dense covariances, and against gaps whose imitators are known."""

import numpy as np
import pytest

from datagen import simulate
from datagen.driving.sampling import sample_parameters
from datagen.simulating.simulator import Simulator
from diagnosis.blind.detectability import INSIDE, _colour, detectability, fitted_square
from diagnosis.fitting.lines import linearised, metered
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import SETTLED
from diagnosis.recording import HOUR, read_recording

HOURS, SLOW = 72.0, {"slow_share": 0.3, "hours": 5.0}


@pytest.fixture(scope="module")
def simulator(default_system):
    """Constants are known: the fewer unknowns, the fewer simulations."""
    return Simulator(default_system.with_experiment(hours=HOURS).model_copy(update={"uncertain": []}))


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
    found = detectability(simulator, path, answered(answer, system, gap), [])["length"]

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


def test_a_parameter_s_gap_is_imitated(simulator, made, problem):
    path, answer = made
    system = simulator.system
    z = problem.unknowns(answer["parameters"])
    size = np.array([[one.noise["sensor"].sd] for one in system.outputs])
    gaps = [problem.simulate(z + 0.02 * step) - problem.simulate(z) for step in np.eye(len(z))]
    whole, k = max((float(np.sqrt(np.sum((gap / size) ** 2))), k) for k, gap in enumerate(gaps))
    assert whole > 5.0
    imitated = detectability(simulator, path, answered(answer, system, gaps[k]), [])
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
