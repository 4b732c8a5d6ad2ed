"""What an evaluation finds, and its tables: terminal, Markdown, CSV, JSON."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from pydantic import BaseModel
from rich.table import Table

from shared.errors import EstimatorError
from shared.reading import MIB, read_text, why
from shared.results import Result
from shared.store import write_atomically
from trainer.figures import draw_r2
from trainer.reading.kind import Kind
from trainer.runs.checkpoint import Card
from trainer.tables import Row, csv_text, markdown_table, number
from trainer.tables import terminal_table as plain_table

EVALUATION = "evaluation.json"
ANSWERS = "answers.csv"
"""Every window's true and estimated parameters."""
MOST_ANSWERS = 512 * MIB


class Protocol(BaseModel, extra="forbid"):
    """Figures of merit under one protocol. R2 is None where the true parameter does not vary."""

    r2: dict[str, float | None]
    r2_mean: float | None
    r2_interval: dict[str, tuple[float | None, float | None]]
    r2_mean_interval: tuple[float | None, float | None]
    relative_accuracy: dict[str, float]
    windows: int
    systems: int
    systems_trained_on: int


class Answers(NamedTuple):
    """What an estimator answered to the windows of one protocol, and the truth."""

    seeds: np.ndarray
    """root seed of each window's system (windows,)"""
    systems: np.ndarray
    """index of each window's system (windows,)"""
    begin: np.ndarray
    """first time stamp (windows,) [s since time zero]"""
    truth: np.ndarray
    """(windows, parameters) [own units]"""
    estimate: np.ndarray
    """(windows, parameters) [own units]"""

    def places(self) -> np.ndarray:
        """A number for each window's system, int64 (windows,): a system is known by root seed and index."""
        codes: dict[tuple[int, int], int] = {}
        pairs = zip(self.seeds.tolist(), self.systems.tolist(), strict=True)
        return np.array([codes.setdefault(pair, len(codes)) for pair in pairs], dtype=np.int64)


class CeilingFigures(BaseModel, extra="forbid"):
    """The linearised Bayesian limit of R2 under the same condition."""

    r2: dict[str, float]
    r2_mean: float


class Evaluation(Result, BaseModel, extra="forbid"):
    """``evaluation.json``."""

    schema_version: int = 3
    model: str
    dataset: Kind | None = None
    """what it is on; None in files of earlier versions"""
    unfinished: str | None = None
    """a sentence where the run's training did not come to its end, or another run is at work in its folder"""
    context_hours: float
    step: float
    noise: str
    channels: list[str]
    protocols: dict[str, Protocol]
    ceiling: CeilingFigures | None
    ceiling_note: str

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        scores = ", ".join(f"{name} {number(one.r2_mean)}" for name, one in self.protocols.items())
        return f"{self.model}, {self.context_hours:g} h, noise {self.noise}; mean R2: {scores}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each parameter and protocol: R2, its 90 % interval, the median accuracy, and the ceiling of R2."""
        rows = []
        for protocol, one in self.protocols.items():
            for name, value in one.r2.items():
                low, high = one.r2_interval[name]
                limit = None if self.ceiling is None else self.ceiling.r2.get(name)
                figures = {"r2": value, "low": low, "high": high, "accuracy": one.relative_accuracy[name]}
                rows.append({"parameter": name, "protocol": protocol, **figures, "ceiling": limit})
        return pd.DataFrame(rows).set_index(["parameter", "protocol"])

    def plot(self) -> Figure:
        """R2 of each parameter with its 90 % interval, by protocol; a dash is the ceiling."""
        return draw_r2(self.to_dataframe())


def _r2(protocol: Protocol, parameter: str | None) -> str:
    """R2 with its interval; the mean over parameters where ``parameter`` is None."""
    value = protocol.r2_mean if parameter is None else protocol.r2[parameter]
    low, high = protocol.r2_mean_interval if parameter is None else protocol.r2_interval[parameter]
    span = ", ".join(number(end, 2) for end in (low, high))
    return f"{number(value)} [{span}]"


def told(evaluation: Evaluation) -> dict[str, Protocol]:
    """The protocols that differ: of a dataset none of whose systems the run has seen, both are the last one."""
    if any(one.systems_trained_on for one in evaluation.protocols.values()):
        return evaluation.protocols
    return dict([list(evaluation.protocols.items())[-1]])


def table_rows(evaluation: Evaluation) -> tuple[Row, list[Row]]:
    """Header and rows: R2 of the protocols, the ceiling, median relative accuracy; the last row is the mean."""
    names = list(told(evaluation))
    header = ("parameter", *(f"R2 {name}" for name in names), "ceiling", *(f"accuracy {name}" for name in names))
    ceiling = evaluation.ceiling
    rows: list[Row] = []
    for parameter in evaluation.protocols[names[0]].r2:
        limit = ceiling.r2.get(parameter) if ceiling else None
        accuracy = (number(evaluation.protocols[name].relative_accuracy[parameter]) for name in names)
        rows.append((parameter, *(_r2(evaluation.protocols[n], parameter) for n in names), number(limit), *accuracy))
    last = number(ceiling.r2_mean if ceiling else None)
    rows.append(("mean", *(_r2(evaluation.protocols[name], None) for name in names), last, *("" for _ in names)))
    return header, rows


def notes(evaluation: Evaluation) -> list[str]:
    """Sentences under the table."""
    lines = [
        f"{name}: {one.windows} disjoint windows of {one.systems} systems, {one.systems_trained_on} of which the run"
        " had trained on or been validated by"
        for name, one in told(evaluation).items()
    ]
    meant = (
        "R2 in the parameters' own units, with 90 % intervals by system; accuracy: median of 1 less the relative error"
    )
    cut_short = [evaluation.unfinished] if evaluation.unfinished else []
    data = [evaluation.dataset.sentence()] if evaluation.dataset else []
    return [*cut_short, *data, *lines, meant, evaluation.ceiling_note]


def _on(dataset: Kind | None) -> str:
    return "" if dataset is None else f", {dataset.heading()}"


def terminal_table(evaluation: Evaluation, width: int) -> Table:
    """The table for a terminal of so many characters."""
    header, rows = table_rows(evaluation)
    title = f"{evaluation.model}, {evaluation.context_hours:g} h, noise {evaluation.noise}{_on(evaluation.dataset)}"
    return plain_table(title, header, rows, width=width)


def markdown(evaluation: Evaluation, card: Card) -> str:
    """The table as Markdown."""
    header, rows = table_rows(evaluation)
    lines = [
        f"# {evaluation.model} on {card.system_name}{_on(evaluation.dataset)}",
        "",
        f"Context {evaluation.context_hours:g} h, step {evaluation.step:g} s, noise {evaluation.noise},"
        f" channels {', '.join(evaluation.channels)}; {card.training.best_step} steps of {card.training.batch_size}"
        f" windows, {len(card.training_systems.indices)} training systems.",
        "",
        markdown_table(header, rows),
        "",
        *(f"- {note}" for note in notes(evaluation)),
    ]
    return "\n".join(lines) + "\n"


def as_csv(evaluation: Evaluation) -> str:
    """One row per protocol and parameter, full precision."""
    rows: list[list[Any]] = [["protocol", "parameter", "r2", "r2_low", "r2_high", "relative_accuracy", "ceiling"]]
    ceiling = evaluation.ceiling
    for name, one in evaluation.protocols.items():
        for parameter, value in one.r2.items():
            limit = ceiling.r2.get(parameter) if ceiling else None
            rows.append([name, parameter, value, *one.r2_interval[parameter], one.relative_accuracy[parameter], limit])
        mean = ceiling.r2_mean if ceiling else None
        rows.append([name, "mean", one.r2_mean, *one.r2_mean_interval, None, mean])
    return csv_text(rows)


def write_answers(answers: dict[str, Answers], parameters: list[str], folder: Path) -> None:
    """Write answers.csv: one row per protocol and window, whose system is known by root seed and index."""
    names = [f"{kind} {name}" for kind in ("true", "estimated") for name in parameters]
    rows: list[list[Any]] = [["protocol", "root_seed", "system", "begin", *names]]
    for protocol, one in answers.items():
        numbers = np.concatenate([one.begin[:, None], one.truth, one.estimate], axis=1)
        for seed, system, row in zip(one.seeds, one.systems, numbers, strict=True):
            rows.append([protocol, seed, system, *(f"{value:.9g}" for value in row)])
    write_atomically(folder / ANSWERS, csv_text(rows).encode())


def read_answers(folder: Path) -> dict[str, Answers]:
    """Read what :func:`write_answers` wrote.

    Raises EstimatorError if the file is missing or damaged.
    """
    path = folder / ANSWERS
    text = read_text(path, EstimatorError, "a file of `trainer evaluate`", most=MOST_ANSWERS)
    try:
        return _parsed(list(csv.reader(io.StringIO(text, newline=""))))
    except (ArithmeticError, LookupError, ValueError, csv.Error) as error:
        raise EstimatorError(f"{path}: damaged ({why(error)}); evaluate the run again") from None


def _parsed(rows: list[list[str]]) -> dict[str, Answers]:
    half = (len(rows[0]) - 4) // 2
    found = {}
    for protocol in dict.fromkeys(row[0] for row in rows[1:]):
        chosen = [row for row in rows[1:] if row[0] == protocol]
        numbers = np.array([row[3:] for row in chosen], dtype=float)
        found[protocol] = Answers(
            np.array([int(row[1]) for row in chosen], dtype=object),
            np.array([int(row[2]) for row in chosen]),
            numbers[:, 0],
            numbers[:, 1 : 1 + half],
            numbers[:, 1 + half :],
        )
    return found


def write_report(evaluation: Evaluation, card: Card, folder: Path, further: str = "") -> None:
    """Write evaluation.json, evaluation.md, which ends with ``further`` tables, and evaluation.csv."""
    write_atomically(folder / EVALUATION, (evaluation.model_dump_json(indent=1) + "\n").encode())
    write_atomically(folder / "evaluation.md", (markdown(evaluation, card) + further).encode())
    write_atomically(folder / "evaluation.csv", as_csv(evaluation).encode())
