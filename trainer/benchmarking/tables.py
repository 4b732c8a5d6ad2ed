"""A part as CSV (everything, full precision) and as Markdown (means over parameters, then parameter by parameter)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from trainer.benchmarking.gathering import Finding, Scores
from trainer.benchmarking.parts import Part
from trainer.benchmarking.published import Published
from trainer.tables import NONE, csv_text, markdown_table, number


def score(scores: Scores, k: int) -> str:
    """Mean over seeds, spread over seeds, interval by system."""
    spread = "" if math.isnan(scores.sd[k]) else f" ± {number(float(scores.sd[k]))}"
    return f"{number(float(scores.mean[k]))}{spread} [{number(scores.low[k], 2)}, {number(scores.high[k], 2)}]"


def main_table(part: Part, findings: Sequence[Finding | None], published: Published) -> str:
    """Mean R2 over the parameters under every protocol, the ceiling, what is left to it, and the budget used."""
    protocols = _protocols(findings)
    theirs = [published.find(part.name, row.labels, None) for row in part.rows]
    show = any(value is not None for value in theirs)
    header = [*part.heads, *(f"R2 {name}" for name in protocols), "ceiling", f"ceiling - {protocols[-1]}"]
    header += ["published"] if show else []
    header += [f"accuracy {name}" for name in protocols] if part.picture == "accuracy" else []
    header += ["seeds", "training systems", "steps", "windows seen", "training [min]"]
    rows = []
    for row, finding, value in zip(part.rows, findings, theirs, strict=True):
        if finding is None:
            rows.append([*row.labels, *[NONE] * (len(header) - len(row.labels))])
            continue
        limit = finding.limit(-1)
        gap = None if limit is None else limit - float(finding.protocols[protocols[-1]].mean[-1])
        cells = [*row.labels, *(score(finding.protocols[name], -1) for name in protocols), number(limit), number(gap)]
        cells += [number(value)] if show else []
        if part.picture == "accuracy":
            cells += [number(float(finding.protocols[name].accuracy[-1])) for name in protocols]
        rows.append(cells + _budget(finding))
    return markdown_table(header, rows)


def _budget(finding: Finding) -> list[str]:
    done = finding.trainings
    steps = round(float(np.mean([one.steps for one in done])))
    seen = round(float(np.mean([one.steps * one.batch_size for one in done])))
    minutes = float(np.mean([one.seconds for one in done])) / 60
    return [str(len(done)), str(finding.training_systems), str(steps), str(seen), f"{minutes:.2f}"]


def detail_table(part: Part, findings: Sequence[Finding | None], published: Published) -> str:
    """Parameter by parameter: R2 under every protocol, the ceiling, and what was published, if it was."""
    known = [(row, finding) for row, finding in zip(part.rows, findings, strict=True) if finding is not None]
    protocols = _protocols(findings)
    names = known[0][1].parameters
    rows = []
    for row, finding in known:
        cells = []
        for k, name in enumerate(names):
            values = [number(float(finding.protocols[one].mean[k]), 2) for one in protocols]
            theirs = published.find(part.name, row.labels, name)
            values += [number(finding.limit(k), 2)] + ([number(theirs, 3)] if theirs is not None else [])
            cells.append(" / ".join(values))
        rows.append([*row.labels, *cells])
    return markdown_table([*part.heads, *names], rows)


def _protocols(findings: Sequence[Finding | None]) -> list[str]:
    for finding in findings:
        if finding is not None:
            return list(finding.protocols)
    return ["paper", "unseen"]


def as_csv(part: Part, findings: Sequence[Finding | None], published: Published) -> str:
    """One row per line, protocol and parameter.

    The parameter ``mean`` is the mean over them, of relative accuracies the median of all.
    """
    figures = ["r2", "r2_sd", "r2_low", "r2_high", "ceiling", "published", "relative_accuracy"]
    facts = ["seeds", "windows", "systems", "systems_trained_on", "training_systems", "steps", "batch_size", "seconds"]
    lines: list[list[Any]] = [[*part.heads, "protocol", "parameter", *figures, *facts]]
    for row, finding in zip(part.rows, findings, strict=True):
        if finding is None:
            continue
        done = finding.trainings
        steps, seconds = (float(np.mean([getattr(one, name) for one in done])) for name in ("steps", "seconds"))
        for protocol, one in finding.protocols.items():
            for k, name in enumerate([*finding.parameters, "mean"]):
                last = k == len(finding.parameters)
                limit = finding.limit(-1 if last else k)
                theirs = published.find(part.name, row.labels, None if last else name)
                values = [one.mean[k], one.sd[k], one.low[k], one.high[k], limit, theirs, one.accuracy[k]]
                cells = ["" if v is None or math.isnan(v) else f"{v:.6g}" for v in values]
                counts = [len(done), one.windows, one.systems, one.trained_on, finding.training_systems]
                line = [*cells, *counts, f"{steps:g}", done[0].batch_size, f"{seconds:.1f}"]
                lines.append([*row.labels, protocol, name, *line])
    return csv_text(lines)
