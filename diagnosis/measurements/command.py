"""The command ``diagnosis import``."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shared.console import OK, Place, new_console
from shared.errors import RecordingError


def import_(
    mapping: Path | None = None,
    data: Path | None = None,
    *more: Path,
    out: Place | None = None,
    draft: Path | None = None,
    system: Path | None = None,
    ahead: Annotated[bool, Parameter(negative=())] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Turn a file of measurements into a recording, say what was understood and what not, and draw it.

    Begin with `diagnosis import --draft log.csv`, which writes a mapping with what its columns seem to be. Correct it,
    fill in what it asks for, then `diagnosis import mapping.toml log.csv --out recording.nc`.

    Parameters
    ----------
    mapping
        Column mapping (TOML): which column is which variable, in which unit; the clock; the place.
    data
        The measurements (CSV, Excel, Parquet or NetCDF).
    more
        Further mappings and measurements in turn, such as those of a weather station.
    out
        The recording to write (NetCDF); a picture of it is written next to it. Of a draft the mapping, `mapping.toml`
        if not given.
    draft
        Measurements of which to draft a mapping, instead of importing.
    system
        System description (TOML); by default the one that the mapping names.
    ahead
        Keep the inputs after the last reading of an output, as of a weather forecast: for `diagnosis forecast`.
    as_json
        Print the report as JSON.
    """
    if draft is not None:
        if mapping is not None or ahead:
            raise RecordingError("--draft is given with a mapping or --ahead; expected --draft and a file alone")
        return _draft(draft, system, out or Path("mapping.toml"), as_json)
    if mapping is None or data is None or out is None:
        raise RecordingError(
            "mapping, measurements or --out is missing; expected import mapping.toml log.csv --out recording.nc, or"
            " import --draft log.csv, which writes a mapping"
        )
    from diagnosis.measurements.importer import import_recording
    from diagnosis.measurements.output import print_report

    report = import_recording(mapping, data, *more, out=out, system=system, ahead=ahead)
    if as_json:
        sys.stdout.write(report.model_dump_json(indent=1) + "\n")
    else:
        print_report(report, new_console())
    return OK


def _draft(data: Path, system: Path | None, out: Path, as_json: bool) -> int:
    import json
    from dataclasses import asdict

    from rich.table import Table

    from diagnosis.measurements.draft import draft_mapping

    draft = draft_mapping(data, system, out=out)
    if as_json:
        about = {"mapping": str(draft.path), "columns": [asdict(one) for one in draft.guesses]}
        sys.stdout.write(json.dumps({**about, "to_fill_in": draft.to_fill_in}, indent=1, ensure_ascii=False) + "\n")
        return OK
    console = new_console()
    table = Table("column", "taken for", "unit", "why", box=None)
    for one in draft.guesses:
        table.add_row(one.column, one.to or "-", one.unit or "-", one.why)
    console.print(table)
    console.print(f"{draft.path}: read the reasons in it, and correct what is wrong")
    if draft.to_fill_in:
        console.print(f"fill in {', '.join(draft.to_fill_in)}")
    then = shlex.join(["diagnosis", "import", f"{draft.path}", f"{data}", "--out", "recording.nc"])
    console.print(f"then: {then}", soft_wrap=True)
    return OK
