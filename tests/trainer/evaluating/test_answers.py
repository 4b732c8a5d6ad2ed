"""Each answer of an evaluation against the run's own estimate."""

import numpy as np

from shared.metrics import r2
from shared.store import DatasetFolder
from trainer.evaluating.evaluation import evaluate
from trainer.evaluating.report import read_answers
from trainer.training.fitting import fit


def test_windows_of_a_length_and_without_a_channel_are_estimated_as_the_run_would(tanks, tmp_path):
    """Each answer against the run's own estimate from the records, cut and emptied by hand."""
    run = fit(
        *(tanks, tmp_path / "run"),
        **{"model": "multiscale-transformer", "channels": ["level", "glow"], "optional": ["glow"], "steps": 2},
        **{"context_hours": 24.0, "other_contexts": [48.0]},
        options={"width": 16, "layers": 1, "feedforward": 16},
    )
    found = evaluate(run, tanks, windows=30, noise="none", context_hours=48.0, without=["glow"], out=tmp_path / "e")
    assert (found.context_hours, found.channels) == (48.0, ["level"])
    answers = read_answers(tmp_path / "e")["unseen"]
    records = DatasetFolder(tanks).load(["level", "glow"])
    rows = [records.systems.tolist().index(int(system)) for system in answers.systems]
    starts = np.searchsorted(records.time, answers.begin)
    values = np.stack([records.values[row, :, start : start + 96].T for row, start in zip(rows, starts, strict=True)])
    assert values.shape == (30, 96, 2)
    whole = run.estimate(values, answers.begin)
    values[..., 1] = np.nan
    expected = run.estimate(values, answers.begin)
    np.testing.assert_allclose(answers.estimate, expected, rtol=1e-5)
    assert np.abs(answers.estimate - whole).max() > 1e-3 * np.abs(whole).max()  # with it they are others
    scores = [*found.protocols["unseen"].r2.values()]
    np.testing.assert_allclose(scores, r2(records.parameters[rows], expected), rtol=1e-4)
