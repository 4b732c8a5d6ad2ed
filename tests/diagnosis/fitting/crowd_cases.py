"""Persons who were counted and persons who were not, in a warm room where they open a window."""

import numpy as np
import pytest
from scipy.special import ndtri

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects import build
from diagnosis.recording import read_recording
from shared.effects import InputEffect
from shared.system import load_system

HALF_HOUR = 1800.0


def warm_room(path):
    """Four warm days of the default room by the half hour, written to ``path``: simulator and recording."""
    system = load_system("fmus/MixedAirCO2")
    system = system.with_experiment(step=HALF_HOUR, hours=96.0, start=(3500.0, 3500.0))
    simulate(system, hours=96.0, seed=11, out=path)
    return Simulator(system), read_recording(path, system)


def on_persons(system, operation, factor=1.0, shape=()):
    """A user's effect on the persons."""
    on = {"name": "persons", "kind": "input", "unit": "1", "input": "nPer", "scale": 0.5, "lower": -0.9, "upper": 4.0}
    return build(InputEffect(operation=operation, factor=factor, shape=list(shape), **on), system)


def as_counted(problem, recording, level):
    """Unknowns with a level, and heights (pulses,) with which the pulses are the persons who were counted.

    Before the recording they are the description's usual ones.
    """
    z = np.zeros(problem.size)
    one = problem.nuisance.levels[0]
    z[-1] = ndtri((level - one.low) / (one.high - one.low))
    place = problem.system.input_names[one.column]
    middle = 0.5 * (problem.nuisance.begin + problem.nuisance.end)
    persons = recording.inputs[place][np.searchsorted(recording.time, middle)]
    persons = np.where(problem.nuisance.guessed, persons, 0.0)
    counted = recording.inputs[place].sum() * recording.step
    assert persons.sum() * HALF_HOUR == pytest.approx(counted)  # nobody came when nobody may
    return z, persons / level
