"""The pictures of a blind check say what they hold."""

import numpy as np
import pytest

from diagnosis.blind import score_pictures
from diagnosis.blind.intervals import figure
from diagnosis.blind.rates import Matrix
from diagnosis.blind.score_pictures import confusion, parameters
from diagnosis.blind.shrinking import Error

SOME = Matrix(rows=["leak", "no_gap"], columns=["leak", "no_gap"], counts=[[3, 1], [0, 4]])


@pytest.mark.parametrize(
    ("of", "said"),
    [(8, "8 recordings. Colour: share"), (11, "8 of 11 recordings, all but those of two causes. Colour: share")],
)
def test_a_matrix_says_how_many_recordings_it_holds_and_which_not(monkeypatch, of, said):
    monkeypatch.setattr(score_pictures, "embedded", lambda made: made)
    made = confusion(SOME, "true", "named", of=of, missing="those of two causes")
    assert " ".join(made.get_suptitle().split()).startswith(said)
    made.draw_without_rendering()
    assert made.texts[0].get_window_extent().width <= made.bbox.width


def test_a_figure_of_one_recording_is_a_point_without_a_bar(monkeypatch):
    monkeypatch.setattr(score_pictures, "embedded", lambda made: made)
    one, two = figure(np.array([0.3])), figure(np.array([0.1, 0.2]))
    (panel,) = parameters([Error(parameter="r", before=one, after=two, change=one)]).axes
    assert sorted(len(line.get_xdata()) for line in panel.lines) == [1, 1, 2]
