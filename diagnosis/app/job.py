"""A long step in a child process: it says what it is at, and can be stopped at any moment.

The child runs ``python -m diagnosis.app.job FOLDER STEP SYSTEM``: the public function of the step, as a notebook would
call it, and beside its answer ``curves.nc`` for pictures that zoom. What it has simulated when it is stopped is kept
(:mod:`diagnosis.fitting.simulations`), so that the same step goes on from there.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil

from diagnosis.app.project import STEPS, Project
from shared.children import command, environment
from shared.errors import EstimatorError, RecordingError, ZeroshotError
from shared.logs import logger
from shared.places import give_matplotlib_a_place

PATIENCE = 1.0
"""Seconds that a child has to end in order when it is stopped; then it is killed."""
LOG = "job.log"
"""What the child writes on standard error, in the project's folder."""


class Job:
    """One step at work, or what has become of it.

    Parameters
    ----------
    project, step
        What is made, and of what: see :data:`diagnosis.app.project.STEPS`.
    minutes
        Time that there is; no limit if None.

    Attributes
    ----------
    stage
        What it is at, in words.
    error
        The sentence with which it failed; empty if it did not.
    stopped
        Whether somebody stopped it.
    """

    def __init__(self, project: Project, step: str, minutes: float | None = None) -> None:
        project.begin(step, minutes)
        folder, system = project.folder, project.reference
        self.step, self.stage, self.error, self.stopped = step, "starting", "", False
        self._began, self._seconds = time.monotonic(), 0.0
        self._log = folder / LOG
        words = command("diagnosis.app.job", str(folder), step, system)
        single = {"OMP_NUM_THREADS": "1", **environment()}  # small problems: a second thread costs more than it brings
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                words, cwd=folder, env=single, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log
            )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                said = json.loads(line)
            except ValueError:  # a library that prints
                continue
            if isinstance(said, dict):
                self.stage, self.error = said.get("stage", self.stage), said.get("error", self.error)
        code = self._process.wait()
        self._seconds = time.monotonic() - self._began
        if code and not self.error and not self.stopped:
            self.error = f"the process ended with exit code {code}; the cause stands at the end of {self._log}"

    @property
    def running(self) -> bool:
        """Whether it is still at work."""
        return self._reader.is_alive()

    @property
    def seconds(self) -> float:
        """How long it has been at work [s]."""
        return time.monotonic() - self._began if self.running else self._seconds

    def stop(self) -> None:
        """End it and all that works for it, within :data:`PATIENCE` and a moment."""
        self.stopped = True
        try:
            family = [self._process, *psutil.Process(self._process.pid).children(recursive=True)]
        except psutil.NoSuchProcess:
            family = []
        for one in family:
            try:
                one.terminate()
            except (psutil.NoSuchProcess, OSError):
                continue
        end = time.monotonic() + PATIENCE
        while family and self._process.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        for one in family:
            try:
                one.kill()
            except (psutil.NoSuchProcess, OSError):
                continue
        self._reader.join(PATIENCE)


def main(folder: Path, step: str, system: str) -> int:
    """Run a step, and write lines of JSON: what it is at, and the sentence with which it failed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    give_matplotlib_a_place()

    logging.basicConfig(format="%(message)s")
    log = logger("diagnosis")
    log.setLevel(logging.INFO)
    log.addHandler(_Stages())
    try:
        project = Project(folder, system)
        asked = project.asked(step)
        make = getattr(import_module("diagnosis"), STEPS[step])
        log.info("reading the model and the recording")
        try:
            done = make(**asked)
        except (EstimatorError, RecordingError) as error:
            if asked.pop("run", None) is None:
                raise
            log.info("without the estimator, because it cannot read this recording: %s", error)
            done = make(**asked)
        done.curves().to_netcdf(folder / step / "curves.nc")
    except ZeroshotError as error:
        _write(error=str(error))
        return 1
    return 0


class _Stages(logging.Handler):
    """Writes what the step is at, as it is logged at level ``info``."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write it."""
        if record.levelno == logging.INFO:
            _write(stage=record.getMessage())


def _write(**said: Any) -> None:
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()


def _end_with_parent() -> None:
    """Wait until the page's process is gone, and go as well: nobody would stop this one any more."""
    while os.read(0, 1):  # not sys.stdin, whose lock the interpreter wants at its end
        pass
    for one in psutil.Process().children(recursive=True):
        one.kill()
    os._exit(1)


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1]), sys.argv[2], sys.argv[3]))
