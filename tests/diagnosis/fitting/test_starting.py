from types import SimpleNamespace

import numpy as np
import pytest

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.fitting.grams import Grams, estimated_colours
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import FAR, base_from, line_at, refit
from diagnosis.fitting.starting import begun, usual_starts, zero_shot
from diagnosis.recording import read_recording
from shared.errors import RecordingError, SimulationError, TimeUp
from shared.system import load_system
from tests.diagnosis.gap.room_cases import noisy

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """Three counted days of a room whose parameters lie far from the middle of their prior; its constants are known."""
    system = load_system("fmus/MixedAirCO2").with_experiment(hours=72.0, start=(500.0, 500.0))
    path = tmp_path_factory.mktemp("starting") / "room.nc"
    simulate(system, seed=4000, index=5, out=path)
    record = noisy(read_recording(path, system), system, 5)
    simulator = Simulator(system.with_experiment(step=record.step))
    return Problem(simulator, record, occupancy="measured", known=["constants"])


def asked(problem, run=None):
    return zero_shot(problem.system, problem.recording, run)


def test_the_estimator_beside_the_description_is_asked_first(problem, monkeypatch):
    one = begun(problem, usual_starts(problem, asked(problem)))
    assert one.name.endswith("estimator")
    assert np.abs(one.line.z[:8]).max() > 0.1
    assert one.quiet  # it explains the recording
    monkeypatch.setattr("diagnosis.fitting.starting.estimator_beside", lambda _: None)
    plain = begun(problem, usual_starts(problem, asked(problem)))
    assert plain.name == "prior"
    # candidates begin where the base model has come near, not where it began: in the middle of the prior
    grams = Grams(plain.line, problem.observed)
    led = refit(grams, estimated_colours(grams, problem.floor).best, plain.line.z, (), redrawn=False)
    assert np.sqrt(np.mean(((led.lin.z - plain.line.z) / led.sd) ** 2)) < FAR and plain.line.z.any()


@pytest.mark.parametrize("better", [0, 1])
def test_of_two_fits_that_leave_something_the_more_plausible_one_is_kept(problem, monkeypatch, better):
    made = []

    def fitted(line, _):
        made.append(line)
        return SimpleNamespace(evidence=float(len(made) - 1 == better)), line

    monkeypatch.setattr("diagnosis.fitting.starting.line_at", lambda _, start, wide: start)
    monkeypatch.setattr("diagnosis.fitting.starting.base_from", fitted)
    monkeypatch.setattr("diagnosis.fitting.starting.Begun.evidence", property(lambda one: one.fit.evidence))
    monkeypatch.setattr("diagnosis.fitting.starting.Begun.quiet", False)
    one = begun(problem, usual_starts(problem, asked(problem)))
    assert len(made) == 2 and one.line is made[better]
    assert (one.name == "prior") == (better == 1)


@pytest.mark.parametrize("error", [TimeUp("no time"), SimulationError("it is stiff")])
def test_a_fit_that_cannot_be_settled_is_where_the_line_led(problem, monkeypatch, error):
    def refuse(*_):
        raise error

    line = line_at(problem, np.zeros(problem.size))
    monkeypatch.setattr("diagnosis.fitting.refit.settled", refuse)
    found, _ = base_from(line, problem.observed)
    assert np.abs(found.lin.z - line.z).max() > 0.1 and not found.exact


def test_an_estimator_that_cannot_read_the_recording_is_told_or_refused(problem, monkeypatch, caplog):
    def refuse(*_):
        raise RecordingError("room.nc: has no channel 'TSet'")

    monkeypatch.setattr("diagnosis.fitting.starting.estimate", refuse)
    with caplog.at_level("INFO"):
        assert asked(problem) is None
    assert caplog.messages == ["without a zero-shot estimate: room.nc: has no channel 'TSet'"]
    with pytest.raises(RecordingError, match="no channel"):
        asked(problem, "somewhere")
