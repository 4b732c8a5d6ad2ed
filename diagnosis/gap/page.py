"""``report.json`` and ``report.html``: written together, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from diagnosis.fitting.unknowns import LIMIT, within_limit
from diagnosis.gap.concluded import Diagnosis
from diagnosis.gap.limits import added
from diagnosis.gap.pictures import (
    SHOWN,
    barless,
    draw_angles,
    draw_candidates,
    draw_outputs,
    draw_parameters,
    draw_shares,
)
from diagnosis.gap.reporting import sensors_among
from diagnosis.gap.scan import LEVEL, NEGLIGIBLE
from diagnosis.gap.schema import HOW_FAR, Place
from diagnosis.gap.sentences import headline
from diagnosis.gap.twins import SHOWN as SHOWN_TWINS
from diagnosis.pages import page_environment
from diagnosis.physics import hints, warnings
from diagnosis.pictures import at_day, embedded
from diagnosis.recording import DAY
from diagnosis.where.ink import few_digits
from diagnosis.where.pictures import draw_cells, draw_correlations
from diagnosis.where.source import Source, Verdict
from diagnosis.where.timelines import draw_episodes, draw_sources
from diagnosis.whole import whole


def write_report(done: Diagnosis, folder: Path) -> None:
    """Write ``report.json`` and ``report.html`` into a folder, both or none."""
    page = render(done)
    with whole(folder) as draft:
        (draft / "report.json").write_text(done.report.model_dump_json(indent=1) + "\n", encoding="utf-8")
        (draft / "report.html").write_text(page, encoding="utf-8")


def render(done: Diagnosis) -> str:
    """The page as HTML, pictures and all."""
    environment = page_environment(decimals=0)
    zero, system = done.whole.recording.zero, done.whole.system
    begin = zero + np.timedelta64(round(done.report.start), "s")
    environment.filters["dated"] = lambda one: dated(one, zero)
    relative = {one.name: one.relative for one in done.base.problem.constants}
    widest = {one.name: float(max(abs(one.estimate).max(), abs(one.high).max())) for one in _sources(done)}
    return environment.get_template("gap.html.j2").render(
        report=done.report,
        warnings=warnings(done.report.physics),
        hints=hints(done.report.physics),
        headline=headline(done.report),
        how_far=HOW_FAR,
        begin=str(begin).replace("T", " "),
        units={one.name: one.unit for one in done.report.effects},
        better={one.condition: one.smallest for one in done.report.otherwise},
        apart=done.apart is not None,
        added=added(done.report.verdict),
        days=done.report.steps * done.report.step / DAY,
        shown=SHOWN_TWINS,
        against=_against(done),
        outputs={one.name: one.long_name for one in system.outputs},
        parameters={one.name: one.description for one in system.parameters}
        | {one.name: one.description for one in system.uncertain},
        negligible=f"{NEGLIGIBLE:g}",
        level=f"{LEVEL:.0%}",
        barless=barless(done),
        channel_units={one.name: one.unit for one in system.outputs},
        limit=f"{LIMIT:g}",
        constants=relative,
        within=lambda name, value: within_limit(value, relative.get(name)),
        shown_in=lambda one: few_digits(one.unit, widest.get(one.name, 0.0)),
        pictures=_pictures(done),
    )


def _against(done: Diagnosis) -> dict[str, str]:
    """What was found of each source beside the error of a sensor, by the source's name."""
    residuals, tested = done.where.residuals, done.where.sources
    if tested is None:
        return {}
    labels = dict(zip(residuals.names, residuals.labels, strict=True))
    answered = answered_by(done)
    return {one.name: tested.words(one, labels[one.rival], answered=answered) for one in tested.sources}


def _sources(done: Diagnosis) -> list[Source]:
    return done.where.sources.sources if done.where.sources is not None else []


def answered_by(done: Diagnosis) -> set[Verdict]:
    """What the effects that the answer names are: errors of a sensor, of a balance, or both; "none" without a gap."""
    if done.report.verdict == "no_gap":
        return {"none"}
    sensors = sensors_among(done.search.stages[0])
    return {"sensor" if one.name in sensors else "balance" for one in done.report.effects if one.named}


def dated(one: Place, zero: np.datetime64) -> str:
    """The dates of a finding that has a time, in brackets; nothing for others."""
    stretch = [float(one.cell[key]) for key in ("first_s", "last_s") if key in one.cell]
    return f" ({' to '.join(at_day(zero, second, minutes=True) for second in stretch)})" if stretch else ""


def _pictures(done: Diagnosis) -> dict[str, str]:
    """All pictures by name, those that there is something to show in."""
    where, scan, zero = done.where.among_all(), done.search.stages[0].scan, done.whole.recording.zero
    made: dict[str, Figure] = {
        "outputs": draw_outputs(done),
        "episodes": draw_episodes(where.residuals, where.episodes, zero=zero),
        "parameters": draw_parameters(done),
    }
    looked = [where.residuals.names[k] for k in where.cells.channels]
    named = [name for name in looked if name in {one.channel for one in done.report.where if one.kind != "source"}]
    for name, only in (("cells", named), ("other_cells", [name for name in looked if name not in named])):
        if only:
            made[name] = draw_cells(where.residuals, where.cells, only=only)
    if scan.effects:
        made["candidates"] = draw_candidates(done)
    if (scan.expected > SHOWN).any():
        made["angles"] = draw_angles(done)
    if where.correlations is not None:
        made["correlations"] = draw_correlations(where.residuals, where.correlations)
    if where.sources is not None:
        made["sources"] = draw_sources(where.residuals, where.sources, answered=answered_by(done), zero=zero)
    if any(one.share is not None for one in done.report.shrinkage):
        made["shares"] = draw_shares(done)
    return {name: embedded(one) for name, one in made.items()}
