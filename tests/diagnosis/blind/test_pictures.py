"""The pictures of a blind check say what they hold."""

import pytest

from diagnosis.blind import score_pictures
from diagnosis.blind.rates import Matrix
from diagnosis.blind.score_pictures import confusion

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
