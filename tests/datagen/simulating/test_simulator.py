"""The integrator against exact solutions, against fmpy where that is right, and against itself."""

import fmpy
import numpy as np
import pytest

from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import sample_parameters
from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from shared.errors import FmuError, SimulationError
from shared.system import load_system

VOLUME, DENSITY, PPM_PER_SHARE = 150.0, 1.2, 28.9647 / 44.0095 * 1e6
BASE = {"TDryBul": 283.15, "TSky": 273.15, "winSpe": 2.0, "CO2Out": 420.0, "TSet": 293.15}


@pytest.fixture(scope="module")
def simulator(default_system):
    return Simulator(default_system)


def constant_inputs(simulator, stop, **signals):
    names = simulator.system.input_names
    given = {n: Piecewise.constant(BASE.get(n, 0.0)) for n in names}
    return merge({**given, **signals}, 0.0, stop)


def middle(system):
    return {p.name: float(p.from_unit(0.5)) for p in system.parameters}


def test_a_ramp_is_integrated_not_held_and_a_step_within_the_hour_is_exact(simulator):
    """Of persons, over one output step: CO2 follows the exact solution of its linear balance.

    A solver that holds its inputs over the step would show no CO2 at all.
    """
    stop, flow, rate, when = 3600.0, 0.1, 5.0 / 3600, 1234.5
    ramp = Piecewise(np.array([0.0, stop]), np.array([0.0, rate * stop]))
    step = Piecewise(np.array([0.0, when]), np.array([0.0, 7.0]), "previous")
    parameters = {**middle(simulator.system), "roo.V": VOLUME, "CO2_start": 420.0}
    tau = DENSITY * VOLUME / flow
    of_ramp = rate / flow * (stop - tau * (1 - np.exp(-stop / tau)))
    of_step = 7.0 / flow * (1 - np.exp(-(stop - when) / tau))
    for persons, expected in ((ramp, of_ramp), (step, of_step)):
        table = constant_inputs(simulator, stop, nPer=persons, mOA_in=Piecewise.constant(flow))
        found = simulator.run(parameters, table, start=0.0, stop=stop, replay=True, tolerance=1e-9).outputs[1, -1]
        assert found - 420.0 == pytest.approx(parameters["gaiCO2.k"] * expected * PPM_PER_SHARE, rel=1e-5)


def test_means_are_means(simulator):
    """The recorded mean of a ramp is its middle; the mean heater power is that of a fine record of itself."""
    stop = 7200.0
    ramp = Piecewise(np.array([0.0, stop]), np.array([0.1, 0.3]))
    table = constant_inputs(simulator, stop, mOA_in=ramp, QHea_in=Piecewise.constant(1000.0))
    outputs = simulator.run(middle(simulator.system), table, start=0.0, stop=stop, replay=True).outputs
    np.testing.assert_allclose(outputs[3], [0.15, 0.25], rtol=1e-4)
    np.testing.assert_allclose(outputs[2], [1000.0, 1000.0], rtol=1e-9)
    table = constant_inputs(simulator, stop)
    parameters = middle(simulator.system)
    coarse = simulator.run(parameters, table, start=0.0, stop=stop, tolerance=1e-8).outputs[2]
    fine = simulator.run(parameters, table, start=0.0, stop=stop, step=60.0, tolerance=1e-8).outputs[2]
    np.testing.assert_allclose(fine.reshape(2, 60).mean(axis=1), coarse, rtol=1e-5)
    assert coarse[0] > 500


@pytest.mark.slow
def test_agrees_with_fmpy_where_fmpy_is_right(simulator, default_system):
    """Four winter days with inputs constant over each hour, given to fmpy as double knots, where it is exact."""
    stop = 4 * 86400.0
    real = build_inputs(default_system, root_seed=1, index=2, start=0.0, stop=stop)
    edges = np.arange(0.0, stop + 1, 3600.0)
    means = real.means(edges)
    names = default_system.input_names
    table = merge({n: Piecewise(edges[:-1], means[:, k], "previous") for k, n in enumerate(names)}, 0.0, stop)
    double = np.zeros(2 * len(means), dtype=[("time", "f8"), *((n, "f8") for n in names)])
    double["time"] = np.repeat(edges, 2)[1:-1]
    for k, name in enumerate(names):
        double[name] = np.repeat(means[:, k], 2)
    values = dict(zip(default_system.parameter_names, sample_parameters(default_system, 1, 2).tolist(), strict=True))
    ours = simulator.run(values, table, start=0.0, stop=stop, tolerance=1e-8).outputs
    theirs = fmpy.simulate_fmu(
        str(default_system.fmu_path),
        stop_time=stop,
        start_values={**default_system.fixed, **values},
        input=double,
        output=["TRoo", "CO2"],
        output_interval=3600.0,
        relative_tolerance=1e-8,
        record_events=False,
    )
    assert np.abs(ours[0] - theirs["TRoo"][1:]).max() < 2e-4
    assert np.abs(ours[1] - theirs["CO2"][1:]).max() < 2e-3
    assert np.ptp(ours[0]) > 2  # the room did move
    assert np.ptp(ours[1]) > 50


def test_the_farms_tolerance_is_good_for_the_declared_accuracy(simulator, default_system):
    """A month at the description's tolerance stays within each output's ``accuracy`` of a much tighter run."""
    stop = 30 * 86400.0
    table = build_inputs(default_system, root_seed=4, index=0, start=0.0, stop=stop)
    values = dict(zip(default_system.parameter_names, sample_parameters(default_system, 4, 0).tolist(), strict=True))
    loose = simulator.run(values, table, start=0.0, stop=stop).outputs
    tight = simulator.run(values, table, start=0.0, stop=stop, tolerance=1e-10).outputs
    for k, output in enumerate(default_system.outputs):
        assert np.sqrt(np.mean((loose[k] - tight[k]) ** 2)) < output.accuracy, output.name


def test_the_same_run_gives_the_same_bits(simulator, default_system):
    stop = 3 * 86400.0
    table = build_inputs(default_system, root_seed=2, index=1, start=0.0, stop=stop)
    first = simulator.run(middle(default_system), table, start=0.0, stop=stop)
    simulator.run({**middle(default_system), "roo.V": 50.0}, table, start=0.0, stop=stop)
    again = simulator.run(middle(default_system), table, start=0.0, stop=stop)
    fresh = Simulator(default_system).run(middle(default_system), table, start=0.0, stop=stop)
    assert first.outputs.tobytes() == again.outputs.tobytes() == fresh.outputs.tobytes()


def test_a_run_continues_from_its_states(simulator, default_system):
    stop, half = 4 * 86400.0, 2 * 86400.0
    table = build_inputs(default_system, root_seed=2, index=3, start=0.0, stop=stop)
    whole = simulator.run(middle(default_system), table, start=0.0, stop=stop, record_states=True, tolerance=1e-8)
    assert whole.states.shape == (97, simulator.fmu.n_states)
    later = simulator.run(
        middle(default_system), table, start=half, stop=stop, initial_states=whole.states[48], tolerance=1e-8
    )
    np.testing.assert_allclose(later.outputs[0], whole.outputs[0, 48:], atol=1e-3)
    np.testing.assert_allclose(later.outputs[1], whole.outputs[1, 48:], atol=0.05)


def test_recorded_inputs_are_instants_and_means(simulator):
    stop = 7200.0
    table = constant_inputs(
        simulator,
        stop,
        TDryBul=Piecewise(np.array([0.0, stop]), np.array([280.0, 290.0])),
        nPer=Piecewise(np.array([0.0, 1800.0]), np.array([0.0, 4.0]), "previous"),
    )
    inputs = simulator.run(middle(simulator.system), table, start=0.0, stop=stop).inputs
    names = simulator.system.input_names
    np.testing.assert_allclose(inputs[names.index("TDryBul")], [285.0, 290.0])
    np.testing.assert_allclose(inputs[names.index("nPer")], [2.0, 4.0])


def test_bad_values_stop_with_the_fmus_own_words(simulator):
    table = constant_inputs(simulator, 3600.0)
    with pytest.raises(SimulationError, match=r"MixedAirCO2\.fmu.*absSolFra"):
        simulator.run({**middle(simulator.system), "glaSys.absSolFra": 0.99}, table, start=0.0, stop=3600.0)


def test_a_bad_input_is_an_error_never_short_data(simulator):
    table = constant_inputs(simulator, 7200.0)
    table.left[0, simulator.system.input_names.index("TDryBul")] = np.nan
    with pytest.raises(SimulationError, match=r"stopped at|at t = "):
        simulator.run(middle(simulator.system), table, start=0.0, stop=7200.0)


def test_a_description_that_was_copied_without_its_fmu_says_which_field_leads_nowhere(default_system, tmp_path):
    copied = tmp_path / "system.toml"
    copied.write_bytes(default_system.path.read_bytes())
    with pytest.raises(FmuError, match=rf"system.toml: fmu is '{default_system.fmu}', but \S+ is not there"):
        Simulator(load_system(copied))
