"""One progress bar for all long work, and the line that takes its place where nobody sees a bar."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.status import Status

from shared.console import errors
from shared.logs import fields, logger

EVERY = 30.0
"""Seconds between two records of how far the work is."""

_log = logger(__name__)
_Item = TypeVar("_Item")


class Bar:
    """How far some work is: a bar if it is shown, and a record now and then in any case."""

    def __init__(self, progress: Progress, task: TaskID, title: str, level: int) -> None:
        self._progress, self._task, self._level = progress, task, level
        self._title, self._note = title, ""
        self._said = time.monotonic()

    def update(
        self,
        done: float | None = None,
        *,
        total: float | None = None,
        title: str | None = None,
        note: str | None = None,
        count: str | None = None,
    ) -> None:
        """Say what has changed; ``note`` is a figure beside the bar, and ``count`` is in place of "done of total"."""
        self._title, self._note = title or self._title, note if note is not None else self._note
        task = self._progress.tasks[self._task]
        total = task.total if total is None else total
        done = task.completed if done is None else done
        if count is None:
            count = f"{done:g}" if total is None else f"{done:g} of {total:g}"
        self._progress.update(
            self._task, description=self._title, completed=done, total=total, note=self._note, count=count
        )
        if time.monotonic() - self._said > EVERY:
            self._said = time.monotonic()
            text = ", ".join(filter(None, [f"{self._title}: {count}", self._note]))
            _log.log(self._level, text, extra=fields(done=done, total=total))


@contextmanager
def progress_bar(title: str, total: float | None = None, *, done: float = 0, shown: bool = True) -> Iterator[Bar]:
    """A progress bar on standard error; yields what is to be told of the progress.

    Of ``total``, None if that is not known yet, so much was ``done`` before. A bar that is ``shown`` needs a terminal;
    without one a line takes its place every half minute.
    """
    visible = shown and errors.is_terminal
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=errors, disable=not visible) as shown_bar:
        task = shown_bar.add_task(title, total=total, note="", count="")
        bar = Bar(shown_bar, task, title, logging.INFO if shown and not visible else logging.DEBUG)
        bar.update(done)
        yield bar


def tracked(items: Sequence[_Item], title: str, *, shown: bool = True) -> Iterator[_Item]:
    """Some items one after another, with a progress bar."""
    with progress_bar(title, len(items), shown=shown) as bar:
        for count, item in enumerate(items, start=1):
            yield item
            bar.update(count)


class _Beside(logging.Handler):
    """Shows beside a spinner what is logged at level ``info``, which is then no line above it."""

    def __init__(self, status: Status) -> None:
        super().__init__(logging.INFO)
        self._status = status

    def emit(self, record: logging.LogRecord) -> None:
        """Show it."""
        if record.levelno == logging.INFO:
            self._status.update(record.getMessage())
            record.levelno, record.levelname = logging.DEBUG, "DEBUG"


@contextmanager
def stages(package: str, first: str, *, shown: bool = True) -> Iterator[None]:
    """What some work is at, as its package logs it: beside a spinner, or as lines without a terminal."""
    log = logger(package)
    if not (shown and errors.is_terminal):
        log.info("%s", first)
        yield
        return
    with errors.status(first, spinner="dots") as status:
        beside = _Beside(status)
        log.addHandler(beside)
        try:
            yield
        finally:
            log.removeHandler(beside)
