"""Simulations of a command: answered from memory or from files, never for another run, and none after its time."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator, Trajectory
from diagnosis.cli import app
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import FOLDER, Cluster, Kept, Run, Simulations, Warmed, key_of, side_by_side
from diagnosis.recording import HOUR, read_recording
from shared.console import FAULT, start
from shared.errors import ClusterError, SimulationError, TimeUp

BEFORE, LENGTH = 48 * HOUR, 24 * HOUR


@pytest.fixture
def room(default_system):
    """A simulator of the default system and a run with persons from the tenth hour of the recording on."""
    system = default_system.with_experiment(step=HOUR, hours=LENGTH / HOUR)
    usual = {"TDryBul": 278.0, "TSky": 268.0, "winSpe": 3.0, "TSet": 294.0}
    signals = {one.name: Piecewise([0.0], [usual.get(one.name, 0.0)], "previous") for one in system.inputs}

    def run(persons, temperature=278.0):
        changed = {
            one.name: Piecewise([0.0, BEFORE + 10 * HOUR], [0.0, persons], "previous")
            for one in system.inputs
            if one.source == "occupancy"
        } | {"TDryBul": Piecewise([0.0], [temperature], "previous")}
        inputs = merge(signals | changed, 0.0, BEFORE + LENGTH)
        middle = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
        return Run(middle, inputs, start=0.0, stop=BEFORE + LENGTH, record_from=BEFORE, tolerance=1e-6)

    return Simulator(system), run


def test_two_parts_give_what_one_gives(room):
    simulator, run = room
    warmed = Warmed(simulator)
    found = warmed.outputs(run(8.0))
    assert warmed.cut is True
    whole = simulator.run(
        run(8.0).parameters, run(8.0).inputs, start=0.0, stop=BEFORE + LENGTH, record_from=BEFORE, tolerance=1e-6
    ).outputs
    accuracy = np.array([[one.accuracy] for one in simulator.system.outputs])
    assert (np.abs(found - whole) <= 0.3 * accuracy).all()


class Relay:
    """What Model Exchange does not show: it counts how often it was switched, in a variable that it hides."""

    def __init__(self, hidden=True):
        counter = SimpleNamespace(variability="discrete", causality="local")
        self.fmu = SimpleNamespace(cosimulation=False, n_states=1, variables={} if hidden else {"count": counter})
        self.system = SimpleNamespace(outputs=[SimpleNamespace(accuracy=0.01)])

    def run(self, parameters, inputs, *, start, stop, record_from=None, **_):
        switched = 1.0 + (start > 0)
        outputs = np.full((1, 24), switched)
        return Trajectory(np.arange(24.0), outputs, np.empty((0, 24)), np.zeros((2, 1)), {})


@pytest.mark.parametrize("hidden", [True, False])
def test_an_fmu_that_remembers_more_than_its_states_is_not_cut(room, hidden):
    _, run = room
    warmed = Warmed(Relay(hidden))
    assert warmed.cut is (None if hidden else False)
    for _ in range(2):
        np.testing.assert_array_equal(warmed.outputs(run(1.0)), np.ones((1, 24)))
    assert warmed.cut is False


class Counting:
    """Answers with what it is given, and how often it was asked."""

    def __init__(self):
        self.asked = 0

    def map(self, runs):
        self.asked += len(runs)
        return [SimulationError("no") if run.parameters["a"] < 0 else np.full((1, 2), self.asked * 1.0) for run in runs]


def a_run(value=1.0):
    table = merge({"x": Piecewise(np.array([0.0, 5.0]), np.array([1.0, 2.0]))}, 0.0, 10.0)
    return Run({"a": value, "b": 2.0}, table, start=0.0, stop=10.0, record_from=0.0)


@pytest.mark.parametrize(
    "other",
    [
        {"parameters": {"a": 1.0, "b": 2.5}},
        {"inputs": replace(a_run().inputs, left=a_run().inputs.left + 1e-9)},
        {"inputs": replace(a_run().inputs, right=a_run().inputs.right + 1e-9)},
        {"stop": 9.0},
        {"record_from": 1.0},
        {"replay": True},
        {"tolerance": 1e-7},
    ],
)
def test_another_run_is_simulated(other):
    memory = Simulations(Counting())
    memory.map([a_run()])
    memory.map([replace(a_run(), **other)])
    assert memory.asked == 2


def saved(folder, about="room", **options):
    """Simulations beside an answer, and what makes them."""
    made = Counting()
    return Simulations(made, kept=Kept(folder / FOLDER, {"recording": about}), **options), made


def test_what_was_saved_is_found_again_failures_as_well(tmp_path):
    first, _ = saved(tmp_path)
    runs = [a_run(1.0), a_run(-1.0), a_run(2.0)]
    before = first.map(runs)
    first.end()
    again, runner = saved(tmp_path)
    after = again.map(runs)
    assert (again.asked, again.made, runner.asked) == (3, 0, 0)  # a report counts them as if they had been made
    assert str(after[1]) == str(before[1]) == "no"
    np.testing.assert_array_equal(after[2], before[2])
    again.map([a_run(3.0)])
    assert again.made == 1


def test_what_is_of_something_else_is_removed_and_what_is_broken_is_left_aside(tmp_path, caplog):
    first, _ = saved(tmp_path)
    first.map([a_run()])
    first.end()
    (file,) = (tmp_path / FOLDER).glob("*.npz")
    file.write_bytes(file.read_bytes()[:-40])  # cut off by a full disk
    broken, runner = saved(tmp_path)
    broken.map([a_run()])
    assert runner.asked == 1
    broken.end()
    with caplog.at_level("INFO", logger="zeroshot"):
        other, runner = saved(tmp_path, about="another room")
    assert "is of another recording, system or version; it is removed" in caplog.text
    assert not (tmp_path / FOLDER).exists()
    other.map([a_run()])
    assert runner.asked == 1


def test_nothing_that_was_saved_is_executed(tmp_path):
    """An array of objects is a pickle, which runs whatever it likes: it is not opened."""
    first, _ = saved(tmp_path)
    first.map([a_run()])
    first.end()
    (file,) = (tmp_path / FOLDER).glob("*.npz")
    np.savez(file, **{key_of(a_run()): np.array([{}], dtype=object)})
    again, runner = saved(tmp_path)
    again.map([a_run()])
    assert runner.asked == 1


def test_when_the_time_is_up_nothing_more_is_simulated_but_what_completes_an_answer(tmp_path):
    late, runner = saved(tmp_path, minutes=1e-9)
    with pytest.raises(TimeUp, match="goes on from where"):
        late.map([a_run()])
    assert late.time_up and runner.asked == 0
    with late.lifted():
        late.map([a_run()])
    late.map([a_run()])  # what is known needs no time
    assert runner.asked == 1


def test_without_a_worker_there_is_no_runner():
    refused = pytest.raises(ClusterError, match="workers is 0; expected at least 1")
    with refused, side_by_side(None, workers=0):
        pass


@pytest.mark.slow
def test_both_are_not_given_to_a_fit(house, house_recording, tmp_path, capsys):
    words = [str(house("me").path), str(house_recording(hours=48)), "--out", str(tmp_path / "out")]
    for command in ("calibrate", "run"):
        assert start(app, [command, *words, "--workers", "4", "--scheduler", "tcp://127.0.0.1:1"]) == FAULT
        assert "workers is given; expected one of both" in capsys.readouterr().err.replace("\n", " ")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_same_outputs_wherever_they_are_simulated(house, house_recording):
    from distributed import Client, LocalCluster

    system = house("me")
    record = read_recording(house_recording(hours=24), system)
    simulator = Simulator(system)

    def outputs(runner):
        problem = Problem(simulator, record, known=["history"], runner=runner)
        return problem.simulate_all([(np.ones(4), problem.nuisance.mean)])[0]  # more would take more processes

    with side_by_side(simulator) as runner:
        alone = outputs(runner)
    with side_by_side(simulator, workers=2) as runner:
        np.testing.assert_array_equal(outputs(runner), alone)
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        np.testing.assert_array_equal(outputs(Cluster(system, client)), alone)
