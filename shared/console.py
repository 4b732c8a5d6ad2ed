"""What the three command lines have in common: how they start, and how they end when something is wrong."""

from __future__ import annotations

import errno
import io
import os
import platform
import shlex
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

import cyclopts
from rich.console import Console
from rich.table import Table

from shared import __version__
from shared.errors import IncompleteError, ZeroshotError
from shared.interrupts import Terminated, terminable
from shared.logs import USUAL, Reporting, fields, logger, reported
from shared.places import give_matplotlib_a_place, is_url, no_text
from shared.watchdog import PATIENT, Patience, armed, leave

OK, FAULT, USAGE, PARTLY, STOPPED, ENDED = 0, 1, 2, 3, 130, 143
"""Exit codes: done; a sentence on standard error says what is wrong; the command line itself is wrong; done but for a
part that failed and is listed; stopped by Ctrl-C; stopped by SIGTERM."""

_EPILOGUE = (
    "Exit codes: 0 done, 1 something that the message tells how to mend, 2 wrong usage, 3 done but for a part that"
    " failed and is listed, 130 or 143 stopped."
)
_PIPED_WIDTH = 120
"""Columns of text that goes into a file or a pipe, where nobody has a window to ask."""
_HOST = {
    *(errno.EACCES, errno.EPERM, errno.EROFS, errno.EEXIST, errno.EISDIR, errno.ENOTDIR, errno.ENAMETOOLONG),
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE),
}
"""Errors of the operating system that are the host's or the user's to mend, wherever in the work they come."""
_OURS = ("shared", "datagen", "trainer", "diagnosis", "fmus")
NotNegative = Annotated[int, cyclopts.Parameter(validator=cyclopts.validators.Number(gte=0))]
"""Of an option: a seed or an index; numpy's generators take no negative one."""
Positive = Annotated[int, cyclopts.Parameter(validator=cyclopts.validators.Number(gte=1))]
"""Of an option: how many."""


def _named(_: Any, tokens: Sequence[Any]) -> Path:
    if not tokens[0].value.strip():  # a shell's variable that is not set would be the folder that one happens to be in
        raise ValueError("it is empty; expected a path")
    if is_url(tokens[0].value):
        raise ValueError(
            "it is a URL; expected a folder or file on this machine (`datagen copy` brings a dataset there)"
        )
    return Path(tokens[0].value)


Place = Annotated[Path, cyclopts.Parameter(converter=_named)]
"""Of an option: where something is to be written."""
_Command = TypeVar("_Command", bound=Callable[..., Any])
_resumable: dict[Callable[..., Any], tuple[tuple[str, ...], tuple[str, ...]]] = {}
_log = logger(__name__)


class _Console(Console):
    """A console that folds what is too long for its column of a table: rich would cut it short."""

    def print(self, *objects: Any, **options: Any) -> None:
        for table in objects:
            if isinstance(table, Table):
                for column in table.columns:
                    column.overflow = "fold"
        super().print(*objects, **options)


def new_console() -> Console:
    """A console for results on standard output, which prints text as it stands.

    Users name what they like, and units stand in brackets: rich would take `[degC]` for a style and leave it out.
    """
    console = _Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = max(console.width, _PIPED_WIDTH)
    return console


errors = Console(stderr=True, highlight=False, soft_wrap=True)


def new_app(name: str, help_text: str) -> cyclopts.App:
    """An application with the habits of all of ours."""
    return cyclopts.App(
        name=name,
        help=help_text,
        version=__version__,
        help_format="markdown",
        help_epilogue=_EPILOGUE,
        result_action="return_value",
        exit_on_error=False,
        print_error=True,
        suppress_keyboard_interrupt=False,
    )


def resumable(*more: str, instead_of: Sequence[str] = ()) -> Callable[[_Command], _Command]:
    """Mark a command that goes on where it was stopped, if it is given again.

    It takes the options ``more`` for that, which do not go together with those in ``instead_of``.
    """

    def mark(command: _Command) -> _Command:
        _resumable[command] = more, tuple(instead_of)
        return command

    return mark


def start(app: cyclopts.App, arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code.

    A command may return an exit code of its own. Only our own bugs show a traceback.
    """
    words = list(arguments) if arguments is not None else sys.argv[1:]
    give_matplotlib_a_place()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a path or a unit that the terminal's encoding lacks ends nothing
            stream.reconfigure(errors="backslashreplace")
    for word in (*words, os.getcwd()):
        if said := no_text(word):
            errors.print(f"error: {said}", markup=False)
            return FAULT
    try:
        command, bound, _ = app.parse_args(words)
    except cyclopts.CycloptsError:
        return USAGE
    given = list(bound.arguments.values())
    options = next((value for value in given if isinstance(value, Reporting)), USUAL)
    patience = next((value for value in given if isinstance(value, Patience)), PATIENT)
    call = partial(command, *bound.args, **bound.kwargs)
    try:
        with reported(options, errors):
            return _carry_out(app.name[0], words, command, call, patience.timeout)
    except ZeroshotError as error:  # no log can be written
        errors.print(f"error: {error}", markup=False)
        return FAULT


def _carry_out(
    program: str, words: list[str], command: Callable[..., Any], call: Callable[[], Any], timeout: float
) -> int:
    began, code = time.monotonic(), FAULT
    about = {"version": __version__, "python": platform.python_version(), "pid": os.getpid(), "folder": os.getcwd()}
    _log.debug("%s", shlex.join([program, *words]), extra=fields(**about))

    def end(what: str, number: int | None, seconds: float) -> NoReturn:
        """From another thread: the main one is in compiled code that does not return."""
        ended = FAULT if number is None else ENDED if number == signal.SIGTERM else STOPPED
        errors.show_cursor(True)
        if number is None:
            _log.error(
                "%s: one of its functions had not returned after %g s, and takes this command with it; expected one"
                " that returns: give it longer with --timeout, or look at its inputs and parameters",
                *(what, seconds),
            )
        else:
            _log.warning("%s", _how_to_go_on(program, words, command))
        _log.debug("exit code %d: %s did not return", ended, what, extra=fields(code=ended))
        leave(ended)

    try:
        with terminable(), armed(end, timeout):
            found = call()
        code = found if isinstance(found, int) else OK
    except IncompleteError as error:
        _log.error("%s", error)
        code = PARTLY
    except ZeroshotError as error:
        _log.error("%s", error)
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if missing in ("", *_OURS):
            _log.critical("a bug of ours", exc_info=True)
            raise
        _log.error(
            "%s needs %s, which is not installed; what it needs comes with: pip install 'zeroshot-fmu[%s]'",
            *(program, missing, program),
        )
    except BrokenPipeError:
        # the reader of a pipe went away; keep the interpreter from complaining about it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = OK
    except KeyboardInterrupt as interrupt:
        _log.warning("%s", _how_to_go_on(program, words, command))
        code = ENDED if isinstance(interrupt, Terminated) else STOPPED
    except OSError as error:
        if error.errno not in _HOST:
            _log.critical("a bug of ours", exc_info=True)
            raise
        _log.error("%s: cannot be read or written: %s", error.filename or "a file", error.strerror)
    except BaseException:
        _log.critical("a bug of ours", exc_info=True)
        raise
    finally:
        seconds = time.monotonic() - began
        _log.debug("exit code %d after %.1f s", code, seconds, extra=fields(code=code, seconds=round(seconds, 3)))
    return code


def _how_to_go_on(program: str, words: list[str], command: Callable[..., Any]) -> str:
    if command not in _resumable:
        return "stopped before its end; the same command starts from the beginning"
    more, instead_of = _resumable[command]
    kept = [word for word in words if word not in instead_of]
    again = shlex.join([program, *kept, *(word for word in more if word not in kept)])
    return f"stopped; finished work is kept, and this command continues it:\n  {again}"
