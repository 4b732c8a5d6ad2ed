"""Diagnose one recording of a blind set: a verdict or a failure, and the verdicts without single candidates."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from diagnosis.blind.judging import Judge, Judged, program
from diagnosis.blind.verdicts import (
    VERDICTS,
    WITHOUT,
    Outcome,
    Verdict,
    Withheld,
    name_of,
    read_outcome,
    write_outcome,
    write_withheld,
)
from shared.errors import RecordingError
from shared.reading import read_json, validated
from shared.store import write_atomically

CHANCE = 0.01
"""Leave-one-out withholds candidates that were named, fitted in the end or given this probability: without another one,
the verdict is taken to be the same."""


@dataclass(frozen=True)
class Job:
    """One recording, and what of it is still to be done."""

    judge: Judge
    folder: Path
    results: Path
    listed: dict[str, Any]
    leave_one_out: bool


def work(job: Job) -> None:
    """Diagnose one recording and write what was said; a diagnosis that fails is an outcome too."""
    file = job.listed["file"]
    path = job.folder / file
    judged = cache(lambda: job.judge(path, replay=job.listed["replay"], occupancy=job.listed["occupancy"]))
    if (job.results / VERDICTS / name_of(file)).exists():
        first = read_outcome(job.results, file)
    else:
        first = _outcome(job.listed, lambda: judged().verdict)
        write_outcome(job.results, first)
    if job.leave_one_out:
        _end_withheld(job, _left_out(job, judged, first))


def _left_out(job: Job, judged: Callable[[], Judged], first: Outcome) -> dict[str, Outcome]:
    """Outcomes without each candidate that had a chance; each is written when it is reached."""
    if first.verdict is None:
        return {}
    found = _reached(job)
    for name in contenders(first.verdict):
        if name not in found:
            found[name] = _outcome(job.listed, lambda name=name: judged().without(name))  # type: ignore[misc]
            _write_reached(job, found)
    return found


def _reached_at(job: Job) -> Path:
    return (job.results / WITHOUT / name_of(job.listed["file"])).with_suffix(".part")


def _reached(job: Job) -> dict[str, Outcome]:
    """Outcomes of a recording whose diagnosis was stopped; a ``RecordingError`` names a file that holds none."""
    path, expected = _reached_at(job), "what `diagnosis blind run` reached of a recording"
    if not path.exists():
        return {}
    return validated(Withheld, read_json(path, RecordingError, expected), f"{path}", RecordingError, expected).outcomes


def _write_reached(job: Job, outcomes: dict[str, Outcome]) -> None:
    """Not where whole ones are: candidates that are not in those count as given no chance."""
    path = _reached_at(job)
    path.parent.mkdir(parents=True, exist_ok=True)
    made = Withheld(file=job.listed["file"], outcomes=outcomes).model_dump(mode="json")
    write_atomically(path, json.dumps(made, allow_nan=False).encode())


def _end_withheld(job: Job, outcomes: dict[str, Outcome]) -> None:
    write_withheld(job.results, Withheld(file=job.listed["file"], outcomes=outcomes))
    _reached_at(job).unlink(missing_ok=True)


def contenders(verdict: Verdict) -> list[str]:
    """Candidates on which a verdict rested: none where there was no gap."""
    if verdict.verdict == "no_gap":
        return []
    rested = {*verdict.named, *verdict.chosen}
    return [name for name, p in verdict.pointed.items() if p >= CHANCE or name in rested]


def _outcome(listed: dict[str, Any], judge: Callable[[], Verdict]) -> Outcome:
    began, used = time.perf_counter(), time.process_time()
    verdict, failure = None, ""
    try:
        verdict = judge()
    except Exception as error:  # whatever goes wrong, a recording without a verdict is a wrong answer, not a lost one
        failure = f"{type(error).__name__}: {error}"
    return Outcome(
        file=listed["file"],
        sha256=listed["sha256"],
        seconds=time.perf_counter() - began,
        cpu_seconds=time.process_time() - used,
        verdict=verdict,
        failure=failure,
        program=program(),
    )


def lost(job: Job, seconds: float, why: str) -> None:
    """Write down a failure for what a process that has ended did not write."""
    file = job.listed["file"]
    failed = Outcome(file=file, sha256=job.listed["sha256"], seconds=seconds, failure=why, program=program())
    if not (job.results / VERDICTS / name_of(file)).exists():
        write_outcome(job.results, failed)
    if job.leave_one_out and not (job.results / WITHOUT / name_of(file)).exists():
        first = read_outcome(job.results, file).verdict
        names = [] if first is None else contenders(first)
        _end_withheld(job, dict.fromkeys(names, failed) | _reached(job))
