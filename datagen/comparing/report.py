"""A comparison as a table (Markdown, CSV) and a picture."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from datagen.comparing.comparison import Comparison, Row
from shared.errors import ZeroshotError
from shared.numbers import counted, number
from shared.places import check_folder
from shared.store import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TABLE, NUMBERS, PICTURE = "comparison.md", "comparison.csv", "comparison.png"
WEEK = 7 * 86400.0
DAY = 86400.0
_LEGEND: dict[str, Any] = {
    "fontsize": "small",
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 0.98),
    "ncols": 2,
    "frameon": False,
}
_FIRST, _SECOND, _BIAS = "#4477aa", "#cc3311", "#888888"


def check_report(folder: Path) -> None:
    """Refuse what :func:`write_report` could not do: before systems are simulated, not after it.

    Raises ZeroshotError if the folder cannot be made or written into, a folder has the name of one of the files, or
    matplotlib is not installed.
    """
    check_folder(folder, ZeroshotError)
    for name in (TABLE, NUMBERS, PICTURE):
        if (folder / name).is_dir():
            raise ZeroshotError(f"{folder / name}: is a folder; expected none where a file of that name is to be")
    if importlib.util.find_spec("matplotlib") is None:
        raise ZeroshotError(f"{folder / PICTURE}: matplotlib is not installed; expected it for the picture")


def write_report(comparison: Comparison, folder: Path) -> list[Path]:
    """Write table, numbers and picture into a folder; returns the files.

    Raises ZeroshotError as :func:`check_report`.
    """
    check_report(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / TABLE, markdown(comparison).encode())
    write_atomically(folder / NUMBERS, numbers(comparison).encode())
    draw(comparison, folder / PICTURE)
    return [folder / name for name in (TABLE, NUMBERS, PICTURE)]


def markdown(comparison: Comparison) -> str:
    """The table as Markdown: bias and rms of each output over everything, months, regimes and systems.

    Above it stands what only one of the models has.
    """
    heads = [f"{one.name} [{one.unit}] bias, rms, largest" for one in comparison.outputs]
    first, second = comparison.names
    lines = [
        f"`{second}` minus `{first}`, {counted(len(comparison.systems), 'system')}",
        "",
        *(f"- {note}" for note in comparison.notes),
        *[""] * bool(comparison.notes),
        f"| | | steps | {' | '.join(heads)} |",
        f"|---|---|---:|{'---:|' * len(heads)}",
    ]
    for row in comparison.rows():
        figures = (
            f"{number(bias, 3, signed=True)}, {number(rms, 3)}, {number(largest, 3)}"
            for bias, rms, largest in zip(row.bias, row.rms, row.largest, strict=True)
        )
        lines.append(f"| {row.group} | {row.cell} | {row.steps} | {' | '.join(figures)} |")
    return "\n".join(lines) + "\n"


def numbers(comparison: Comparison) -> str:
    """The table in long form as CSV."""
    return pd.DataFrame(comparison.records()).to_csv(index=False, lineterminator="\n")


def draw(comparison: Comparison, path: Path) -> None:
    """For each output: the difference over the time of year, its rms by regime, and the week that differs most."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    count = len(comparison.outputs)
    figure = Figure(figsize=(15, 2.9 * count + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    first, second = comparison.names
    figure.suptitle(f"{second} minus {first}, {counted(len(comparison.systems), 'system')}")
    axes = figure.subplots(count, 3, squeeze=False, width_ratios=[3, 2, 3])
    rows = [row for row in comparison.rows() if row.group in ("all", "regime")]
    for k, output in enumerate(comparison.outputs):
        unit = f"{output.name} [{output.unit}]"
        _over_time(axes[k, 0], comparison, k, unit)
        _by_regime(axes[k, 1], rows, k, unit)
        _worst_week(axes[k, 2], comparison, k, unit)
    for text in figure.findobj(Text):  # between two dollars in a name it would read a formula
        text.set_parse_math(False)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    write_atomically(path, data.getvalue())


def _over_time(axes: Axes, comparison: Comparison, k: int, unit: str) -> None:
    """Daily rms and mean of the difference over all systems."""
    day = np.floor((comparison.time.ravel() - 1.0) / DAY).astype(int)
    difference = comparison.differences[:, k].ravel()
    days, place = np.unique(day, return_inverse=True)
    steps = np.bincount(place)
    axes.plot(days, np.sqrt(np.bincount(place, difference**2) / steps), color=_FIRST, label="rms of the day")
    axes.plot(days, np.bincount(place, difference) / steps, color=_BIAS, label="mean of the day")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set(ylabel=f"difference of {unit}", xlabel="days since 1 January")
    axes.legend(**_LEGEND)


def _by_regime(axes: Axes, rows: list[Row], k: int, unit: str) -> None:
    places = np.arange(len(rows))
    axes.barh(places, [row.rms[k] for row in rows], color=_FIRST, height=0.6, label="rms")
    axes.plot([row.bias[k] for row in rows], places, "o", color=_SECOND, markersize=4, label="bias")
    axes.axvline(0.0, color="black", linewidth=0.6)
    axes.set_yticks(places, [row.cell for row in rows], fontsize="small")
    axes.invert_yaxis()
    axes.locator_params(axis="x", nbins=4)
    axes.ticklabel_format(axis="x", scilimits=(-2, 6))  # longer labels would run into each other
    axes.set(xlabel=f"difference of {unit}")
    axes.legend(**_LEGEND)


def _worst_week(axes: Axes, comparison: Comparison, k: int, unit: str) -> None:
    """Both models over the week in which one system's difference has the largest rms."""
    squares = comparison.differences[:, k] ** 2
    span = float(np.median(np.diff(comparison.time[0]))) if comparison.time.shape[1] > 1 else WEEK
    length = min(max(1, round(WEEK / span)), squares.shape[1])
    running = np.cumsum(np.pad(squares, ((0, 0), (1, 0))), axis=1)
    sums = running[:, length:] - running[:, :-length]
    system, begin = np.unravel_index(np.argmax(sums), sums.shape)
    part = slice(begin, begin + length)
    days = comparison.time[system, part] / DAY
    axes.plot(days, comparison.first[system, k, part], color=_FIRST, label=comparison.names[0])
    axes.plot(days, comparison.second[system, k, part], color=_SECOND, linestyle="--", label=comparison.names[1])
    which = f"system {comparison.systems[system]}, the week that differs most"
    axes.set(ylabel=unit, xlabel=f"days since 1 January ({which})")
    axes.legend(**_LEGEND)
