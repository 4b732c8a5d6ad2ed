"""The command ``diagnosis import``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shared.console import OK, Place, new_console


def import_(
    mapping: Path,
    data: Path,
    *,
    out: Place,
    system: Path | None = None,
    ahead: Annotated[bool, Parameter(negative=())] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Turn a CSV of measurements into a recording, say what was understood and what not, and draw it.

    Parameters
    ----------
    mapping
        Column mapping (TOML): which column is which variable, in which unit; the clock; the place.
    data
        The measurements (CSV).
    out
        The recording to write (NetCDF); a picture of it is written next to it.
    system
        System description (TOML); by default the one that the mapping names.
    ahead
        Keep the inputs after the last reading of an output, as of a weather forecast: for `diagnosis forecast`.
    as_json
        Print the report as JSON.
    """
    from diagnosis.measurements.importer import import_recording
    from diagnosis.measurements.output import print_report

    report = import_recording(mapping, data, out=out, system=system, ahead=ahead)
    if as_json:
        sys.stdout.write(report.model_dump_json(indent=1) + "\n")
    else:
        print_report(report, new_console())
    return OK
