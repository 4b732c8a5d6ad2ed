"""The response that a fit made afresh is judged by, against one simulated anew."""

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Nothing
from diagnosis.fitting.problem import Problem
from diagnosis.gap import afresh
from diagnosis.gap.grams import Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import refit
from diagnosis.recording import read_recording


def test_a_fit_made_afresh_is_judged_by_the_response_where_it_ended(house, house_recording, monkeypatch):
    """The level of persons moves in a fit's last step, and their response with it."""
    system = house("me")
    record = read_recording(house_recording(hours=72, count=False), system)
    plain = Problem(Simulator(system), record, occupancy="unknown")
    effect = Nothing("nothing", lower=-5.0, upper=5.0)
    colours = {0: (float(plain.floor[0]), 0.0, 3600.0)}
    start = plain.unknowns({"ro": 7.0, "ri": 0.6, "c": 4.0, "a": 2.5})
    base = linearised(plain, start, plain.linearise(start), [effect])
    one = refit(Grams(base, plain.observed), colours, np.insert(start, 4, 0.1), [effect])
    judged = []
    monkeypatch.setattr(afresh, "refit", lambda grams, *rest: judged.append(grams.lin) or refit(grams, *rest))
    assert afresh.fitted_afresh(plain, one, plain.observed, colours) is not None
    (lin,) = judged
    anew = lin.problem.linearise(lin.z, lin.around.nuisance)
    np.testing.assert_allclose(lin.around.response, anew.response, atol=1e-6 * np.abs(anew.response).max())
