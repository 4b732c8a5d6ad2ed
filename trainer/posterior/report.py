"""What a calibration finds, and its tables: terminal, Markdown, CSV, JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel
from rich.table import Table

from shared.store import write_atomically
from trainer.posterior.scores import FEWEST, PER_BIN
from trainer.reading.kind import Kind
from trainer.tables import Row, csv_text, markdown_table, number
from trainer.tables import terminal_table as plain_table

LEVELS = (0.5, 0.8, 0.9, 0.95)
"""Of the central intervals."""


class Coverage(BaseModel, extra="forbid"):
    """Share of the windows whose central interval holds the truth, with its 90 % interval by system; none of one."""

    share: float
    low: float | None
    high: float | None


class ParameterCalibration(BaseModel, extra="forbid"):
    """One parameter. ``crps`` [own unit], beside that of the prior, and of the estimate with its validation error.

    The latter is None where the run's card has no errors for the condition.
    """

    coverage: dict[str, Coverage]
    """by level"""
    chi2_p: float | None
    """of the ranks being uniform, one window of each system; None where those are too few for a histogram"""
    ks_p: float
    """likewise, however few they are"""
    crps: float
    crps_gaussian: float | None
    crps_prior: float
    r2_mean: float | None
    """of the posterior's mean"""
    r2_point: float | None
    """of the estimator's answer"""
    width: float
    """median width of the 90 % interval, as a share of the range in the scale of the prior"""


class LogScore(BaseModel, extra="forbid"):
    """Mean log density at the truth [nat], of all parameters together."""

    posterior: float
    gaussian: float | None
    prior: float


class Calibration(BaseModel, extra="forbid"):
    """``calibration.json``."""

    schema_version: int = 6
    model: str
    dataset: Kind
    """what it is on"""
    unfinished: str | None = None
    """a sentence where the estimator's training did not come to its end, or another run is at work in its folder"""
    context_hours: float
    noise: str
    channels: list[str]
    windows: int
    systems: int
    samples: int
    parameters: dict[str, ParameterCalibration]
    coverage_mean: dict[str, Coverage]
    log_score: LogScore
    gaussian_note: str
    """what the Gaussian is, or why there is none"""


def _share(one: Coverage) -> str:
    if one.low is None or one.high is None:
        return f"{100 * one.share:.1f} [-]"
    return f"{100 * one.share:.1f} [{100 * one.low:.1f}, {100 * one.high:.1f}]"


def _share_of_prior(one: ParameterCalibration) -> float | None:
    """The Gaussian's CRPS as a share of the prior's."""
    return None if one.crps_gaussian is None else one.crps_gaussian / one.crps_prior


def table_rows(result: Calibration) -> tuple[Row, list[Row]]:
    """Header and rows; the last row is the mean."""
    header = (
        *("parameter", *(f"{100 * level:g} %" for level in LEVELS), "chi2 p", "KS p"),
        *("CRPS/prior", "Gaussian's", "R2 mean", "R2 point", "width"),
    )
    rows: list[Row] = []
    for name, one in result.parameters.items():
        shares = [100 * one.coverage[f"{level:g}"].share for level in LEVELS]
        cells = [f"{share:.1f}" if level != 0.9 else "" for share, level in zip(shares, LEVELS, strict=True)]
        cells[LEVELS.index(0.9)] = _share(one.coverage["0.9"])
        rows.append(
            (
                *(name, *cells, number(one.chi2_p), f"{one.ks_p:.3f}"),
                *(f"{one.crps / one.crps_prior:.3f}", number(_share_of_prior(one))),
                *(number(one.r2_mean), number(one.r2_point), f"{one.width:.3f}"),
            )
        )
    middle = [f"{100 * result.coverage_mean[f'{level:g}'].share:.1f}" for level in LEVELS]
    middle[LEVELS.index(0.9)] = _share(result.coverage_mean["0.9"])
    each = list(result.parameters.values())
    gaussian = [share for share in map(_share_of_prior, each) if share is not None]
    r2 = [[v for v in column if v is not None] for column in ([o.r2_mean for o in each], [o.r2_point for o in each])]
    rows.append(
        (
            *("mean", *middle, "", ""),
            f"{sum(o.crps / o.crps_prior for o in each) / len(each):.3f}",
            number(sum(gaussian) / len(gaussian) if gaussian else None),
            *(number(sum(column) / len(column) if column else None) for column in r2),
            f"{sum(o.width for o in each) / len(each):.3f}",
        )
    )
    return header, rows


def notes(result: Calibration) -> list[str]:
    """Sentences under the table."""
    score = result.log_score
    too_few = any(one.chi2_p is None for one in result.parameters.values())
    few = f"; chi2 takes {FEWEST * PER_BIN} systems" if too_few else ""
    gaussian = "" if score.gaussian is None else f", Gaussian {score.gaussian - score.prior:.2f} nat"
    return [
        *([result.unfinished] if result.unfinished else []),
        result.dataset.sentence(),
        f"{result.windows} disjoint windows of {result.systems} systems that neither estimator nor posterior has seen,"
        f" {result.samples} samples each",
        "% columns: share of the windows whose central interval covers the truth; for 90 % with its interval by system",
        f"p: of the ranks being uniform, one window of each system{few}",
        "CRPS as a share of the prior's",
        result.gaussian_note,
        "width: median width of the 90 % interval, as a share of the range in the scale of the prior",
        f"mean log density at the truth above the prior's: posterior {score.posterior - score.prior:.2f} nat{gaussian}",
    ]


def _title(result: Calibration) -> str:
    condition = f"{result.context_hours:g} h, noise {result.noise}, {result.dataset.heading()}"
    return f"Posterior of {result.model}, {condition}"


def terminal_table(result: Calibration, width: int) -> Table:
    """The table for a terminal of so many characters."""
    return plain_table(_title(result), *table_rows(result), width=width)


def markdown(result: Calibration) -> str:
    """The table as Markdown."""
    header, rows = table_rows(result)
    lines = [
        f"# {_title(result)}",
        "",
        f"Channels {', '.join(result.channels)}.",
        "",
        markdown_table(header, rows),
        "",
        *(f"- {note}" for note in notes(result)),
    ]
    return "\n".join(lines) + "\n"


def as_csv(result: Calibration) -> str:
    """One row per parameter and level, full precision."""
    other = ["chi2_p", "ks_p", "crps", "crps_gaussian", "crps_prior", "r2_mean", "r2_point", "width"]
    rows: list[list[Any]] = [["parameter", "level", "coverage", "coverage_low", "coverage_high", *other]]
    for name, one in result.parameters.items():
        figures = [getattr(one, field) for field in other]
        for level, cover in one.coverage.items():
            rows.append([name, level, cover.share, cover.low, cover.high, *figures])
    for level, cover in result.coverage_mean.items():
        rows.append(["mean", level, cover.share, cover.low, cover.high, *("" for _ in other)])
    return csv_text(rows)


def write_calibration(result: Calibration, folder: Path) -> None:
    """Write calibration.json, calibration.md and calibration.csv."""
    write_atomically(folder / "calibration.json", (result.model_dump_json(indent=1) + "\n").encode())
    write_atomically(folder / "calibration.md", markdown(result).encode())
    write_atomically(folder / "calibration.csv", as_csv(result).encode())
