"""Fits to a part of a recording in which nobody counted persons: the other days tell who was there on them."""

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.gap.refit import settled
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.recording import read_recording
from tests.diagnosis.gap.room_cases import in_the_middle

pytestmark = pytest.mark.slow


def test_persons_of_the_days_kept_from_a_fit_are_told_by_those_days(default_system, tmp_path):
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=120.0)
    record = read_recording(tmp_path / "room.nc", system)
    whole = Problem(Simulator(system), record, occupancy="unknown")
    scored = kept_for_scoring(record)
    fitted = whole.observed & ~scored
    base = fit(whole.with_observed(fitted), rounds=1)  # from the truth, the middle of the prior
    carbon = system.output_names.index("CO2")
    rows = scored & whole.observed[carbon]

    def left(every):
        one = settled(base.problem, base.z, base.around, fitted, whole.floor, renewals=0, every=every)
        return np.sqrt(np.mean((whole.measured - one.lin.outputs)[carbon][rows] ** 2))

    # the usual persons of such a day miss the day that was; told by it, little but the sensor's own error is left
    assert left(whole.observed) < 0.4 * left(fitted)
