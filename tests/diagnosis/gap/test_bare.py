"""An effect that does nothing is worth nothing wherever it was fitted, if the base model is fitted there as well."""

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Nothing
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.gap.bare import bare
from diagnosis.gap.colours import estimated_colours
from diagnosis.gap.grams import Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import refit
from diagnosis.gap.search import settled_base
from diagnosis.recording import read_recording
from tests.diagnosis.gap.room_cases import in_the_middle


@pytest.mark.slow
def test_what_does_nothing_gains_nothing_on_lines_that_make_up_for_the_base_models(default_system, tmp_path):
    """Nobody counted the persons, so that the lines of the nuisance are bent."""
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=49.0)
    record = read_recording(tmp_path / "room.nc", system)
    whole = Problem(Simulator(system), record, occupancy="unknown", replay=True)
    base = settled_base(fit(whole.with_effects(()), rounds=2), whole.observed)
    grams = Grams(base.lin, whole.observed)
    colours = estimated_colours(grams, whole.floor).best
    before = grams.evidence(colours)
    problem = base.lin.problem.with_effects([Nothing("idle")])
    first = len(system.parameters)
    z = np.insert(base.lin.z, first, 0.3)
    z[:first] += 0.5
    lin = linearised(problem, z, problem.linearise(z))  # at the usual persons, not those that were there
    one = refit(Grams(lin, whole.observed), colours, z, ())
    made = bare(one, base, colours)
    assert abs(one.evidence - before) > 5.0
    assert max(there.evidence for there in made) == pytest.approx(one.evidence, abs=0.5)
    assert [there.names for there in made] == [(), ()] and all(there.simulations > 0 for there in made)
