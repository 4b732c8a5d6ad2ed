"""Simulations that fail, and outputs that are not finite, cost what they touch and not the diagnosis."""

from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pytest

from diagnosis.effects import Nothing
from diagnosis.fitting.side_by_side import InProcess
from diagnosis.gap import diagnose, diagnosed
from shared.errors import SimulationError
from tests.diagnosis.gap.gap_cases import candidates


@dataclass(frozen=True)
class Broken(Nothing):
    """A sensor that shows nothing once the effect is there."""

    def outputs(self, amplitude, outputs, time):
        """Not a number."""
        return outputs if amplitude == 0 else np.full_like(outputs, np.nan)


class Failing(InProcess):
    """Fails wherever a parameter is above a value: a side of every derivative by it, and steps that way."""

    def __init__(self, simulator, name, above):
        super().__init__(simulator)
        self.name, self.above, self.failures = name, above, 0

    def map(self, runs):
        """Outcomes, with errors among them."""
        made = super().map(runs)
        for k, run in enumerate(runs):
            if run.parameters[self.name] > self.above:
                made[k] = SimulationError("fails here")
                self.failures += 1
        return made


@pytest.mark.slow
def test_failing_simulations_do_not_end_a_diagnosis(house, drifted, monkeypatch):
    """A candidate that is good for nothing, and a parameter that fails, leave the answer what it is without them."""
    system, whole = house("me"), drifted.done
    names = [one.name for one in system.parameters]
    effects = [*candidates(system), Broken("broken", lower=-1.0, upper=1.0)]
    used = []
    ro = whole.search.base.lin.problem.values(whole.search.base.lin.z)[names.index("ro")]

    @contextmanager
    def failing(simulator, **_):
        used.append(Failing(simulator, "ro", 1.001 * ro))
        yield used[0]

    monkeypatch.setattr(diagnosed, "side_by_side", failing)
    report = diagnose(system, drifted.path, effects=effects).report
    assert used[0].failures > 0
    assert report.excluded["broken"] == "its simulation fails"
    assert not any(one.probability > 0.01 for one in report.effects if one.name == "broken")
    assert report.verdict == whole.report.verdict == "effect"
    assert [one.name for one in report.effects if one.named] == ["drift"]
    assert report.effects[0].amplitude == pytest.approx(whole.report.effects[0].amplitude, rel=0.1)
