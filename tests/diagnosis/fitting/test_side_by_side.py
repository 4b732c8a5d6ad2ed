"""Simulations side by side give what they give one after another."""

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.cli import app
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import Cluster, side_by_side
from diagnosis.recording import read_recording
from shared.console import FAULT, start
from shared.errors import ClusterError


def test_without_a_worker_there_is_no_runner():
    refused = pytest.raises(ClusterError, match="workers is 0; expected at least 1")
    with refused, side_by_side(None, workers=0):
        pass


@pytest.mark.slow
def test_both_are_not_given_to_a_fit(house, house_recording, tmp_path, capsys):
    house("me")
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
    cases = [(np.full(4, z), None) for z in (-1.0, 1.0)]

    def outputs(runner):
        problem = Problem(simulator, record, history=False, runner=runner)
        return np.stack(problem.simulate_all([(z, problem.nuisance.mean) for z, _ in cases]))

    with side_by_side(simulator) as runner:
        alone = outputs(runner)
    with side_by_side(simulator, workers=2) as runner:
        np.testing.assert_array_equal(outputs(runner), alone)
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        np.testing.assert_array_equal(outputs(Cluster(system, client)), alone)
