"""FMUs of both versions and kinds against analytic results."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from shared.errors import SystemDescriptionError
from tests.datagen.fmus import rewritten

VARIABLE = 'canHandleVariableCommunicationStepSize="true"'
INTERPOLATES = VARIABLE + ' canInterpolateInputs="true"'
STEPWISE = {"attributes": VARIABLE}


def inputs(stop, **signals):
    return merge(signals, 0.0, stop)


def ramp(stop, slope=1.0):
    return Piecewise(np.array([0.0, stop]), np.array([0.0, slope * stop]))


def steps(times, values):
    return Piecewise(np.array(times), np.array(values, dtype=float), "previous")


@pytest.fixture
def run_of(small_system):
    """``run_of(flavour, name, values, stop, ...)``: what a small FMU does with these parameter values."""

    def simulated(flavour, name, values, stop, table=None, *, outputs, step, tolerance=None, **words):
        version, kind = flavour
        names = {"outputs": dict.fromkeys(outputs, "point")} if isinstance(outputs, tuple) else {"outputs": outputs}
        system = small_system(name, version, (kind,), **names, parameters=tuple(values), step=step, **words)
        table = inputs(stop) if table is None else table
        return Simulator(system).run(values, table, start=0.0, stop=stop, tolerance=tolerance)

    return simulated


@pytest.fixture(params=[(2, "me"), (3, "cs")], ids=["fmi2-me", "fmi3-cs"])
def flavour(request):
    """Both versions and both kinds; the ball and the lag have all four."""
    return request.param


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmi(request):
    return request.param


def bounces(height, g, e, count):
    """Times of the first bounces and heights between them, exactly."""
    speed = np.sqrt(2 * g * height)
    first = speed / g
    flights = 2 * speed * e ** np.arange(1, count) / g
    return first + np.concatenate([[0.0], np.cumsum(flights)])


def height_at(t, height, g, e):
    when = bounces(height, g, e, 60)
    k = np.searchsorted(when, t, side="right")
    speed = np.sqrt(2 * g * height) * e**k
    since = t - when[np.maximum(k - 1, 0)]
    flying = speed * since - 0.5 * g * since**2
    return np.where(k == 0, height - 0.5 * g * t**2, flying)


@pytest.mark.parametrize(("version", "kind"), [(2, "me"), (3, "me"), (2, "cs"), (3, "cs")])
def test_a_ball_bounces_when_it_should(run_of, version, kind):
    run = run_of((version, kind), "ball", {"g": 9.81, "e": 0.8}, 3.0, outputs=("h", "bounces"), step=1 / 128)
    good = 1e-6 if kind == "me" else 6e-3  # Co-Simulation: the FMU's own Euler steps
    assert np.abs(run.outputs[0] - height_at(run.time, 1.0, 9.81, 0.8)).max() < good
    expected = np.searchsorted(bounces(1.0, 9.81, 0.8, 60), run.time)
    assert (run.outputs[1] != expected).mean() < (1e-9 if kind == "me" else 0.02)


@pytest.mark.parametrize(
    ("rate", "top", "closes"), [(1.0, 3.0, 3.0), (0.5, 2.0, 4.0), (-1.0, -3.0, 3.0), (1.0, 0.0, 0.0)]
)
def test_an_event_where_an_indicator_is_exactly_zero_is_no_end_of_it(run_of, fmi, rate, top, closes):
    """The integrator is at z = 0 where an output falls on it, and the FMU's domains are z > 0 and z <= 0."""
    run = run_of((fmi, "me"), "meter", {"rate": rate, "top": top}, 8.0, outputs=("x", "closed"), step=1.0)
    np.testing.assert_allclose(run.outputs[0], rate * run.time, atol=1e-9)
    after = run.time > closes
    assert np.array_equal(run.outputs[1][run.time != closes], (after == (rate > 0))[run.time != closes])


def echo(t, count=12):
    """x' = -x(t - 1), x = 1 before: a sum of powers, one more in each second (method of steps)."""
    return sum((-1) ** k * np.maximum(t - (k - 1), 0.0) ** k / math.factorial(k) for k in range(count))


@pytest.mark.parametrize("step", [0.125, 1.0, 5.0])
def test_an_fmu_that_keeps_a_history_is_told_of_every_step(run_of, fmi, step):
    """However far outputs lie apart; it joins what it remembers by straight lines."""
    run = run_of((fmi, "me"), "echo", {"k": 1.0}, 10.0, outputs=("x",), step=step)
    np.testing.assert_allclose(run.outputs[0], echo(run.time), atol=0.01)


def test_a_stair_counts_at_each_second(run_of, flavour):
    """A count at the very time of its event is the one just before it; between events it is exact."""
    run = run_of(flavour, "stair", {"period": 1.0}, 20.0, outputs=("count",), step=0.25)
    on_event = run.time % 1.0 == 0
    np.testing.assert_array_equal(run.outputs[0][~on_event], 1 + np.floor(run.time[~on_event]))
    if flavour[1] == "me":
        np.testing.assert_array_equal(run.outputs[0][on_event], run.time[on_event])


def van_der_pol(mu, times):
    """x, y and the integral of x at some times, shape (3, times)."""

    def rates(_t, s):
        return [s[1], mu * (1 - s[0] ** 2) * s[1] - s[0], s[0]]

    return solve_ivp(rates, (0, times[-1]), [2.0, 0.0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13).y


def test_van_der_pol_against_a_tight_reference(run_of, fmi):
    run = run_of((fmi, "me"), "vanderpol", {"mu": 1.5}, 10.0, outputs=("x", "y"), step=0.5, tolerance=1e-12)
    np.testing.assert_allclose(run.outputs, van_der_pol(1.5, run.time)[:2], atol=1e-8)


def test_means_of_all_kinds(run_of, flavour):
    found = run_of(flavour, "vanderpol", {"mu": 1.0}, 4.0, outputs={"x": "mean"}, step=0.5).outputs[0]
    exact = np.diff(van_der_pol(1.0, np.arange(0, 4.1, 0.5))[2]) / 0.5
    # Co-Simulation: a trapezoid over twelve communication steps, and Euler steps within
    np.testing.assert_allclose(found, exact, atol=1e-6 if flavour[1] == "me" else 2e-3)


@pytest.mark.parametrize(
    ("version", "kind", "attributes"),
    [(2, "me", ""), (3, "me", ""), *((v, "cs", a) for v in (2, 3) for a in ("", VARIABLE, INTERPOLATES))],
)
def test_an_input_acts_within_the_step(run_of, version, kind, attributes):
    """x' = (u - x) / tau under a ramp: x = t - tau (1 - exp(-t / tau)). A frozen input would lag by half a step."""
    more = {"outputs": ("x",), "inputs": {"u": "linear"}, "step": 0.5, "attributes": attributes}
    run = run_of((version, kind), "lag", {"tau": 1.5}, 5.0, inputs(5.0, u=ramp(5.0)), **more)
    exact = run.time - 1.5 * (1 - np.exp(-run.time / 1.5))
    good = 1e-7 if kind == "me" else 1e-3 if version == 2 and "Interpolate" in attributes else 0.015
    assert np.abs(run.outputs[0] - exact).max() < good
    assert np.abs(run.outputs[0][-1] - exact[-1]) < 0.2 * 0.5  # frozen: half a step


def test_inputs_pass_through(run_of, flavour):
    """Continuous and discrete inputs, declared the other way round than the FMU has them."""
    table = inputs(4.0, switch=steps([0.0, 1.1, 2.6], [1.0, 3.0, 2.0]), u=ramp(4.0, 0.5))
    more = {"outputs": ("stepped", "y"), "inputs": {"switch": "previous", "u": "linear"}, "step": 0.25, **STEPWISE}
    run = run_of(flavour, "feedthrough", {"gain": 2.0}, 4.0, table, **more)
    expected = 2.0 * np.select([run.time <= 1.1, run.time <= 2.6], [1.0, 3.0], 2.0)
    np.testing.assert_allclose(run.outputs[0], expected)
    np.testing.assert_allclose(run.outputs[1], run.time)
    np.testing.assert_allclose(run.inputs[1], 0.5 * run.time)


def test_a_resource_is_read(run_of, flavour):
    run = run_of(flavour, "resource", {"gain": 2.0}, 1.0, outputs=("y",), step=0.125, number="6.25")
    np.testing.assert_array_equal(run.outputs[0], np.full(8, 12.5))


def test_a_discrete_input_cannot_be_linear(run_of, fmi):
    signals = {"u": "linear", "switch": "linear"}
    with pytest.raises(SystemDescriptionError, match=r"'switch' is discrete.*previous"):
        run_of((fmi, "me"), "feedthrough", {"gain": 2.0}, 4.0, outputs=("y",), inputs=signals, step=0.125)


@pytest.mark.parametrize(
    ("fmi", "old", "new", "words"),
    [
        (3, '<Float64 name="y"', '<Int32 name="y"', r"output 'y' is not a Float64 but a Int32"),
        (3, 'start="1.0"/>', 'start="1 1"><Dimension start="2"/></Float64>', "parameter array of Float64"),
        (2, '<Real start="1.0"/>', '<Integer start="1"/>', r"'gain' is a parameter Integer.*expected a Real"),
    ],
)
def test_other_types_are_refused(small_system, tmp_path, fmi, old, new, words):
    """In one sentence, before anything runs."""
    signals = {"u": "linear", "switch": "previous"}
    system = small_system("feedthrough", fmi, outputs={"y": "point"}, parameters=("gain",), inputs=signals)
    other = rewritten(system.fmu_path, tmp_path / "other.fmu", (old, new))
    changed = system.model_copy(update={"fmu": str(other)})
    with pytest.raises(SystemDescriptionError, match=words):
        Simulator(changed)


@pytest.mark.parametrize("kind", ["me", "cs"])
def test_the_time_of_an_fmu_is_never_negative(small_system, fmi, kind, monkeypatch):
    """A warm-up before time 0 is simulated a whole year later, with the same inputs and to the same end."""
    names = {"outputs": {"x": "point"}, "parameters": ("tau",), "inputs": {"u": "linear"}}
    simulator, begun = Simulator(small_system("lag", fmi, (kind,), **names, step=3600.0, **STEPWISE)), []
    told = simulator.fmu.interface.set_up
    monkeypatch.setattr(simulator.fmu.interface, "set_up", lambda at, *rest: (begun.append(at), told(at, *rest)))
    times = np.arange(-4, 3) * 3600.0
    signal = Piecewise(times, np.sin(times / 9000.0))
    span = {"start": -14400.0, "stop": 7200.0}
    run = simulator.run({"tau": 5000.0}, merge({"u": signal}, *span.values()), **span, record_from=0.0)
    assert begun == [8760 * 3600.0 - 14400.0]
    np.testing.assert_array_equal(run.time, [3600.0, 7200.0])
    exact = solve_ivp(
        lambda t, x: (signal.at(t) - x) / 5000.0, (*span.values(),), [0.0], t_eval=run.time, max_step=600, rtol=1e-8
    )
    np.testing.assert_allclose(run.outputs[0], exact.y[0], atol=1e-5 if kind == "me" else 2e-3)
