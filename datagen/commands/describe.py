"""The command ``datagen describe``."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shared.console import OK, new_console

console = new_console()


def describe(
    fmu: Path,
    *,
    out: Path | None = None,
    parameters: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
) -> int:
    """Say what an FMU is and draft the system description that the other commands need.

    Parameters
    ----------
    fmu
        An FMU (.fmu) of FMI 2.0 or 3.0.
    out
        The description to write (TOML, a new file); printed if not given.
    parameters
        Names of those that are to be estimated. Without them all are candidates of the draft.
    """
    from datagen.fmi.describe import describe as describe_

    found = describe_(fmu, out=out, parameters=parameters)
    for sentence in found.sentences():
        console.print(sentence, markup=False)
    if out is None:
        sys.stdout.write(found.toml)
    else:
        then = (
            f"datagen simulate {shlex.quote(str(out))} --out one.nc --hours 24"
            if found.drafted
            else "the tables that it lacks"
        )
        console.print(f"written to {out}; next: {then}", markup=False)
    return OK
