"""Simulations of a command: answered from memory or from files, never for another run, and none after its time."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from diagnosis.fitting.simulations import FOLDER, Kept, Run, Simulations, key_of
from shared.errors import SimulationError, TimeUp


class Counting:
    """Answers with what it is given, and how often it was asked."""

    def __init__(self):
        self.asked = 0

    def map(self, runs):
        self.asked += len(runs)
        return [SimulationError("no") if run.parameters["a"] < 0 else np.full((1, 2), self.asked * 1.0) for run in runs]


def a_run(value=1.0):
    table = merge({"x": Piecewise(np.array([0.0, 5.0]), np.array([1.0, 2.0]))}, 0.0, 10.0)
    return Run({"a": value, "b": 2.0}, table, start=0.0, stop=10.0, record_from=0.0)


@pytest.mark.parametrize(
    "other",
    [
        {"parameters": {"a": 1.0, "b": 2.5}},
        {"inputs": replace(a_run().inputs, left=a_run().inputs.left + 1e-9)},
        {"inputs": replace(a_run().inputs, right=a_run().inputs.right + 1e-9)},
        {"stop": 9.0},
        {"record_from": 1.0},
        {"replay": True},
        {"tolerance": 1e-7},
    ],
)
def test_another_run_is_simulated(other):
    memory = Simulations(Counting())
    memory.map([a_run()])
    memory.map([replace(a_run(), **other)])
    assert memory.asked == 2


def saved(folder, about="room", **options):
    """Simulations beside an answer, and what makes them."""
    made = Counting()
    return Simulations(made, kept=Kept(folder / FOLDER, {"recording": about}), **options), made


def test_what_was_saved_is_found_again_failures_as_well(tmp_path):
    first, _ = saved(tmp_path)
    runs = [a_run(1.0), a_run(-1.0), a_run(2.0)]
    before = first.map(runs)
    first.end()
    again, runner = saved(tmp_path)
    after = again.map(runs)
    assert (again.asked, again.made, runner.asked) == (3, 0, 0)  # a report counts them as if they had been made
    assert str(after[1]) == str(before[1]) == "no"
    np.testing.assert_array_equal(after[2], before[2])
    again.map([a_run(3.0)])
    assert again.made == 1


def test_what_is_of_something_else_is_removed_and_what_is_broken_is_left_aside(tmp_path, caplog):
    first, _ = saved(tmp_path)
    first.map([a_run()])
    first.end()
    (file,) = (tmp_path / FOLDER).glob("*.npz")
    file.write_bytes(file.read_bytes()[:-40])  # cut off by a full disk
    broken, runner = saved(tmp_path)
    broken.map([a_run()])
    assert runner.asked == 1
    broken.end()
    with caplog.at_level("INFO", logger="zeroshot"):
        other, runner = saved(tmp_path, about="another room")
    assert "is of another recording, system or version; it is removed" in caplog.text
    assert not (tmp_path / FOLDER).exists()
    other.map([a_run()])
    assert runner.asked == 1


def test_nothing_that_was_saved_is_executed(tmp_path):
    """An array of objects is a pickle, which runs whatever it likes: it is not opened."""
    first, _ = saved(tmp_path)
    first.map([a_run()])
    first.end()
    (file,) = (tmp_path / FOLDER).glob("*.npz")
    np.savez(file, **{key_of(a_run()): np.array([{}], dtype=object)})
    again, runner = saved(tmp_path)
    again.map([a_run()])
    assert runner.asked == 1


def test_when_the_time_is_up_nothing_more_is_simulated_but_what_completes_an_answer(tmp_path):
    late, runner = saved(tmp_path, minutes=1e-9)
    with pytest.raises(TimeUp, match="goes on from where"):
        late.map([a_run()])
    assert late.time_up and runner.asked == 0
    with late.lifted():
        late.map([a_run()])
    late.map([a_run()])  # what is known needs no time
    assert runner.asked == 1


def test_it_tells_every_half_minute_what_is_done_and_what_is_left(monkeypatch):
    now, said = [0.0], []
    monkeypatch.setattr("diagnosis.fitting.simulations.time.monotonic", lambda: now[0])
    made = Simulations(Counting(), tell=said.append)
    made.tell("fitting", 0.0, 0.5)
    for k in range(1, 121):
        now[0] += 1.0
        made.reached(k / 120)
        made.map([a_run(float(k))])
    assert said[0] == "fitting" and len(said) == 4
    assert said[-1] == "fitting (92 simulations, 93 s so far, roughly 2 min left)"
