"""The commands for datasets that are there: ``datagen info``, ``verify``, ``copy`` and ``merge``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from shared.console import FAULT, OK, Place, new_console, resumable
from shared.errors import DatasetError
from shared.logs import USUAL, Reporting

console = new_console()


def info(folder: Path, *, as_json: Annotated[bool, Parameter(name="--json", negative=())] = False) -> int:
    """Say what a dataset holds.

    Parameters
    ----------
    folder
        Dataset folder or URL.
    as_json
        Print JSON.
    """
    from datagen import info as info_

    found = vars(info_(folder))
    if as_json:
        sys.stdout.write(json.dumps(found, indent=1, allow_nan=False) + "\n")
        return OK
    table = Table(box=None, show_header=False)
    for name, value in found.items():
        text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        table.add_row(name, text)
    console.print(table)
    return OK


def verify(
    folder: Path,
    *,
    repair: Annotated[bool, Parameter(negative=())] = False,
    system: Path | None = None,
    timeout: float | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    report: Reporting = USUAL,
) -> int:
    """Check every shard of a dataset against its manifest. Exit code 1 if anything is wrong.

    Parameters
    ----------
    folder
        Dataset folder or URL.
    repair
        Simulate damaged and missing shards again; they must get the hashes of the manifest.
    system
        System description for a repair, if the dataset was not made on this machine.
    timeout
        Seconds that one system of a repair may take before it counts as failed; 600 by default.
    as_json
        Print JSON.
    """
    from datagen import repair as repair_
    from datagen import verify as verify_

    for name, value in (("system", system), ("timeout", timeout)):
        if value is not None and not repair:
            raise DatasetError(f"--{name} is given without --repair; expected both, or neither")
    allowed: dict[str, Any] = {} if timeout is None else {"timeout": timeout}
    mended = repair_(folder, system, quiet=report.quiet, **allowed) if repair else []
    faults = verify_(folder, quiet=report.quiet)
    if as_json:
        found = {"folder": str(folder), "ok": not faults, "faults": faults, **({"repaired": mended} if repair else {})}
        sys.stdout.write(json.dumps(found, indent=1, allow_nan=False) + "\n")
    else:
        for file in mended:
            console.print(f"{file}: simulated again", markup=False)
        console.print("\n".join(faults) if faults else f"{folder}: every shard is as the manifest says", markup=False)
    return FAULT if faults else OK


@resumable()
def copy(source: str, target: str, /, *, report: Reporting = USUAL) -> int:
    """Copy a dataset from or to another machine, and verify every shard by its sha256.

    Both places are folders or URLs: `https://`, `s3://` and what else fsspec reaches (`pip install
    'zeroshot-fmu[remote]'`). A copy that was interrupted goes on, and shards that are there already stay. The target
    is a dataset once all shards are there.

    Parameters
    ----------
    source
        Folder or URL of the dataset.
    target
        Folder or URL to copy it to.
    """
    from datagen import copy as copy_

    console.print(copy_(source, target, quiet=report.quiet).headline, markup=False)
    return OK


def merge(folders: Annotated[list[Path], Parameter(consume_multiple=True, negative=())], /, *, out: Place) -> int:
    """Join datasets of one system, made from different root seeds, into a new one.

    Parameters
    ----------
    folders
        Dataset folders or URLs, at least two.
    out
        Folder of the joint dataset; new, or empty.
    """
    from datagen import merge as merge_

    manifest = merge_(folders, out)
    console.print(f"{len(manifest.done())} systems in {out}", markup=False)
    return OK
