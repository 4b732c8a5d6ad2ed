"""A part as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shared.metrics import r2, relative_accuracy
from trainer.benchmarking.gathering import Finding, Scores
from trainer.benchmarking.parts import Part
from trainer.evaluating.report import read_answers
from trainer.figures import Point, draw_accuracy, draw_scatter, draw_scores, draw_series


def draw(part: Part, findings: Sequence[Finding | None], folder: Path) -> list[Path]:
    """Draw what is there; returns the files."""
    known = [(row.labels, finding) for row, finding in zip(part.rows, findings, strict=True) if finding is not None]
    if not known:
        return []
    if part.picture == "scatter":
        return [_scatter(part, labels, finding, folder) for labels, finding in known]
    if part.picture == "accuracy":
        models = list(dict.fromkeys(labels[0] for labels, _ in known))
        return [_accuracy(part, model, [one for one in known if one[0][0] == model], folder) for model in models]
    path = folder / f"{part.name}.png"
    if part.picture == "systems":
        series: dict[tuple[str, str], list[tuple[float, Point]]] = {}
        for labels, finding in known:
            for protocol, scores in finding.protocols.items():
                series.setdefault((labels[0], protocol), []).append((float(labels[1]), point(scores)))
        limits = {finding.limit(-1) for _, finding in known} - {None}
        limit = limits.pop() if len(limits) == 1 else None
        draw_series(series, "training systems", part.title, limit, path)
        return [path]
    lines = [
        (" ".join(labels), {name: point(scores) for name, scores in finding.protocols.items()}, finding.limit(-1))
        for labels, finding in known
    ]
    draw_scores(lines, part.title, path)
    return [path]


def point(scores: Scores) -> Point:
    """Mean R2 over the parameters, with its interval."""
    return Point(float(scores.mean[-1]), float(scores.low[-1]), float(scores.high[-1]))


def _scatter(part: Part, labels: tuple[str, ...], finding: Finding, folder: Path) -> Path:
    clouds = {
        name: (one.truth, one.estimate, r2(one.truth, one.estimate))
        for name, one in read_answers(finding.folders[0]).items()
    }
    title = f"{' '.join(labels)}, {finding.condition.context_hours:g} h, noise {finding.condition.noise}"
    path = folder / f"{part.name}-{labels[0]}.png"
    draw_scatter(clouds, finding.parameters, finding.units, title, path)
    return path


def _accuracy(part: Part, model: str, known: list[tuple[tuple[str, ...], Finding]], folder: Path) -> Path:
    boxes: dict[str, list[tuple[str, np.ndarray]]] = {}
    for labels, finding in known:
        answers = [read_answers(folder) for folder in finding.folders]
        for name in answers[0]:  # of all seeds, as in the table
            every = [relative_accuracy(one[name].truth, one[name].estimate) for one in answers]
            boxes.setdefault(name, []).append((labels[1], np.concatenate(every)))
    path = folder / f"{part.name}-{model}.png"
    draw_accuracy(boxes, known[0][1].parameters, f"{part.title}: {model}", path)
    return path
