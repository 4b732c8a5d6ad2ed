"""Which input the residual follows, and how much later: lagged cross-correlation after prewhitening.

Box, Jenkins and Reinsel (Time Series Analysis, section 11.2.1) filter both series alike before correlating, because
two smooth series correlate by chance. The filter here is that of the residual, so that what remains of it under the
null is white and the correlation is the matched filter for an effect at an unknown lag. The bands are the twins'.
"Residuals cross-correlated with an explanatory variable: include it" (Bacher and Madsen 2011).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.where.finding import Finding
from diagnosis.where.series import ALPHA, HOUR, MaxTest, Residuals, fill, fit_colour, max_test, whiten

LONGEST = 24 * HOUR
"""Longest lag either way [s]."""
CLOSE = 6 * HOUR
"""Lags up to this one are looked at by every step, longer ones by the hour [s]."""
FINEST = HOUR / 6
"""Shorter steps are joined to this long ones [s]: lags by the minute would be more than can be looked at."""


@dataclass(frozen=True)
class CorrelationTest:
    """Result of :func:`scan_correlations`.

    ``correlation`` (channels, inputs, lags) is the recording's; ``low`` and ``high`` enclose 95 % of the twins' at each
    lag alone; ``simultaneous_low`` and ``simultaneous_high`` all of them together in 95 % of the twins. ``lags`` [s]:
    positive where the residual comes after the input. ``channels`` are indices of outputs.
    """

    test: MaxTest
    channels: list[int]
    inputs: list[str]
    lags: np.ndarray
    correlation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    simultaneous_low: np.ndarray
    simultaneous_high: np.ndarray
    findings: list[Finding]

    @property
    def adjusted(self) -> np.ndarray:
        """Family-wise p, shape (channels, inputs, lags)."""
        return self.test.adjusted.reshape(self.correlation.shape)


def scan_correlations(residuals: Residuals, inputs: Mapping[str, np.ndarray]) -> CorrelationTest | None:
    """Correlate every channel with every input that varies, at lags up to a day; one p-value for all.

    Inputs follow one another, so what the strongest input explains at lags about its own is taken off the recording's
    residual before the next is looked for (still against the twins' largest correlation of the first round).

    Parameters
    ----------
    inputs
        By name, each (steps,); those that are constant or have gaps are left out.

    Returns
    -------
    CorrelationTest or None
        None if no input varies.
    """
    names = [name for name, series in inputs.items() if np.isfinite(series).all() and np.ptp(series) > 0]
    if not names:
        return None
    channels = residuals.measured
    together = max(1, round(FINEST / residuals.step))
    step, lags = together * residuals.step, _lags(together * residuals.step, len(residuals.time) // together)
    stack = _joined(residuals.stacked, together)
    coarse = {name: _joined(inputs[name], together) for name in names}
    found = np.empty((len(stack), len(channels), len(names), len(lags)))
    series = []
    for c, k in enumerate(channels):
        colour = fit_colour(stack[:, k])
        white = np.where(np.isfinite(stack[:, k]), whiten(fill(stack[:, k]), colour), np.nan)
        driven = np.stack([whiten(coarse[name] - coarse[name].mean(), colour) for name in names])
        found[:, c] = _correlate(white, driven, lags)
        series.append((white[0], driven))
    test = max_test(_fisher(found).reshape(len(stack), -1))
    shape = found.shape[1:]
    low, high = np.quantile(found[1:], [0.025, 0.975], axis=0)
    half = test.level * test.spread
    around = [np.tanh(test.typical + sign * half).reshape(shape) for sign in (-1, 1)]
    return CorrelationTest(
        test=test,
        channels=channels,
        inputs=names,
        lags=lags * step,
        correlation=found[0],
        low=low,
        high=high,
        simultaneous_low=around[0],
        simultaneous_high=around[1],
        findings=_peel(residuals, channels, names, lags, step, series, test),
    )


def _lags(step: float, steps: int) -> np.ndarray:
    """Lags in steps: every one up to CLOSE, by the hour up to a day; a quarter of the record at most.

    Innovations of ten minutes know an effect half an hour later at no full hour.
    """
    apart, close = max(1, round(HOUR / step)), int(CLOSE / step + 1e-6)
    each = np.arange(int(LONGEST / step + 1e-6) + 1)
    each = each[((each <= close) | (each % apart == 0)) & (each <= steps // 4)]
    return np.concatenate([-each[:0:-1], each])


def _joined(series: np.ndarray, together: int) -> np.ndarray:
    """Means of so many steps (..., steps), the first ones left out that are not as many; NaN where most are missing."""
    if together == 1:
        return series
    first = series.shape[-1] % together
    parts = series[..., first:].reshape(*series.shape[:-1], -1, together)
    seen = np.isfinite(parts)
    count = seen.sum(axis=-1)
    mean = np.where(seen, parts, 0.0).sum(axis=-1) / np.maximum(count, 1)
    return np.where(2 * count >= together, mean, np.nan)


def _correlate(white: np.ndarray, driven: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """Correlation of rows (rows, steps) with lagged inputs (inputs, steps), over steps where both are known."""
    seen = np.isfinite(white)
    mean = np.where(seen, white, 0.0).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    residual = np.where(seen, white - mean, 0.0)
    steps = white.shape[1]
    shifted = np.full((*driven.shape[:1], len(lags), steps), np.nan)
    for j, lag in enumerate(lags):
        if lag >= 0:
            shifted[:, j, lag:] = driven[:, : steps - lag]
        else:
            shifted[:, j, :lag] = driven[:, -lag:]
    known = np.isfinite(shifted)
    signal = np.where(known, shifted, 0.0).reshape(-1, steps).T
    both = known.reshape(-1, steps).T.astype(float)
    energy = (residual**2 @ both) * (seen.astype(float) @ signal**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.where(energy > 0, (residual @ signal) / np.sqrt(energy), np.nan)
    return found.reshape(len(white), len(driven), len(lags))


def _peel(
    residuals: Residuals,
    channels: list[int],
    names: list[str],
    lags: np.ndarray,
    step: float,
    series: list[tuple[np.ndarray, np.ndarray]],
    test: MaxTest,
) -> list[Finding]:
    """The strongest input of each channel, then the strongest in what is left, while significant."""
    shape = (len(channels), len(names), len(lags))
    left = [white.copy() for white, _ in series]
    current = np.stack([_correlate(w[None], d, lags)[0] for w, (_, d) in zip(left, series, strict=True)])
    t, adjusted = (values.reshape(shape) for values in test.restudentise(_fisher(current).ravel()))
    open_ = np.ones(shape[:2], bool)
    found: list[Finding] = []
    while open_.any():
        size = np.where(open_[..., None] & (adjusted <= ALPHA), np.abs(t), -np.inf)
        if not np.isfinite(size).any():
            break
        c, i, j = (int(v) for v in np.unravel_index(int(np.argmax(size)), shape))
        hours = float(lags[j]) * step / HOUR
        found.append(_finding(residuals, channels[c], names[i], hours, current[c, i, j], adjusted[c, i, j], t[c, i, j]))
        open_[c, i] = False
        left[c] = _without(left[c], series[c][1][i], lags, int(lags[j]))
        current[c] = _correlate(left[c][None], series[c][1], lags)[0]
        t, adjusted = (values.reshape(shape) for values in test.restudentise(_fisher(current).ravel()))
    return found


def _without(white: np.ndarray, driven: np.ndarray, lags: np.ndarray, best: int) -> np.ndarray:
    """The residual without its regression on one input at the lags within a quarter of a day of the best."""
    near = lags[np.abs(lags - best) <= (lags[-1] - lags[0]) / 8]
    columns = [np.roll(driven, lag) for lag in near]
    for column, lag in zip(columns, near, strict=True):
        column[: max(lag, 0)] = column[len(column) + min(lag, 0) :] = np.nan
    design = np.stack(columns, axis=1)
    known = np.isfinite(white) & np.isfinite(design).all(axis=1)
    amplitudes, *_ = np.linalg.lstsq(design[known], white[known] - white[known].mean(), rcond=1e-8)
    left = white.copy()
    left[known] -= design[known] @ amplitudes
    return left


def _fisher(correlation: np.ndarray) -> np.ndarray:
    """Fisher's z, which is closer to normal than r."""
    return np.arctanh(np.clip(correlation, -0.999999, 0.999999))


def _finding(
    residuals: Residuals, k: int, name: str, hours: float, correlation: float, p_value: float, t: float
) -> Finding:
    size = f"{abs(hours):g} h" if abs(hours) >= 1 else f"{60 * abs(hours):g} min"
    when = "when" if not hours else f"{size} {'after' if hours > 0 else 'before'}"
    return Finding(
        kind="correlation",
        channel=residuals.names[k],
        label=residuals.labels[k],
        cell={"input": name, "lag": when, "lag_hours": f"{hours:g}"},
        p_value=float(p_value),
        direction="measured higher" if correlation > 0 else "measured lower",
        size=float(correlation),
        unit="1",
        t=float(t),
    )
