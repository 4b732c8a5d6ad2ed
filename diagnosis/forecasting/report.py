"""The page of a forecast: context, what the model said about the days ahead, and what was measured there."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from diagnosis.calibrating.sentences import sentences
from diagnosis.forecasting.forecasted import Forecasted
from diagnosis.forecasting.sentences import answer
from diagnosis.pages import page_environment
from diagnosis.physics import hints, warnings
from diagnosis.pictures import BLUE, ORANGE, axis_label, calendar, embedded, figure, readable
from diagnosis.recording import DAY
from diagnosis.whole import whole


def write_forecast(done: Forecasted, folder: Path) -> None:
    """Write ``forecast.json`` and ``forecast.html`` into a folder, both or none."""
    page = render(done)
    with whole(folder) as draft:
        text = done.report.model_dump_json(indent=1)
        (draft / "forecast.json").write_text(text + "\n", encoding="utf-8")
        (draft / "forecast.html").write_text(page, encoding="utf-8")


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
            picture=_picture(done),
            given=done.given,
        )
    )


def _days(time: np.ndarray) -> np.ndarray:
    """Days since the first step began, at the ends of the steps, of times of these [s]."""
    return np.asarray((time - time[0] + (time[1] - time[0])) / DAY)


def _picture(done: Forecasted) -> str:
    days = _days(done.time)
    made, panels = figure(len(done.system.outputs), height=2.2)
    for k, (panel, output) in enumerate(zip(panels, done.system.outputs, strict=True)):
        low, unit = readable(done.low[k], output.unit)
        high, _ = readable(done.high[k], output.unit)
        panel.axvspan(0.0, days[done.context - 1], color=BLUE, alpha=0.06, lw=0)
        panel.fill_between(days, low, high, color=ORANGE, alpha=0.25, lw=0, label=f"{done.report.level:.0%} band")
        panel.plot(days, readable(done.measured[k], output.unit)[0], lw=1.0, color=BLUE, label="measured")
        panel.plot(days, readable(done.centre[k], output.unit)[0], "--", lw=1.0, color=ORANGE, label="model")
        panel.set_ylabel(axis_label(output, unit), fontsize=8)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, fontsize=8)
    calendar(panels[-1], done.report.begin)
    panels[-1].set_xlabel(f"days since {done.report.begin}; shaded: the context")
    return embedded(made)
