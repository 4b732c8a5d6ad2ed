"""A forecast in a few sentences: how far off it was, and what its bands hold."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.forecasting.forecasted import Forecast, about_failed
from diagnosis.pages import long_named, percent
from shared.numbers import number
from shared.variables import spaced


def answer(report: Forecast, names: Mapping[str, str]) -> list[str]:
    """What came out ahead of the context.

    Parameters
    ----------
    names
        What outputs are, by name: :attr:`shared.variables.Output.long_name`.
    """
    scored = {name: one for name, one in report.outputs.items() if one is not None}
    hours, band = f"{report.ahead_hours:g} h", f"{report.level:.0%} band"
    failed = [f"{about_failed(report.draws, report.failed)}."] if report.failed else []
    if report.stopped:
        failed.append(f"The time was up: the bands are those of {report.draws} simulations, fewer than usual.")
    if not scored:
        return [
            f"No output was measured in the {hours} ahead, except those that drive the model: the error of the forecast"
            " is unknown.",
            *failed,
        ]
    off = ", ".join(
        f"{long_named(name, names)} by {number(one.rmse, 3)}{spaced(one.unit)}" for name, one in scored.items()
    )
    held = ", ".join(f"{percent(one.covered, 0)} of {name}" for name, one in scored.items())
    return [
        f"Over the {hours} ahead the forecast was off in {off} (root mean square).",
        f"Its {band} covered {held}. It allows for uncertain parameters, for inputs that were not measured and for"
        " sensor noise, but not for what the model lacks.",
        *failed,
    ]
