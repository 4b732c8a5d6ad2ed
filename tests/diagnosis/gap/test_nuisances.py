"""How wide nuisances are for a test: what is added for replayed actuators, where it can be known and where not."""

from pathlib import Path

import numpy as np
import pytest

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.inputs import SLOW
from diagnosis.fitting.problem import Problem
from diagnosis.gap.linear import widened
from diagnosis.recording import HOUR, read_recording
from shared.system import load_system

ROOT = Path(__file__).parents[3]
HOURS = 30.0


def before_and_after(name, folder, **experiment):
    """A problem in replay, and the same as wide as it is."""
    system = load_system(ROOT / "fmus" / "MixedAirCO2" / name).with_experiment(hours=HOURS, **experiment)
    path = folder / "recording.nc"
    simulate(system, hours=HOURS, seed=1, index=0, out=path)
    base = fit(Problem(Simulator(system), read_recording(path, system), replay=True, warm_up=24 * HOUR), rounds=0)
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
