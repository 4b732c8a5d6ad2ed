"""Answers to pulses that share simulations, against those to each pulse alone and for ever."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.linear import LOST, responses
from diagnosis.fitting.problem import Problem
from diagnosis.recording import read_recording

HOUR = 3600.0
FORGETS = {2.0: (2.0, 1.0), 28.0: (7.0, 4.0)}
"""Resistance and capacity of houses, by what they take to forget [h]."""


def test_pulses_that_share_a_simulation_answer_as_alone(house, house_recording):
    """This house forgets by a factor of 50 in half a day; pulses that turn are followed as long, others twice that."""
    system = house("me")
    record = read_recording(house_recording(hours=96, count=False), system)
    problem = Problem(Simulator(system), record, occupancy="unknown", history=False)
    z = problem.unknowns({"ro": 2.5, "ri": 0.6, "c": 1.2, "a": 2.5})  # forgets within 3 h
    base = problem.simulate(z)

    def simulate(runs):
        return problem.simulate_all([(z, problem.nuisance.mean + one) for one in runs])

    together = responses(problem.nuisance, simulate, base, problem.time)
    ever = replace(problem.nuisance, followed=np.full(problem.nuisance.size, 1e9))
    alone = responses(ever, simulate, base, problem.time)
    np.testing.assert_allclose(together, alone, atol=1e-2 * np.abs(alone).max())
    assert np.sum((together - alone) ** 2) < 1e-4 * np.sum(alone**2)
    assert np.abs(alone).max() > 0


@pytest.mark.parametrize("hours", FORGETS)
def test_changes_within_steps_are_followed_as_long_as_a_house_remembers_them(house, house_recording, hours):
    system = house("me")
    record = read_recording(house_recording(hours=240), system)
    problem = Problem(Simulator(system), record, replay=True, history=False)
    assert problem.nuisance.turns.all()
    z = problem.unknowns({"ro": FORGETS[hours][0], "c": FORGETS[hours][1], "ri": 0.6, "a": 2.5})
    around = problem.linearise(z)
    ever = replace(problem.nuisance, followed=np.full(problem.nuisance.size, 1e9))
    alone = responses(ever, lambda runs: problem.simulate_all([(z, one) for one in runs]), around.outputs, problem.time)
    assert around.response.any()
    assert _lost(problem, around.response, alone) < 2 * LOST
    assert 2 * hours * HOUR <= around.lasting or around.lasting >= 8 * HOUR


def _lost(problem, response, alone):
    """Of the mean square of what turned pulses do and of the noise, the share that a response lacks."""
    scale = problem.nuisance.sd / problem.floor[:, None, None]
    missing, whole = (np.sum(((one * scale)[problem.observed]) ** 2) for one in (alone - response, alone))
    return missing / (whole + problem.observed.sum())
