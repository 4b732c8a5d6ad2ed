"""Answers and verdicts side by side: what of a gap can be seen is told by the sealed answers alone."""

import numpy as np

from diagnosis.blind.opened import steps_of
from diagnosis.blind.scoring import score
from tests.diagnosis.blind.blind_cases import QUIET, Case, counts, said, write_results, write_set


def test_cells_are_read_as_they_are_written():
    series = {"x": np.arange(48.0)}
    cell = {"hours": "06:00-12:00", "day_type": "weekend", "regime": "x high", "rule": "x > 33.5 W/m2"}
    start = 5 * 86400.0 - 86400.0  # Friday, then Saturday
    assert np.flatnonzero(steps_of(cell, start, 3600.0, 48, series)).tolist() == [34, 35]
    assert steps_of({"rule": "y > 3"}, 0.0, 3600.0, 48, series) is None
    assert steps_of({"rule": "x = 0"}, 0.0, 3600.0, 48, series).sum() == 1
    assert steps_of({"hours": "any", "day_type": "any", "rule": "always"}, 0.0, 3600.0, 48, series).all()


def test_what_is_visible_depends_on_the_answers_alone(tmp_path):
    """A gap of twice the noise is no gap where recordings without effect have as much; actuators apart."""
    ones = [
        Case("none", truth="no_gap", room=2.5, replay=True, verdict=QUIET),
        Case("none", truth="no_gap", room=0.5, verdict=QUIET),
        Case("library", ("a",), room=2.0, replay=True, verdict=said("a")),
        Case("library", ("a",), room=2.0, verdict=QUIET),
        Case("library", ("a",), room=3.0, replay=True, verdict=said("a")),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    done = score(folder, answers, write_results(tmp_path / "results", folder, ones))
    seen = {one.what: one for one in done.effects}["as the candidate has it, visible"]
    assert counts(seen.top) == (1, 2)
    other = [Case(one.stratum, one.effects, one.truth, one.sizes, one.room, replay=one.replay) for one in ones]
    done = score(folder, answers, write_results(tmp_path / "other", folder, other))
    seen = {one.what: one for one in done.effects}["as the candidate has it, visible"]
    assert counts(seen.top) == (0, 2)


def test_what_can_be_seen_is_that_of_the_whole_set_however_few_recordings_are_scored(tmp_path):
    """Twenty-five walls, the largest first: of the first five the largest is the limit, of all the second largest."""
    walls = [Case("none", truth="no_gap", room=3.0, length=3.0, verdict=QUIET)]
    walls += [Case("none", truth="no_gap", room=0.5, length=0.5, verdict=QUIET) for _ in range(24)]
    between = [Case("library", ("a",), room=2.0, length=6.0, verdict=said("a")) for _ in range(2)]
    ones = [*walls[:4], *between, *walls[4:]]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    for k in (4, 5):  # the two effects
        for first in (k + 1, None):
            done = score(folder, answers, results, first=first)
            seen = {one.what: one for one in done.effects}["as the candidate has it, visible"]
            assert counts(seen.top) == counts(done.detectable[0].top) == ((1, 1) if first == 5 else (2, 2))


def test_a_recording_of_two_causes_is_none_of_one_where_either_was_withheld(tmp_path):
    """Its gap is of both: it says nothing of the size from which the one that is left would be seen."""
    ones = [
        Case("two", ("a", "b"), sizes=(4.0, 0.3), room=5.0, verdict=said("b")),
        Case("library", ("b",), sizes=(1.0,), room=5.0, verdict=said("b")),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    done = score(folder, answers, write_results(tmp_path / "results", folder, ones, library=("b", "c"), without=("a",)))
    assert sum(point.top.n for point in done.power_by_size) == 1
    assert sum(map(sum, done.confusion.counts)) == 1
