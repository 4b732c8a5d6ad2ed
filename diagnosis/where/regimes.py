"""Regimes: in which states of the building a residual is looked at, from the description and the series alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shared.system import System
from shared.units import spelled
from shared.variables import ZERO_CELSIUS, Output

ANY = "any"
_SUN_SHARE = 0.2
"""Sun is out above this share of the record's 99th percentile of irradiance."""
_AT_BOUND = 0.01
"""Share of the steps that must lie on a series' extreme for it to be a bound."""
_RARE = 0.02
"""Regimes that hold for less than this share of the record, or are absent for less, say nothing."""


@dataclass(frozen=True)
class Regime:
    """A state: what a reader calls it, the rule it follows, and when it holds.

    ``mask`` has shape (steps,), or (B + 1, steps) when every twin has its own.
    """

    label: str
    rule: str
    mask: np.ndarray


def everywhere(steps: int) -> Regime:
    """The regime that always holds."""
    return Regime(ANY, "always", np.ones(steps, bool))


def find_regimes(system: System, inputs: Mapping[str, np.ndarray], simulated: np.ndarray) -> list[Regime]:
    """Derive regimes from the kinds of inputs and from where outputs dwell.

    Outputs must be those that the calibrated model *simulates*, not the measured ones: "measured CO2 is high" picks
    the steps where its error is high, which twins that are not picked by their own errors could not imitate.

    Parameters
    ----------
    inputs
        Recorded inputs by name, each (steps,); those that were not recorded are left out.
    simulated
        Outputs of the calibrated model, shape (outputs, steps); or (B + 1, outputs, steps) with each twin's own,
        the recording's first.
    """
    found: list[Regime] = []
    for one in system.inputs:
        if one.name in inputs and np.isfinite(inputs[one.name]).all():
            found += _of_input(one.source, getattr(one, "column", ""), one.name, one.unit, inputs[one.name])
    for k, output in enumerate(system.outputs):
        series = simulated[..., k, :]
        if np.isfinite(series).all():
            found += _of_output(output, series)
    return [r for r in found if _RARE <= np.atleast_2d(r.mask)[0].mean() <= 1 - _RARE]


def _of_input(source: str, column: str, name: str, unit: str, series: np.ndarray) -> list[Regime]:
    if source == "constant" or source == "excitation" or np.ptp(series) == 0:
        return []
    if source == "occupancy":
        return [
            Regime("occupied", f"{name} > 0", series > 0),
            Regime("empty", f"{name} = 0", series <= 0),
        ]
    if source == "weather" and spelled(unit) == "W/m2":
        threshold = float(_SUN_SHARE * np.percentile(series, 99))
        return [Regime(f"sun on {name}", _above(name, threshold, unit), series > threshold)]
    if source == "weather" and column == "wind_speed":
        threshold = float(np.quantile(series, 0.75))
        return [Regime(f"wind above {threshold:.2g} {unit}", _above(name, threshold, unit), series > threshold)]
    if source == "weather" and column == "temp_air":
        low, high = (float(np.quantile(series, q)) for q in (0.25, 0.75))
        return [
            Regime(f"below {_warmth(low, unit)} outside", f"{name} < {low:.4g} {unit}", series < low),
            Regime(f"above {_warmth(high, unit)} outside", _above(name, high, unit), series > high),
        ]
    if source == "weather":
        # sky temperature and its like move with what has a name already
        return []
    if source == "schedule":
        threshold = float((series.min() + series.max()) / 2)
        return [Regime(f"{name} in its upper half", _above(name, threshold, unit), series > threshold)]
    threshold = float(np.median(series[series != 0])) if (series != 0).any() else 0.0
    return [Regime(f"{name} high", _above(name, threshold, unit), series > threshold)]


def _of_output(output: Output, series: np.ndarray) -> list[Regime]:
    """An actuator dwells on its bounds: at rest, working, saturated. A state does not: its upper quarter."""
    label, unit, close = output.long_name or output.name, output.unit, 3 * output.accuracy
    low, high = series.min(axis=-1, keepdims=True), series.max(axis=-1, keepdims=True)
    at_low, at_high = series <= low + close, series >= high - close
    wide = bool(np.ravel(high - low)[0] > 10 * close)
    found = []
    if wide and np.atleast_2d(at_low)[0].mean() >= 5 * _AT_BOUND:
        found.append(Regime(f"{label} above its minimum", _above(output.name, _first(low + close), unit), ~at_low))
    else:
        threshold = np.quantile(series, 0.75, axis=-1, keepdims=True)
        found.append(Regime(f"{label} high", _above(output.name, _first(threshold), unit), series > threshold))
    if wide and np.atleast_2d(at_high)[0].mean() >= _AT_BOUND:
        found.append(Regime(f"{label} at its maximum", _above(output.name, _first(high - close), unit), at_high))
    return found


def _warmth(value: float, unit: str) -> str:
    """A temperature as people say it: its coldest quarter may be warm."""
    return f"{value - ZERO_CELSIUS:.1f} degC" if spelled(unit) == "K" else f"{value:.1f} {unit}"


def _first(values: np.ndarray) -> float:
    return float(np.ravel(values)[0])


def _above(name: str, threshold: float, unit: str) -> str:
    return f"{name} > {threshold:.4g} {unit}"
