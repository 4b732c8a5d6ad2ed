"""The command ``datagen describe``."""

from __future__ import annotations

import sys
from pathlib import Path

from shared.console import OK, new_console

console = new_console()


def describe(fmu: Path, *, out: Path | None = None) -> int:
    """Say what an FMU is and draft the system description that the other commands need.

    Parameters
    ----------
    fmu
        An FMU (.fmu) of FMI 2.0 or 3.0.
    out
        The description to write (TOML, a new file); printed if not given.
    """
    from datagen.fmi.describe import describe as describe_

    found = describe_(fmu, out=out)
    for sentence in found.sentences():
        console.print(sentence, markup=False)
    if out is None:
        sys.stdout.write(found.toml)
    else:
        then = f"datagen simulate {out} --out one.nc --hours 24" if found.drafted else "the tables that it lacks"
        console.print(f"written to {out}; next: {then}", markup=False)
    return OK
