"""Simulations that fail, and outputs that are not finite, cost what they touch and not the diagnosis."""

from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pytest

from diagnosis.effects import Nothing
from diagnosis.fitting.simulations import InProcess
from diagnosis.gap import diagnosed
from diagnosis.gap.diagnosed import diagnose
from shared.errors import SimulationError
from tests.diagnosis.conftest import WARM_UP
from tests.diagnosis.gap.gap_cases import candidates, drifting


@dataclass(frozen=True)
class Broken(Nothing):
    """A sensor that shows nothing once the effect is there."""

    def outputs(self, amplitude, outputs, time):
        """Not a number."""
        return outputs if amplitude == 0 else np.full_like(outputs, np.nan)


@dataclass(frozen=True)
class Large(Nothing):
    """A sensor that shows billions: beside this signature the one of the prior is lost, and its matrix is singular."""

    def outputs(self, amplitude, outputs, time):
        """As much everywhere."""
        return outputs + 1e9 * amplitude


@dataclass(frozen=True)
class Raising(Nothing):
    """A package's own effect with a mistake in it."""

    def inputs(self, amplitude, inputs, recording):
        """Fails once there is something to do."""
        return inputs if amplitude == 0 else {**inputs, "To": inputs["outside"]}


@dataclass(frozen=True)
class Brittle(Nothing):
    """A drift that can be simulated a little way only: it stands out, and no refit comes to its end."""

    def outputs(self, amplitude, outputs, time):
        """A drift of one kelvin in thirty days, up to a third of it."""
        if abs(amplitude) > 0.31:
            return np.full_like(outputs, np.inf)
        return outputs + amplitude * (time - time[0]) / (30 * 86400.0)


@pytest.mark.slow
def test_candidates_that_fail_are_named_with_the_reason_and_cost_the_others_nothing(house, house_recorded, tmp_path):
    """By a simulation that fails, by outputs that are no numbers, by a singular matrix, and in a refit only."""
    system = house("me")
    path = drifting(house_recorded(tmp_path, hours=96, seed=3), by=6.0)
    common = {"lower": -8.0, "upper": 8.0}
    failing = [
        Broken("broken", **common),
        Raising("raising", **common),
        Large("large", **common),
        Brittle("brittle", **common),
    ]
    out = tmp_path / "out"
    done = diagnose(system, path, effects=[*failing, *candidates(system)[:1]], warm_up=WARM_UP, out=out)
    report = done.report
    assert (report.verdict, report.unfinished) == ("effect", {})
    assert [one.name for one in report.effects if one.named] == ["drift"]
    assert report.effects[0].amplitude == pytest.approx(6.0, abs=1.5)
    assert {"broken", "raising", "brittle"} <= set(report.failed) <= {one.name for one in failing}
    assert "expected numbers" in report.failed["broken"]
    assert "fails with KeyError: 'outside'" in report.failed["raising"]
    for text in ((out / "report.json").read_text(), (out / "report.html").read_text()):
        assert all(name in text for name in report.failed)


def test_a_base_model_that_fails_everywhere_is_told_in_a_sentence(house, house_recorded, tmp_path, monkeypatch):
    system, path = house("me"), house_recorded(tmp_path, hours=48, seed=3)

    @contextmanager
    def failing(simulator, **_):
        yield Failing(simulator, "ro", 0.0)

    monkeypatch.setattr(diagnosed, "side_by_side", failing)
    expected = r"house-3\.nc: the base model cannot be fitted to it \(from prior: fails her"
    with pytest.raises(SimulationError, match=expected):
        diagnose(system, path, effects=[], out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


class Failing(InProcess):
    """Fails wherever a parameter is above a value: a side of every derivative by it, and steps that way."""

    def __init__(self, simulator, name, above):
        super().__init__(simulator)
        self.name, self.above = name, above

    def map(self, runs):
        """Outcomes, with errors among them."""
        made = list(super().map(runs))
        for k, run in enumerate(runs):
            if run.parameters[self.name] > self.above:
                made[k] = SimulationError("fails here")
        return made
