"""What a run says while it works: sentences on standard error, and all of it as JSON lines in a file.

The packages log through :func:`logger`, with figures in :func:`fields`. A command line hears them in :func:`reported`;
in a program of your own they go where its handlers for the logger ``zeroshot`` send them, as with any library.

Levels: ``debug`` for each step of a long run, ``info`` for what a person at the terminal wants to know, ``warning`` for
what may need a look, ``error`` for what ended the run.
"""

from __future__ import annotations

import json
import logging
import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, TextIO

from cyclopts import Group, Parameter
from cyclopts.validators import MutuallyExclusive
from rich.console import Console

from shared.errors import ZeroshotError

_ROOT = "zeroshot"
_PANEL = Group("Reporting")
_ONE_OF_THEM = Group(show=False, validator=MutuallyExclusive())


@Parameter(name="*")
@dataclass(frozen=True)
class Reporting:
    """How much a long-running command says, and where; every one of them has these options."""

    quiet: Annotated[
        bool, Parameter(negative=(), group=(_PANEL, _ONE_OF_THEM), help="Only warnings and errors; no progress bar.")
    ] = False
    verbose: Annotated[
        bool, Parameter(negative=(), group=(_PANEL, _ONE_OF_THEM), help="Every step, as a line on standard error.")
    ] = False
    log: Annotated[
        Path | None, Parameter(group=_PANEL, help="Append every step to this file, one JSON object a line.")
    ] = None

    @property
    def level(self) -> int:
        """The lowest level that goes to standard error."""
        return logging.WARNING if self.quiet else logging.DEBUG if self.verbose else logging.INFO


USUAL = Reporting()
"""Sentences and a progress bar, no file."""


def logger(module: str) -> logging.Logger:
    """The logger of a module of ours, given its ``__name__``."""
    return logging.getLogger(f"{_ROOT}.{module}")


def fields(**values: Any) -> dict[str, Any]:
    """Figures of a record, for ``extra``: they are keys of its JSON line."""
    return {"fields": values}


def log_files() -> list[Path]:
    """The files that ``--log`` has named, open now: they are no part of what a command finds in a folder."""
    handlers = logging.getLogger(_ROOT).handlers
    return [Path(one.baseFilename).resolve() for one in handlers if isinstance(one, logging.FileHandler)]


def heard() -> bool:
    """Whether a command shows sentences of level ``info`` on a console."""
    handlers = logging.getLogger(_ROOT).handlers
    return any(isinstance(one, _Sentences) and one.level <= logging.INFO for one in handlers)


class JsonLines(logging.Formatter):
    """A record as one line of JSON: time (UTC), level, logger, message, its fields, and a traceback if there is one.

    What is not a finite number is null: JSON has no other word for it.
    """

    def format(self, record: logging.LogRecord) -> str:
        """The line, without its end."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name.removeprefix(f"{_ROOT}."),
            "message": record.getMessage(),
            **getattr(record, "fields", {}),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(_finite(line), default=str)


def _finite(value: Any) -> Any:
    """The same with None in place of numbers that JSON does not know."""
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    if isinstance(value, Real) and not isinstance(value, Integral):  # a large whole number is no float
        return value if math.isfinite(value) else None
    return value


class _Sentences(logging.Handler):
    """Records as sentences on a console, above its progress bar; a traceback is left to Python, which prints it."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self.console = console

    def emit(self, record: logging.LogRecord) -> None:
        """Print it."""
        if record.exc_info is None:
            before = f"{record.levelname.lower()}: " if record.levelno >= logging.WARNING else ""
            self.console.print(before + record.getMessage(), markup=False)


def _logged_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Log a warning of Python's in place of printing it."""
    logger(__name__).debug("%s:%d: %s: %s", filename, lineno, category.__name__, message)


@contextmanager
def reported(options: Reporting, console: Console) -> Iterator[None]:
    """Hear what the packages log, as the options say.

    Warnings of numpy and other libraries are records at level ``debug``: no user can mend an overflow in a matrix.
    Raises ZeroshotError if the log file cannot be written.
    """
    said = _Sentences(console)
    said.setLevel(options.level)
    handlers: list[logging.Handler] = [said]
    if options.log is not None:
        try:
            written = logging.FileHandler(options.log, encoding="utf-8")
        except OSError as error:
            raise ZeroshotError(
                f"{options.log}: no log can be written there: {error.strerror or error}; expected a file in a folder"
                " that is there"
            ) from None
        written.setFormatter(JsonLines())
        handlers.append(written)
    ours = logging.getLogger(_ROOT)
    before = ours.level, ours.propagate
    ours.setLevel(logging.DEBUG)
    ours.propagate = False
    for handler in handlers:
        ours.addHandler(handler)
    shown = warnings.showwarning
    warnings.showwarning = _logged_warning
    try:
        yield
    finally:
        warnings.showwarning = shown
        for handler in handlers:
            ours.removeHandler(handler)
            handler.close()
        ours.level, ours.propagate = before
        ours.setLevel(before[0])
