"""Residuals and responses in units of unforeseeable noise: the common ground of all explanations of a residual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.where.colour import fill, fit_colour, whiten
from diagnosis.where.series import Residuals


@dataclass(frozen=True)
class Whitened:
    """``rows`` (B + 1, readings): every channel's innovations over their standard deviation, one after the other.

    Use :meth:`response` for anything that is to explain them.
    """

    rows: np.ndarray
    channels: list[int]
    colours: list[np.ndarray]
    scales: list[float]
    blank: np.ndarray
    nuisance: np.ndarray | None

    def response(self, responses: np.ndarray) -> np.ndarray:
        """Responses (outputs, steps, columns) as the same linear map makes them, shape (readings, columns)."""
        parts = []
        for k, colour, scale in zip(self.channels, self.colours, self.scales, strict=True):
            series = np.where(self.blank[k], np.nan, responses[k].T)
            parts.append((whiten(fill(series), colour) / scale)[:, _used(self.blank[k], colour)])
        found = np.concatenate(parts, axis=1)
        return _without(found, self.nuisance).T


def whitened(residuals: Residuals, nuisance: np.ndarray | None = None) -> Whitened:
    """Prewhiten recording and twins alike.

    Parameters
    ----------
    nuisance
        Responses of the outputs to whatever calibration may choose (parameters, initial state), shape
        (outputs, steps, columns): what they can imitate is taken out of residuals and responses, because a refit
        would have taken it out of the former only.
    """
    stack = residuals.stacked
    channels, colours, scales, parts = [], [], [], []
    blank = ~np.isfinite(residuals.observed)
    for k in residuals.measured:
        colour = fit_colour(stack[:, k])
        used = _used(blank[k], colour)
        part = whiten(fill(stack[:, k]), colour)[:, used]
        scale = float(part.std()) if used.any() else 0.0
        if scale > 0:
            channels.append(k)
            colours.append(colour)
            scales.append(scale)
            parts.append(part / scale)
    bare = Whitened(np.concatenate(parts, axis=1), channels, colours, scales, blank, None)
    if nuisance is None:
        return bare
    columns = bare.response(nuisance)
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, strength, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, strength > 1e-8 * strength[0]].T
    return Whitened(_without(bare.rows, basis), channels, colours, scales, blank, basis)


def _used(blank: np.ndarray, colour: np.ndarray) -> np.ndarray:
    return ~blank & (np.arange(len(blank)) >= len(colour))


def _without(rows: np.ndarray, basis: np.ndarray | None) -> np.ndarray:
    return rows if basis is None else rows - (rows @ basis.T) @ basis
