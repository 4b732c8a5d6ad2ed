"""The page of a forecast: context, what the model said about the days ahead, and what was measured there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from diagnosis.calibrating.report import sentences
from diagnosis.curves import BLUE, ORANGE, readable
from diagnosis.forecasting.forecasted import Forecast, Forecasted, about_failed
from diagnosis.pages import long_named, page_environment, percent, write_answer
from diagnosis.panels import Curve, Panel, Strips, embedded, library
from diagnosis.physics import hints, warnings
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


def write_forecast(done: Forecasted, folder: Path) -> None:
    """Write ``forecast.json`` and ``forecast.html`` into a folder, both or none."""
    write_answer(folder, "forecast", done.report, render(done))


def render(done: Forecasted) -> str:
    """The page as HTML, pictures and all."""
    names = {one.name: one.long_name for one in done.system.outputs}
    return (
        page_environment()
        .get_template("forecast.html.j2")
        .render(
            report=done.report,
            warnings=warnings(done.report.physics),
            summary=answer(done.report, names) + sentences(done.report.calibration) + hints(done.report.physics),
            outputs=names,
            picture=embedded(_picture(done), height=160),
            bokeh=library(),
            given=done.given,
        )
    )


def _picture(done: Forecasted) -> list[Panel]:
    time = done.curves()["time"].values
    step = time[1] - time[0]
    context = Strips("the context", "#f0f4f9", time[:1] - step, time[done.context - 1 : done.context])
    made = []
    for k, output in enumerate(done.system.outputs):
        low, unit = readable(done.low[k], output.unit)
        high, measured, centre = (readable(one[k], output.unit)[0] for one in (done.high, done.measured, done.centre))
        curves = [
            Curve(f"{done.report.level:.0%} band", ORANGE, np.stack([low, high])),
            Curve("measured", BLUE, measured),
            Curve("model", ORANGE, centre, "dashed"),
        ]
        made.append(Panel(long_named(output.name, output.long_name), unit, time, curves, [context]))
    return made
