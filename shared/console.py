"""What the three command lines have in common: how they start, and how they end when something is wrong."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import cyclopts
from rich.console import Console

from shared import __version__
from shared.errors import ZeroshotError

OK, FAULT, USAGE = 0, 1, 2
"""Exit codes: done; a sentence on standard error says what is wrong; the command line itself is wrong."""

_PIPED_WIDTH = 120
"""Columns of text that goes into a file or a pipe, where nobody has a window to ask."""


def new_console() -> Console:
    """A console for results on standard output."""
    console = Console(highlight=False)
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
        result_action="return_value",
        exit_on_error=False,
        print_error=True,
        suppress_keyboard_interrupt=False,
    )


def start(app: cyclopts.App, arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code.

    A command may return an exit code of its own. Only our own bugs show a traceback.
    """
    try:
        code = app(list(arguments) if arguments is not None else sys.argv[1:])
    except cyclopts.CycloptsError:
        return USAGE
    except ZeroshotError as error:
        errors.print(f"error: {error}", markup=False)
        return FAULT
    except BrokenPipeError:
        # the reader of a pipe went away; keep the interpreter from complaining about it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        errors.print("stopped; what was finished is kept, the same command goes on from there")
        return 130
    return code if isinstance(code, int) else OK
