"""Benchmarks over many recordings: one line of JSON for each case that is done, so that a long run can be gone on with.

Nothing is timed across cases that run side by side: what a case measures is its own processor time.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from diagnosis.blind.running import program
from shared.store import sha256_of
from shared.system import load_system
from trainer import load_run

NICE = 15
"""A benchmark of an hour leaves the machine to others."""


def resumed(
    out: Path,
    cases: Sequence[dict[str, Any]],
    make: Callable[[dict[str, Any]], dict[str, Any]],
    *,
    of: dict[str, str],
    workers: int = 1,
) -> list[dict[str, Any]]:
    """What ``make`` gives for each case, in order; cases whose line is in ``out`` already are not made again.

    A case and what is made of it are dictionaries of JSON values; ``make`` must be known by its module's name. ``of``,
    from :func:`depends`, says by what: a case that another program made, or one that failed, is made again.
    """
    lines = [one for one in _lines(out) if one.get("of") == of and "error" not in one["made"]]
    done = {_key(one["case"]): one["made"] for one in lines}
    left = [one for one in cases if _key(one) not in done]
    out.parent.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_gently) as pool, out.open("a") as file:
        for count, (case, made) in enumerate(zip(left, pool.map(make, left), strict=True), 1):
            done[_key(case)] = made
            file.write(json.dumps({"case": case, "of": of, "made": made}) + "\n")
            file.flush()
            print(f"{count} of {len(left)} ({time.perf_counter() - began:.0f} s): {_key(case)}", flush=True)
    return [done[_key(one)] for one in cases]


def depends(system: Path | str, *, run: Path | str | None = None, files: Sequence[Path] = ()) -> dict[str, str]:
    """Hashes of all that a case is made by: the program, system and FMU, an estimator's weights, and files by name."""
    described = load_system(system)
    found = {"program": program(), "system": described.hash(), "fmu": sha256_of(described.fmu_path)}
    if run is not None:
        found["run"] = load_run(run).card.weights_sha256 or ""
    return found | {str(one): sha256_of(one) for one in files}


def _lines(path: Path) -> list[dict[str, Any]]:
    """Whole lines of a file; the last one may have been cut off."""
    found = []
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found


def _key(case: dict[str, Any]) -> str:
    return json.dumps(case, sort_keys=True)


def _gently() -> None:
    os.nice(max(NICE - os.nice(0), 0))
