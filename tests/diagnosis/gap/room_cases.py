"""Recordings of the default room: the shipped FMU with an effect, seen through its sensors."""

from dataclasses import replace

import numpy as np

from datagen import simulate
from diagnosis.effects import library
from diagnosis.fitting.runs import Unknowns
from diagnosis.recording import HOUR, read_recording
from shared.system import load_system

ROOM = "fmus/MixedAirCO2"


def room():
    """The system."""
    return load_system(ROOM)


def some(system, *names):
    """Candidates by name."""
    return [one for one in library(system) if one.name in names]


def noisy(record, system, seed):
    """A recording as its sensors show it."""
    rng = np.random.default_rng(seed)
    shown = record.outputs.copy()
    for k, output in enumerate(system.outputs):
        sensor = output.noise["sensor"]
        shown[k] = np.round((shown[k] + sensor.sd * rng.standard_normal(shown.shape[1])) / sensor.quantum)
        shown[k] *= sensor.quantum
        shown[k, rng.random(shown.shape[1]) < sensor.dropout] = np.nan
    return replace(record, outputs=shown)


def recorded(path, system, *, seed=11, hours=168.0, fmu=None, readings=None):
    """One week: ``fmu`` sets parameters of effects, ``readings`` changes (outputs, time) before the noise."""
    simulate(system, parameters=fmu or {}, hours=hours, seed=seed, out=path)
    record = read_recording(path, system)
    if readings is not None:
        record = replace(record, outputs=readings(record.outputs.copy(), record.time))
    return noisy(record, system, seed)


def in_the_middle(system, path, *, hours):
    """The system by the hour, and what it does with the middle of the prior, written without noise to ``path``."""
    system = system.with_experiment(step=HOUR, hours=hours)
    middle = Unknowns(system, (), (), ()).values(np.zeros(len(system.parameters)))
    truth = dict(zip((one.name for one in system.parameters), middle, strict=True))
    simulate(system, parameters=truth, hours=hours, seed=8, out=path)
    return system
