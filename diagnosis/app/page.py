"""The page: what :class:`diagnosis.app.project.Project` holds, drawn with panel, and its buttons."""

from __future__ import annotations

import asyncio
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from html import escape
from typing import Any
from zoneinfo import available_timezones

import numpy as np
import panel as pn
import xarray as xr
from panel.widgets.input import FileDropper

from diagnosis.app.job import Job
from diagnosis.app.pictures import figures, intervals, spark
from diagnosis.app.project import (
    ENDINGS,
    MOST,
    READINGS,
    STEPS,
    Column,
    Look,
    Project,
    Target,
    becomes,
    combined,
    in_target,
)
from diagnosis.calibrating.schema import read_calibration
from diagnosis.curves import readable, shown
from diagnosis.forecasting.forecasted import Forecast
from diagnosis.gap.schema import read_report
from diagnosis.gap.sentences import headline
from diagnosis.pages import long_named
from shared.errors import RecordingError, ZeroshotError
from shared.netcdf import read_netcdf
from shared.numbers import chance, number
from shared.reading import MIB
from shared.variables import spaced

WIDTH = 1080
POLL = 400
"""How often the page looks at the child process [ms]."""
NOTHING = "not used"
TITLES = {"calibration": "Parameters", "forecast": "Forecast", "diagnosis": "Diagnosis"}
ABOUT = {
    "calibration": "The room's parameters with their 90 % intervals.",
    "forecast": "The first two thirds of the recording tell the parameters; the rest is forecast and compared.",
    "diagnosis": "Where model and measurements differ, which effect is the cause, and how much it explains.",
}
ABOUTS = "<br>".join(f"<b>{TITLES[one]}</b>: {text}" for one, text in ABOUT.items())
LIMITS = {"no limit": 0.0, "5 minutes": 5.0, "20 minutes": 20.0, "1 hour": 60.0}
CARD = {
    "background": "white",
    "border": "1px solid #e3e6ea",
    "border-radius": "8px",
    "padding": "14px 16px",
    "box-sizing": "border-box",
}
CSS = """
body { background: #f5f6f8; font: 15px/1.5 system-ui, sans-serif; color: #1b1f24; }
"""
HTML_CSS = """
:host { font: 15px/1.5 system-ui, sans-serif; color: #1b1f24; overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; margin: .2rem 0; } h2 { font-size: 1.15rem; margin: 0 0 .3rem; } p { margin: .2rem 0; }
.quiet { color: #5b6168; font-size: .88rem; } .bad { color: #b3261e; font-weight: 600; } .warn { color: #8a5a00; }
.wide { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: .9rem; }
th, td { overflow-wrap: normal; text-align: right; padding: .25rem .5rem; border-bottom: 1px solid #e3e6ea; }
th:first-child, td:first-child { text-align: left; min-width: 8rem; } pre { overflow-x: auto; background: #f3f6fa;
padding: .6rem; border-radius: 6px; font-size: .82rem; white-space: pre; } svg { display: block; max-width: 100%; }
.head { font-weight: 600; font-size: 1.1rem; border-left: 4px solid #1f5fa8; background: #f3f6fa;
padding: .5rem .8rem; }
"""


class Dropped(FileDropper):
    """A place to drop a file on, which takes no more bytes than it should, whatever the browser sends."""

    def _process_event(self, event: Any) -> None:
        name = event.data["name"]
        size = sum(map(len, self._file_buffer.get(name, []))) + len(event.data.get("data") or b"")
        if size > MOST:
            self._file_buffer.pop(name, None)
            return
        super()._process_event(event)


def html(text: str = "", **more: Any) -> pn.pane.HTML:
    """A piece of HTML, as wide as there is room."""
    return pn.pane.HTML(text, sizing_mode="stretch_width", stylesheets=[HTML_CSS], margin=(4, 6), **more)


def card(*parts: Any, **more: Any) -> pn.Column:
    """A part of the page on a white ground."""
    return pn.Column(*parts, sizing_mode="stretch_width", styles=CARD, margin=(6, 0), **more)


def flowing(*parts: Any) -> pn.FlexBox:
    """Parts side by side, or one below the other where there is no room, as on a phone."""
    return pn.FlexBox(*parts, sizing_mode="stretch_width", gap="2px 10px", align_items="end", margin=(0, 4))


def field(kind: type[Any], width: int, **more: Any) -> Any:
    """A widget that is at least so wide [px] and takes its share of what is left."""
    styles = {"flex": f"1 1 {width}px", "min-width": f"min({width}px, 100%)"}
    return kind(sizing_mode="stretch_width", styles=styles, margin=(2, 2), **more)


class Page:
    """The page of one browser tab.

    Parameters
    ----------
    project
        What it shows.
    jobs
        The server's one child process, if there is one, under ``job``: tabs come and go, it stays.
    zone
        The browser's time zone, a first guess of the clock's.
    """

    def __init__(self, project: Project, jobs: dict[str, Job], *, zone: str = "") -> None:
        self.project, self.jobs, self.zone = project, jobs, zone
        self.targets: dict[str, Target] = {one.key: one for one in project.targets()}
        self.look: Look | None = None
        self.rows: dict[str, tuple[Any, Any, Any, Any]] = {}
        self.given: dict[str, Any] = {}
        self.facts: dict[str, Any] = {}
        self.seen: tuple[str, bool] | None = None
        self._build()
        if project.data is not None:
            self._show_measurements()
        self._show_answers()
        self._show_job()

    # ------------------------------------------------------------ what stands where

    def _build(self) -> None:
        name = escape(self.project.described.name)
        head = html(
            f"<h1>Why do model and building differ?</h1><p class='quiet'>Model: {name}. All files stay on this machine,"
            f" in <code>{escape(str(self.project.folder))}</code>.</p>"
        )
        self.drop = Dropped(
            max_file_size=f"{MOST // MIB}MB", sizing_mode="stretch_width", height=70, margin=(4, 6), layout="compact"
        )
        self.drop.param.watch(self._dropped, "value")
        self.beat = html(visible=False)
        self.received = html()
        first = card(
            html(
                f"<h2>1. Measurements</h2><p class='quiet'>One table with a column of times: "
                f"{', '.join(ENDINGS)}, up to {MOST // MIB} MiB.</p>"
            ),
            self.drop,
            self.received,
        )
        self.columns = pn.Column(sizing_mode="stretch_width", margin=0)
        self.needed = flowing()
        self.known = flowing()
        self.replay = pn.widgets.Checkbox(
            name="The logged heater and air flow drive the model, in place of its own controllers",
            value=bool(self.project.settings["replay"]),
            sizing_mode="stretch_width",
            visible=bool(self.project.described.replay),
        )
        self.check = pn.widgets.Button(name="Make the recording", button_type="primary", margin=(8, 6), width=190)
        self.check.on_click(self._checked)
        self.findings = html()
        self.picture = pn.Column(sizing_mode="stretch_width", margin=0)
        self.second = card(
            html("<h2>2. Columns</h2><p class='quiet'>What each column is, and its unit. Correct what is wrong.</p>"),
            self.columns,
            visible=False,
        )
        self.third = card(
            html("<h2>3. Clock, place and what you know of the room</h2>"),
            self.needed,
            html(
                "<p class='quiet'>Leave empty what you do not know. What is known is not estimated, and the estimator"
                " that comes with the package is left out.</p>"
            ),
            self.known,
            self.replay,
            self.check,
            visible=False,
        )
        self.fourth = card(html("<h2>4. Recording</h2>"), self.findings, self.picture, visible=False)
        self.limit = pn.widgets.Select(name="Time that there is", options=LIMITS, width=130, margin=(2, 2))
        self.buttons = {one: self._button(one) for one in STEPS}
        self.stop = pn.widgets.Button(name="Stop", button_type="danger", visible=False, margin=(18, 2), width=90)
        self.stop.on_click(self._stop)
        self.progress = html()
        self.bar = pn.indicators.Progress(active=True, value=-1, sizing_mode="stretch_width", height=8, visible=False)
        self.answers = {one: pn.Column(sizing_mode="stretch_width", margin=0) for one in STEPS}
        row = flowing(*self.buttons.values(), self.stop, self.limit)
        self.fifth = card(
            html(f"<h2>5. Answers</h2><p class='quiet'>{ABOUTS}</p>"),
            row,
            self.bar,
            self.progress,
            *self.answers.values(),
            visible=False,
        )
        self.download = pn.widgets.FileDownload(
            callback=self._report,
            filename="report.html",
            label="Download the report",
            button_type="primary",
            margin=(4, 6),
            embed=False,
            auto=True,
        )
        self.recipe = html()
        self.sixth = card(html("<h2>6. Report and commands</h2>"), self.download, self.recipe, visible=False)
        body = (head, self.beat, first, self.second, self.third, self.fourth, self.fifth, self.sixth)
        self.view = pn.Column(*body, max_width=WIDTH, sizing_mode="stretch_width", styles={"margin": "0 auto"})

    def _button(self, step: str) -> Any:
        made = pn.widgets.Button(name=f"{TITLES[step]}", button_type="primary", margin=(18, 2), width=130)
        made.on_click(lambda _: self._start(step))
        return made

    # ------------------------------------------------------------ measurements and columns

    async def _dropped(self, event: Any) -> None:
        if not event.new:
            return
        name, content = next(reversed(event.new.items()))
        data = content.encode() if isinstance(content, str) else content
        self.received.object = "<p class='quiet'>Reading…</p>"
        self._stop(None)
        try:
            await asyncio.to_thread(self.project.receive, name, data)
        except ZeroshotError as error:
            self.received.object = _bad(error)
            return
        finally:
            self.drop.value = {}
        self._hide(self.second, self.third, self.fourth, self.fifth, self.sixth)
        self._show_measurements()

    def _show_measurements(self) -> None:
        try:
            self.look = self.project.look()
        except ZeroshotError as error:
            self.received.object = _bad(error)
            self._hide(self.second, self.third, self.fourth, self.fifth, self.sixth)
            return
        look = self.look
        assert self.project.data is not None
        self.received.object = (
            f"<p><b>{escape(self.project.data.name)}</b>: {look.rows} rows, usually {look.interval:g} s apart; times in"
            f" {escape(look.time)}; {len(look.columns)} columns</p>"
        )
        self.rows = {}
        used = [self._row(one) for one in look.columns if one.to]
        rest = [self._row(one) for one in look.columns if not one.to]
        more = pn.Card(
            *rest,
            title=f"{len(rest)} columns that are not used",
            collapsed=len(rest) > 6,
            sizing_mode="stretch_width",
            margin=(4, 0),
        )
        self.columns.objects = [*used, *([more] if rest else [])]
        self._ask()
        self._show(self.second, self.third)
        if (report := self.project.imported) is not None:
            self._show_recording(report)

    def _row(self, one: Column) -> Any:
        options = {NOTHING: "", **{target.label: key for key, target in self.targets.items()}}
        options |= {one.to: one.to} if one.to not in options.values() else {}
        to = field(pn.widgets.Select, 190, name="is", options=options, value=one.to)
        units = self._units(one.to, one.unit)
        unit = field(pn.widgets.Select, 90, name="in", options=units, value=one.unit if one.unit in units else units[0])
        reading = field(
            pn.widgets.Select,
            120,
            name="readings are",
            options={"not said": "", **{v: k for k, v in READINGS.items()}},
            value=one.reading,
        )
        said = html(styles={"flex": "1 1 100%"})
        picture = html(
            f"<b>{escape(one.name)}</b>{spark(one)}", styles={"flex": "2 1 220px", "min-width": "min(220px, 100%)"}
        )
        self.rows[one.name] = to, unit, reading, said

        def changed(event: Any) -> None:
            if event.obj is to:
                unit.options = self._units(to.value, unit.value)
                unit.value = unit.value if unit.value in unit.options else unit.options[0]
            self._preview(one)

        for widget in (to, unit, reading):
            widget.param.watch(changed, "value")
        self._preview(one)
        line = flowing(picture, to, unit, reading, said)
        line.styles = {"border-bottom": "1px solid #e3e6ea", "padding": "4px 0"}
        return line

    def _units(self, to: str, unit: str) -> list[str]:
        """Units that a column may have; a dash first where it has to be chosen."""
        if to not in self.targets:
            return [unit or "-"]
        fits = list(self.targets[to].units)
        if unit in fits:
            return fits
        return [unit, *fits] if becomes(unit, self.targets[to].unit) else ["-", *fits]

    def _preview(self, one: Column, found: Sequence[tuple[str, bool]] = ()) -> None:
        to, unit, _, said = self.rows[one.name]
        why = one.why if to.value == one.to else one.looks
        unlike = in_target(replace(one, unit=unit.value), self.targets[to.value].unit) if to.value else ""
        lines = [f"<span class='quiet'>{escape('; '.join(filter(None, [why, unlike])))}</span>"]
        lines += [f"<span class='{'bad' if strong else 'warn'}'>⚠ {escape(text)}</span>" for text, strong in found]
        said.object = "<br>".join(lines)

    def _ask(self) -> None:
        """Fields for the clock, the place, and what is known of the room."""
        assert self.look is not None
        mapped = self.look.mapping
        place, zone = mapped.get("place", {}), mapped["time"].get("zone", "")
        zones = sorted(available_timezones())
        clock = field(
            pn.widgets.AutocompleteInput,
            230,
            name="Clock of the stamps (as Europe/Berlin, or +01:00)",
            options=zones,
            restrict=False,
            min_characters=2,
            case_sensitive=False,
            search_strategy="includes",
            value=self.zone if zone == "?" else str(zone),
        )
        self.given = {"time.zone": clock}
        for name, words in {"latitude": "Latitude (degrees north)", "longitude": "Longitude (degrees east)"}.items():
            value = place.get(name, "?")
            self.given[f"place.{name}"] = field(
                pn.widgets.TextInput,
                150,
                name=words,
                value="" if value == "?" else f"{value:g}",
                placeholder="for the sun, as 52.5",
            )
        for one in self.look.open:
            self.given.setdefault(one, field(pn.widgets.TextInput, 200, name=one))
        self.needed.objects = list(self.given.values())
        kept = self.project.settings["facts"]
        self.facts = {
            one.key: field(
                pn.widgets.TextInput,
                240,
                name=f"{one.label}{f' [{one.unit}]' if one.unit not in ('', '1') else ''}",
                placeholder=one.usual,
                value=f"{kept[one.key]:g}" if one.key in kept else "",
            )
            for one in self.project.facts()
        }
        self.known.objects = list(self.facts.values())

    def guess_clock(self, zone: str) -> None:
        """Take the browser's time zone for the clock's, where nobody has said which it is."""
        self.zone = zone
        clock = self.given.get("time.zone")
        if clock is not None and self.look is not None and "time.zone" in self.look.open and not clock.value:
            clock.value = zone

    # ------------------------------------------------------------ the recording

    async def _checked(self, _: Any) -> None:
        assert self.look is not None
        self._stop(None)
        self._hide(self.fourth, self.fifth, self.sixth)
        self.check.loading = True
        columns = []
        for one in self.look.columns:
            to, unit, reading, _said = self.rows[one.name]
            columns.append(replace(one, to=to.value, unit=unit.value, reading=reading.value))
        given = {where: str(widget.value or "") for where, widget in self.given.items()}
        facts = {key: widget.value for key, widget in self.facts.items()}
        try:
            await asyncio.to_thread(self.project.know, facts, replay=self.replay.value)
            await asyncio.to_thread(self.project.choose, self.look, columns, given)
            report = await asyncio.to_thread(self.project.make_recording)
        except ZeroshotError as error:
            self.findings.object = _bad(error)
            self.picture.objects = []
            self._show(self.fourth)
        else:
            self._show_recording(report)
            self._show_answers()
        finally:
            self.check.loading = False

    def _show_recording(self, report: Any) -> None:
        said = self.project.said_of(report)
        assert self.look is not None
        for one in self.look.columns:
            self._preview(one, said.get(one.name, ()))
        strong = [text for texts in said.values() for text, hard in texts if hard]
        rest = [text for text, hard in said.get("", ()) if not hard]
        stretches = len(report.stretches)
        lines = [
            f"<p>{escape(report.begin)} to {escape(report.end)}, {report.steps} steps of {report.step:g} s, in"
            f" {stretches} stretch{'es' if stretches > 1 else ''} without gaps in inputs</p>",
            *(f"<p class='bad'>Correct this first: {escape(text)}</p>" for text in dict.fromkeys(strong)),
            *(f"<p class='quiet'>{escape(text)}</p>" for text in [*rest, *report.lacking]),
        ]
        self.findings.object = "".join(lines)
        drawn = {one.name: one for one in report.variables if one.readings or one.computed}
        data = read_netcdf(self.project.recording, RecordingError, "a recording", times=True)
        time = data["time"].values
        panels = []
        for name, one in drawn.items():
            values, unit = readable(data[name].values.astype(float), one.unit)
            panels.append((f"{name}: {re.sub(r' [[].*[]]$', '', one.origin)}", unit, time, {"measured": values}))
        self.picture.objects = [figures(panels, height=90)]
        self._show(self.fourth, self.fifth, self.sixth)
        self._recipe()

    # ------------------------------------------------------------ answers

    def _start(self, step: str) -> None:
        job = self.jobs.get("job")
        if job is not None and job.running:
            return
        self.answers[step].objects = []
        self.jobs["job"] = Job(self.project, step, self.limit.value or None)
        self._show_job()

    def _stop(self, _: Any) -> None:
        job = self.jobs.get("job")
        if job is not None and job.running:
            job.stop()
        self._show_job()

    def poll(self) -> None:
        """Look at the child process; called by the browser's session every now and then.

        Panel 1.9 leaves a message lying that was made while another was being written, until there is a next one. The
        beat is the next one, so that no answer stays unseen.
        """
        self.beat.object = "" if self.beat.object else "."
        self._show_job()

    def _show_job(self) -> None:
        job = self.jobs.get("job")
        if job is None:
            return
        running = job.running
        self.bar.visible = self.stop.visible = running
        for button in self.buttons.values():
            button.disabled = running
        name, seconds = TITLES[job.step], f"{job.seconds // 60:.0f}:{job.seconds % 60:02.0f}"
        if running:
            self.progress.object = f"<p><b>{name}</b>, {seconds}: {escape(job.stage)}</p>"
        elif self.seen != (job.step, False) and self.seen is not None:
            said = _bad(job.error) if job.error else ""
            kept = "Stopped; what was simulated is kept, and the same button goes on from there." if job.stopped else ""
            ended = kept if job.stopped else "" if job.error else f"{name}: done in {seconds}."
            self.progress.object = f"{said}<p class='quiet'>{ended}</p>"
            self._show_answers()
        self.seen = job.step, running

    def _show_answers(self) -> None:
        shows: dict[str, Callable[[], list[Any]]] = {
            "calibration": self._calibration,
            "forecast": self._forecast,
            "diagnosis": self._diagnosis,
        }
        for step, show in shows.items():
            done = self.project.done(step)
            self.answers[step].objects = [html(f"<h2>{TITLES[step]}</h2>"), *show()] if done else []
        self.download.disabled = not any(map(self.project.done, STEPS))

    def _calibration(self) -> list[Any]:
        report = read_calibration(self.project.folder / "calibration")
        rows = []
        for one in report.parameters:
            value = f"{number(one.value, 3)}{spaced(one.unit)}"
            interval = f"{number(one.low, 3)} to {number(one.high, 3)}"
            note = "on its bound" if one.at_bound else one.identified
            rows.append([long_named(one.name, one.description), value, interval, f"{one.told:.0%}", note])
        table = _table(["parameter", "value", "90 % interval", "learned", ""], rows)
        orange = " Orange: the estimator's first answer." if report.parameters[0].zero_shot is not None else ""
        note = f"<p class='quiet'>Blue: value and 90 % interval within the range of the description (grey).{orange}</p>"
        return [html(table), intervals(report, self.project.system), html(note), *self._curves("calibration")]

    def _forecast(self) -> list[Any]:
        report = Forecast.model_validate_json((self.project.folder / "forecast" / "forecast.json").read_bytes())
        long = {one.name: one.long_name for one in self.project.system.outputs}
        rows = []
        for name, one in report.outputs.items():
            if one is not None:
                errors = (f"{number(value, 3)}{spaced(one.unit)}" for value in (one.rmse, one.bias))
                rows.append([long_named(name, long), *errors, f"{one.covered:.0%}"])
        table = _table(["output", "RMSE ahead", "bias", "within the 90 % band"], rows)
        days, ahead = report.context_hours / 24, report.ahead_hours / 24
        said = f"<p>{days:.3g} days (grey) tell the parameters; {ahead:.3g} days are forecast.</p>"
        return [html(said + table), *self._curves("forecast", context=report.context_hours)]

    def _diagnosis(self) -> list[Any]:
        report = read_report(self.project.folder / "diagnosis")
        rows = []
        for one in report.foremost:
            size = "" if one.amplitude is None else f"{number(one.amplitude, 3)}{spaced(one.unit)}"
            rows.append([long_named(one.name, one.description), chance(one.probability), size])
        rows += [["none of these", f"{report.none_of_these:.0%}", ""], ["no gap", f"{report.no_gap:.0%}", ""]]
        said = "".join(f"<p>{escape(one)}</p>" for one in report.summary)
        table = _table(["cause", "probability", "size"], rows)
        return [html(f"<p class='head'>{escape(headline(report))}</p>{said}{table}"), *self._curves("diagnosis")]

    def _curves(self, step: str, context: float | None = None) -> list[Any]:
        path = self.project.folder / step / "curves.nc"
        if not path.exists():  # the command made this answer, not the page
            return [html("<p class='quiet'>Its pictures are in its own page.</p>")]
        with xr.open_dataset(path) as file:
            drawn = file.load()
        time = drawn["time"].values
        from_ = None if context is None else time[0] + np.timedelta64(round(context * 3600), "s")
        panels = [(words, unit, time, values) for words, unit, values in shown(drawn)]
        return [figures(panels, fitted_until=from_)]

    def _report(self) -> io.BytesIO:
        return io.BytesIO(combined(self.project).encode())

    def _recipe(self) -> None:
        self.recipe.object = (
            f"<p>The same in a shell:</p><pre>{escape(self.project.commands())}</pre>"
            f"<p>and in Python:</p><pre>{escape(self.project.python())}</pre>"
        )

    def _show(self, *parts: Any) -> None:
        for one in parts:
            one.visible = True

    def _hide(self, *parts: Any) -> None:
        for one in parts:
            one.visible = False


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as HTML, which scrolls by itself where there is no room."""
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    return f"<div class='wide'><table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table></div>"


def _bad(error: object) -> str:
    return "".join(f"<p class='bad'>{escape(line)}</p>" for line in str(error).splitlines())
