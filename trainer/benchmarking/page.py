"""``results.md``: the tables and figures of a benchmark on one page, with what the reader needs to judge them."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import torch

import shared
from shared.store import write_atomically
from trainer.benchmarking.drawing import draw
from trainer.benchmarking.gathering import Finding, failures, gather
from trainer.benchmarking.parts import PATCHES, Part
from trainer.benchmarking.planning import Plan
from trainer.benchmarking.published import Published
from trainer.benchmarking.tables import as_csv, detail_table, main_table

RESULTS = "results.md"

_READINGS = f"""## Where the paper contradicts itself, and how it is read here

- **How many systems?** The abstract, section 2.4 and section 4.1 say 100 systems (80 / 10 / 10); the introduction says
  2,000 simulations. Read as 100: it is said three times, and the split is given for it. The table of the number of
  training systems has both, 80 and 2,000, and more.
- **Hourly or every five minutes?** The introduction says a week in five-minute steps; sections 2.2, 2.3 and 4.1 say a
  year in hourly steps. Read as hourly: contexts of 30 days and a patch of 12 that "corresponds to a 12 h window" exist
  only there. Patch sizes ({", ".join(map(str, PATCHES))}) are in samples.
- **"2000 training iterations"** at a batch of 16 are 32,000 windows and half a minute of one core; the paper also says
  one to two hours on sixteen cores, so they may be epochs of a size that is not given. {{iterations}} What each
  estimator took is stated in steps, windows seen and minutes. Budgets are equal for all of a table in the unit that
  was given, steps or minutes; windows a step are each model's own.
- **Held out or not?** Section 4.1 calls its snippets held out and draws them from the full dataset in the same
  paragraph. Both are reported: `paper` draws windows of all systems, of which most were trained on; `unseen` draws
  windows of test systems only. With 80 training systems the paper's figures are plausible only under the first.
- **100 or 1,000 test windows?** The caption of Table 3 says 100, its text and section 4.1 say 1,000. Read as 1,000
  disjoint windows, fewer where the dataset has fewer.
- **Context of Table 3** is not given, and its mean at patch 12 (0.998) is not that of Table 4 at 7 days (0.967), which
  is the same network. Read as 7 days.
"""


def readings(plan: Plan) -> str:
    """The paper's contradictions, and how this run reads them."""
    words = "the words literally" if plan.budget.steps else "neither, but a time"
    return _READINGS.format(iterations=f"This run takes {words}: a fit has {plan.budget.text()}.")


def write_results(plan: Plan, published: Published, command: str) -> Path:
    """Write every part's CSV, Markdown and PNG, and the page that joins them; returns the page."""
    known: dict[object, Finding | None] = {}
    sections = []
    for part in plan.parts:
        findings = []
        for row in part.rows:
            if row.condition not in known:
                known[row.condition] = gather(plan, row.condition)
            findings.append(known[row.condition])
        text = _section(part, findings, published, plan)
        write_atomically(plan.out / f"{part.name}.csv", as_csv(part, findings, published).encode())
        write_atomically(plan.out / f"{part.name}.md", text.encode())
        sections.append(text)
    found = [one for one in known.values() if one is not None]
    page = "\n".join([_head(plan, found, published, command), *sections, readings(plan)])
    write_atomically(plan.out / RESULTS, page.encode())
    return plan.out / RESULTS


def _section(part: Part, findings: list[Finding | None], published: Published, plan: Plan) -> str:
    known = [finding for finding in findings if finding is not None]
    lines = [f"## {part.title}", "", part.text, ""]
    if known:
        lines += [main_table(part, findings, published), ""]
        lines += [f"![{path.stem}]({path.name})\n" for path in draw(part, findings, plan.out)]
        what = " / ".join([*(f"R2 {name}" for name in known[0].protocols), "ceiling"])
        what += " / published, where it was" if any(f.part == part.name and f.r2 for f in published.figures) else ""
        lines += [f"Parameter by parameter, {what}:", "", detail_table(part, findings, published), ""]
    notes = list(part.notes)
    if any(finding is None or len(finding.trainings) < plan.seeds for finding in findings):
        notes.append(f"not finished: a line has fewer than {plan.seeds} seeds, or none")
    # the page goes to other people: where the dataset lies on this machine is nothing to them
    notes += dict.fromkeys(f.ceiling_note.replace(f"{plan.dataset}{os.sep}", "") for f in known if f.ceiling is None)
    notes += dict.fromkeys(sentence for finding in known for sentence in finding.warnings)
    return "\n".join([*lines, *(f"- {note}" for note in notes)]) + "\n"


def _head(plan: Plan, found: list[Finding], published: Published, command: str) -> str:
    facts = plan.identity
    done = [training for finding in found for training in finding.trainings]
    lines = ["# Benchmark of estimators", ""]
    if command:
        lines += ["```sh", command, "```", ""]
    lines += [
        f"- dataset: {facts['systems']} systems of {facts['system_name']}, records of {facts['hours']:g} h in steps of"
        f" {facts['step']:g} s, {plan.training} training systems",
        f"- budget of each fit: {plan.budget.text()} on one thread; `mean` and `ridge` are solved, not iterated;"
        f" {len(done)} of {len(plan.fits)} fits are finished",
    ]
    if done:
        steps, seen = sum(t.steps for t in done), sum(t.steps * t.batch_size for t in done)
        minutes = sum(t.seconds for t in done) / 60
        lines.append(f"- in all {steps} steps, {seen} windows seen, {minutes:.1f} min of training")
    if found:
        windows = "; ".join(
            f"{name} up to {max(f.protocols[name].windows for f in found)} windows of up to"
            f" {max(f.protocols[name].systems for f in found)} systems"
            for name in found[0].protocols
        )
        lines.append(f"- scored on disjoint windows: {windows}; the same for every seed")
    lines += [
        f"- fits of each condition: {plan.seeds}, with seeds from 0; mean ± standard deviation over seeds; in brackets"
        " the 90 % interval of that mean, leaving out one system after the other",
        "- R2 in the parameters' own units; `mean` columns are over the parameters (of accuracies, the median of"
        " all); weights are those that were best on validation systems, which are in no score of `unseen`",
        "- the ceiling is the linearised Bayesian limit under the same condition (`datagen identifiability`)",
        f"- machine: {os.cpu_count()} cores, {platform.machine()}, {platform.system()}; {plan.workers} fits at a time;"
        f" Python {platform.python_version()}, torch {torch.__version__}, zeroshot-fmu {shared.__version__}",
    ]
    lines += [f"- published: {published.source}"] if published.source else []
    lines += [f"- **failed**: {sentence}" for sentence in failures(plan)]
    return "\n".join(lines) + "\n"
