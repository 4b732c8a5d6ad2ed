"""Where an estimator is good: its answers by season, and by the size of the true parameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shared.schema import EPOCH
from trainer.evaluating.report import Answers
from trainer.intervals import r2_interval, r2_with_mean
from trainer.reading.encoding import Encoding
from trainer.tables import Row, markdown_table

SEASONS = ("December to February", "March to May", "June to August", "September to November")
LEVEL = 0.9
"""Of the intervals."""
THIRDS = 3
"""Bands of a parameter, each with as many windows as the others."""


def strata(answers: Answers, encoding: Encoding) -> str:
    """Both tables as Markdown, with their headings."""
    seasons = markdown_table(*by_season(answers, encoding.parameters))
    bands = markdown_table(*by_band(answers, encoding.parameters, encoding.parameter_units))
    return (
        f"\n## R2 of unseen systems by season\n\n{seasons}\n"
        f"\n## Errors of unseen systems by the true value\n\n{bands}\n\n"
        "- bias: mean of estimate less truth; error: root mean square of it\n"
    )


def season_of(begin: np.ndarray) -> np.ndarray:
    """Place of each first time stamp [s since time zero] in :data:`SEASONS`, same shape.

    >>> season_of(np.array([0.0, 86400.0 * 90])).tolist()
    [0, 1]
    """
    dates = np.datetime64(EPOCH) + np.round(begin).astype("timedelta64[s]")
    month = dates.astype("datetime64[M]").astype(int) % 12  # 0 is January
    return np.asarray((month + 1) // 3 % 4)


def by_season(answers: Answers, parameters: Sequence[str]) -> tuple[Row, list[Row]]:
    """Header and rows: R2 of each parameter in the windows that begin in a season, with its 90 % interval by system.

    A season without two windows has no row; the last column is the mean over parameters.
    """
    header = ("begin", "windows", *parameters, "mean")
    rows: list[Row] = []
    season, system = season_of(answers.begin), answers.places()
    for k, name in enumerate(SEASONS):
        chosen = np.flatnonzero(season == k)
        if len(chosen) < 2:
            continue

        def scores(some: np.ndarray, chosen: np.ndarray = chosen) -> np.ndarray:
            return r2_with_mean(answers.truth[chosen[some]], answers.estimate[chosen[some]])

        low, high = r2_interval(system[chosen], scores, level=LEVEL)
        cells = zip(scores(np.arange(len(chosen))), low, high, strict=True)
        rows.append((name, f"{len(chosen)}", *(f"{_two(v)} [{_two(a)}, {_two(b)}]" for v, a, b in cells)))
    return header, rows


def by_band(answers: Answers, parameters: Sequence[str], units: Sequence[str]) -> tuple[Row, list[Row]]:
    """Header and rows: a third of the windows each, by the true value of a parameter.

    ``bias`` is the mean of estimate less truth, ``error`` the root mean square of it. An estimate that is the mean of
    what may be lies towards the middle of the range where the recording says little: too high in the first band, too
    low in the last.
    """
    header = ("parameter", "true values", "windows", "bias", "error")
    rows: list[Row] = []
    for k, name in enumerate(parameters):
        truth, estimate = answers.truth[:, k], answers.estimate[:, k]
        for chosen in np.array_split(np.argsort(truth, kind="stable"), THIRDS):
            if len(chosen) < 2:
                continue
            error = estimate[chosen] - truth[chosen]
            span = f"{truth[chosen[0]]:.3g} to {truth[chosen[-1]]:.3g} {units[k]}"
            rms = np.sqrt(np.mean(error**2))
            rows.append((name, span, f"{len(chosen)}", f"{error.mean():+.2g}", f"{rms:.2g}"))
    return header, rows


def _two(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "-"
