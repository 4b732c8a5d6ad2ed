"""The simulations of one command: none twice, none after its time, and none that an earlier try has made already.

What a command saves as it goes is the outcome of every simulation, under a key of all that the simulation depends on,
in a hidden folder beside the answer. All else is worked out from these, and by seeds: so the same command, given again
after it was stopped, comes to the same answer by way of what it finds there.

Warm-ups that are shared: runs that differ in the recording only begin it from the same states.

Most simulations of a fit differ in a pulse somewhere in the recording; what came before, which is often longer, is the
same. So every run is made in two parts, and the states between them are remembered. As all runs are cut there, an
outcome does not depend on what was remembered.

Continuous states are all that is handed over. An FMU with discrete variables may remember more, and so may one that
hides what it remembers: the former is never cut, and of every other the first run is made both ways.

Many simulations of one system: in this process, in processes of this machine, or on a Dask cluster.

One interface for all three: :meth:`Runner.map` takes runs and returns their outputs in the same order.
"""

from __future__ import annotations

import json
import math
import shutil
import time
import zipfile
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np

from datagen.driving.tables import InputTable
from datagen.simulating.simulator import Simulator, Trajectory
from diagnosis.fitting.failures import FAILURES, reason
from diagnosis.recording import Recording
from shared import __version__
from shared.children import starting, worker_pool
from shared.errors import ClusterError, RecordingError, SimulationError, TimeUp, ZeroshotError
from shared.logs import logger
from shared.numbers import counted
from shared.places import check_folder
from shared.progress import EVERY
from shared.system import System

_log = logger(__name__)


@dataclass(frozen=True)
class Run:
    """One simulation: values by name [units of the description], inputs, and what to record (all times [s])."""

    parameters: dict[str, float]
    inputs: InputTable
    start: float
    stop: float
    record_from: float
    replay: bool = False
    tolerance: float | None = None


STATES = 64
"""States that are remembered: of so many parameters and pasts, the latest."""
SAME = 0.5
"""Difference between a run in two parts and one in one part that is the integrator's own [accuracy of the output]."""
ALIKE = 0.9
"""Share of the steps of each output that must be the same. Not all: a limiter's event moves by a moment now and then.
In the default room nine steps in ten agree to 0.03 of the accuracy, so it does not matter which run comes first."""


class Warmed:
    """Runs of one simulator; ``cut`` is None until the first run has told whether they can be cut."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        fmu = simulator.fmu
        remembers = fmu.cosimulation or not fmu.n_states or any(_discrete(one) for one in fmu.variables.values())
        self.cut: bool | None = False if remembers else None
        self._states: OrderedDict[bytes, np.ndarray] = OrderedDict()

    def outputs(self, run: Run) -> np.ndarray:
        """Outputs of a run, shape (outputs, steps) [unit of each].

        Raises
        ------
        SimulationError
            If the end was not reached.
        """
        if self.cut is False or run.record_from <= run.start:
            return self._whole(run)
        found = self._parts(run)
        if self.cut is None:
            whole = self._whole(run)
            apart = np.quantile(np.abs(found - whole), ALIKE, axis=1)
            self.cut = bool((apart <= SAME * np.array([one.accuracy for one in self.simulator.system.outputs])).all())
            if not self.cut:
                return whole
        return found

    def _simulated(self, run: Run, inputs: InputTable, **span: Any) -> Trajectory:
        span |= {"replay": run.replay, "tolerance": run.tolerance, "driven": False}
        return self.simulator.run(run.parameters, inputs, **span)

    def _whole(self, run: Run) -> np.ndarray:
        span = {"start": run.start, "stop": run.stop, "record_from": run.record_from}
        return self._simulated(run, run.inputs, **span).outputs

    def _parts(self, run: Run) -> np.ndarray:
        before = run.inputs.restricted(run.start, run.record_from)
        key = blake2b(digest_size=16)
        key.update(repr((sorted(run.parameters.items()), before.names, run.replay, run.tolerance)).encode())
        for values in (before.time, before.left, before.right, before.jump):
            key.update(values.tobytes())
        states = self._states.get(key.digest())
        if states is None:
            span = {"start": run.start, "stop": run.record_from, "step": run.record_from - run.start}
            states = self._simulated(run, before, **span, record_states=True).states[-1]
            if not np.isfinite(states).all():
                raise SimulationError("states at the start of the recording are not finite; expected numbers")
            self._states[key.digest()] = states
            if len(self._states) > STATES:
                self._states.popitem(last=False)
        return self._simulated(run, run.inputs, start=run.record_from, stop=run.stop, initial_states=states).outputs


_KNOWN: WeakKeyDictionary[Simulator, Warmed] = WeakKeyDictionary()


def warmed(simulator: Simulator) -> Warmed:
    """The simulator's runs, with what it remembers."""
    if simulator not in _KNOWN:
        _KNOWN[simulator] = Warmed(simulator)
    return _KNOWN[simulator]


def _discrete(variable: object) -> bool:
    return getattr(variable, "variability", None) == "discrete" and getattr(variable, "causality", None) != "input"


KEPT = 16
"""Outcomes that are remembered, the latest: a fit comes back to where it was, not to where it was long ago."""
FOLDER = ".simulations"
"""Where outcomes are saved, within the folder of the answer."""
SAVING = 10.0
"""Seconds between two files of outcomes: so much is lost at most where a process is killed."""
MOST = 2**30
"""Bytes that are saved at most. Of more the first are kept, which everything after them builds on."""
UNTIL_THEN = "the same command goes on from where this one stopped, and with more minutes it comes further"
Spans = Mapping[str, tuple[float, float]]
"""By the first words of a stage: between which shares of the whole work it is, roughly."""


class Kept:
    """Outcomes in files: an .npz each time, with an array for each simulation, named by its key.

    Parameters
    ----------
    folder
        For the files; it is made when there is something to save.
    about
        What the outcomes are of. What was saved of something else is removed.
    """

    def __init__(self, folder: Path, about: dict[str, str]) -> None:
        self.folder, self._about = folder, about
        self._new: dict[str, np.ndarray] = {}
        self._saved, self._size, self._files = time.monotonic(), 0, 0
        self._found: dict[str, Path] = {}
        self._open: tuple[Path, dict[str, np.ndarray]] | None = None
        if not folder.is_dir():
            return
        try:
            same = json.loads((folder / "about.json").read_text(encoding="utf-8")) == about
        except (OSError, ValueError):
            same = False
        if not same:
            _log.info("%s: what was begun there is of another recording, system or version; it is removed", folder)
            self.remove()
        for path in sorted(folder.glob("*.npz")):
            try:
                with np.load(path, allow_pickle=False) as file:
                    self._found |= dict.fromkeys(file.files, path)
            except (OSError, ValueError, zipfile.BadZipFile):  # cut off, or not ours
                continue
            self._size += path.stat().st_size
            self._files += 1
        if self._found:
            _log.info("going on with %s from before, in %s", counted(len(self._found), "simulation"), folder)

    def find(self, key: str) -> Outcome | None:
        """What was saved under a key, if anything was."""
        found = self._new.get(key)
        if found is None and key in self._found:
            path = self._found[key]
            try:
                if self._open is None or self._open[0] != path:
                    with np.load(path, allow_pickle=False) as file:
                        self._open = path, {name: file[name] for name in file.files}
                found = self._open[1][key]
            except (OSError, ValueError, KeyError, zipfile.BadZipFile):
                del self._found[key]
        if found is None:
            return None
        return SimulationError(str(found)) if found.dtype.kind == "U" else found.copy()

    def add(self, key: str, outcome: Outcome) -> None:
        """Save an outcome, at the latest with those of the next seconds."""
        if self._size < MOST:
            self._new[key] = np.array(str(outcome)) if isinstance(outcome, SimulationError) else outcome.copy()
            if time.monotonic() - self._saved > SAVING:
                self.save()

    def save(self) -> None:
        """Write what is not written yet; where that fails, the command goes on without."""
        if not self._new:
            return
        path = self.folder / f"{self._files:06d}.npz"
        draft = path.with_suffix(".draft")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / "about.json").write_text(json.dumps(self._about), encoding="utf-8")
            with draft.open("wb") as file:
                np.savez(file, **self._new)  # type: ignore[arg-type]
            draft.replace(path)
        except OSError as error:
            _log.warning("%s: what is simulated cannot be saved there: %s", self.folder, error.strerror)
            self._size = MOST
        else:
            self._size += path.stat().st_size
            self._files += 1
            self._found |= dict.fromkeys(self._new, path)
        self._new, self._saved = {}, time.monotonic()

    def remove(self) -> None:
        """Remove all that was saved, and forget what was not yet."""
        self._new, self._found = {}, {}
        shutil.rmtree(self.folder, ignore_errors=True)


class Simulations:
    """Makes the simulations of a command, by a runner that may change on the way, and logs how far it is.

    A simulation depends on its run alone, so what is remembered is the same to the last bit. In memory those are that
    were asked for singly: runs of a batch are the steps of differences, to which nobody comes back.

    ``made`` counts those that were simulated; ``asked`` also those that a try before has saved, so that a command that
    goes on comes to the same count.

    Parameters
    ----------
    kept
        What was saved before, and where to save.
    minutes
        Time that there is.
    spans
        Where stages lie within the whole work; only the time left that is logged follows from them.
    """

    def __init__(
        self,
        runner: Runner,
        *,
        kept: Kept | None = None,
        minutes: float | None = None,
        spans: Spans | None = None,
    ) -> None:
        self.runner, self.kept = runner, kept
        self.made = self.asked = 0
        self.time_up = False
        self._latest: OrderedDict[str, np.ndarray] = OrderedDict()
        self._began = self._logged = time.monotonic()
        self._until = math.inf if minutes is None else self._began + 60.0 * minutes
        self._lifted = False
        self._spans, self._stage = spans or {}, ""
        self._span, self._done = (0.0, 0.0), 0.0

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """Outcome of each run, in order.

        Raises
        ------
        TimeUp
            If there is no time left to simulate.
        """
        keys = [key_of(one) for one in runs]
        left = [k for k, key in enumerate(keys) if key not in self._latest]
        made: dict[int, Outcome] = {}
        if self.kept is not None:
            made = {k: one for k in left if (one := self.kept.find(keys[k])) is not None}
        todo = [k for k in left if k not in made]
        batch = getattr(self.runner, "batch", 1)
        for places in (todo[first : first + batch] for first in range(0, len(todo), batch)):
            self._beat()
            for k, outcome in zip(places, self.runner.map([runs[k] for k in places]), strict=True):
                made[k] = outcome
                if self.kept is not None:
                    self.kept.add(keys[k], outcome)
            self.made += len(places)
        # copies: whoever changes what they were given must not change what is remembered
        outcomes = [made[k] if k in made else self._latest[key].copy() for k, key in enumerate(keys)]
        if len(runs) == 1 and isinstance(outcomes[0], np.ndarray):
            self._latest[keys[0]] = outcomes[0].copy()
            self._latest.move_to_end(keys[0])
            if len(self._latest) > KEPT:
                self._latest.popitem(last=False)
        self.asked += len(left)
        return outcomes

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """Let what completes an answer be simulated, though the time may be up."""
        before, self._lifted = self._lifted, True
        try:
            yield
        finally:
            self._lifted = before

    def end(self) -> None:
        """Save what there is, for the last time; whoever simulates more has all the time."""
        if self.kept is not None:
            self.kept.save()
        self.kept, self._until = None, math.inf

    def stage(self, words: str) -> None:
        """Log what is done from now on; every half minute that is logged again, with the time that it takes."""
        self._stage = words
        if found := [span for first, span in self._spans.items() if words.startswith(first)]:
            self._span, self._done = found[0], found[0][0]
        self._say()

    def reached(self, share: float) -> None:
        """Note the share of the present stage that is done."""
        self._done = self._span[0] + share * (self._span[1] - self._span[0])

    def _beat(self) -> None:
        now = time.monotonic()
        if now > self._until and not self._lifted:
            self.time_up = True
            raise TimeUp("the time was up before there was anything to tell; " + UNTIL_THEN)
        if now - self._logged > EVERY:
            self._say()

    def _say(self) -> None:
        self._logged = now = time.monotonic()
        spent = now - self._began
        rest = min(spent * (1 - self._done) / self._done if self._done > 0 else math.inf, self._until - now)
        about = [f"{counted(self.made, 'simulation')}, {lasting(spent)} so far"] if self.made else []
        about += [f"roughly {lasting(rest)} left"] if 0 < rest < math.inf else []
        _log.info("%s", f"{self._stage} ({', '.join(about)})" if about else self._stage)


def check_command(out: Path | str | None, minutes: float | None) -> None:
    """Refuse, before anything is read, a folder that cannot be written to and a time that is none.

    Raises RecordingError.
    """
    if minutes is not None and not minutes > 0:
        raise RecordingError(f"minutes is {minutes:g}; expected more than 0, for example 10")
    if out is not None:
        check_folder(Path(out), RecordingError)


@contextmanager
def simulations(
    runner: Runner,
    out: Path | None,
    simulator: Simulator,
    recording: Recording,
    *,
    minutes: float | None = None,
    spans: Spans | None = None,
    within: Simulations | None = None,
) -> Iterator[Simulations]:
    """Simulations of one command, saved beside its answer until that is written, and longer if the time was up.

    Parameters
    ----------
    out
        Folder of the answer; nothing is saved without.
    simulator, recording
        What they are of. Settings are no part of it: a simulation is found by all that it depends on itself.
    within
        Simulations of a command that this is a part of: they go on with another runner while this lasts.
    """
    if within is not None:
        before, within.runner = within.runner, runner
        try:
            yield within
        finally:
            within.runner = before
        return
    kept = None
    if out is not None:
        system, fmu = simulator.system.hash(), simulator.fmu.sha256
        about = {"version": __version__, "system": system, "fmu": fmu, "recording": _digest(recording)}
        kept = Kept(out / FOLDER, about)
    found = Simulations(runner, kept=kept, minutes=minutes, spans=spans)
    try:
        yield found
    except ZeroshotError as error:
        if kept is not None and not isinstance(error, TimeUp | ClusterError):
            kept.remove()  # the same command would end the same way
        raise
    else:
        if kept is not None and not found.time_up:
            kept.remove()
    finally:
        found.end()
        found.runner = InProcess(simulator)  # of processes that end with the command
        _log.debug("%s made", counted(found.made, "simulation"))


def lasting(seconds: float) -> str:
    """A time as one says it: 40 s, 12 min, 3 h."""
    if seconds < 99:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 99 * 60 else f"{seconds / 3600:.0f} h"


def key_of(run: Run) -> str:
    """What a simulation depends on, beside its system."""
    rest = (sorted(run.parameters.items()), run.inputs.names, run.start, run.stop, run.record_from, run.replay)
    digest = blake2b(repr((rest, run.tolerance)).encode(), digest_size=16)
    for values in (run.inputs.time, run.inputs.left, run.inputs.right, run.inputs.jump):
        digest.update(values.tobytes())
    return digest.hexdigest()


def _digest(recording: Recording) -> str:
    """What tells a recording from others, whatever its file is called."""
    digest = blake2b(repr((recording.step, str(recording.zero))).encode(), digest_size=16)
    for values in (recording.time, recording.outputs, *(recording.inputs[name] for name in sorted(recording.inputs))):
        digest.update(values.tobytes())
    return digest.hexdigest()


Outcome = np.ndarray | SimulationError
"""Outputs (outputs, steps) [unit of each], or why there are none."""
_ROUNDS = 32
"""Runs for each worker in one batch: at its end all but the slowest wait, for a share of it that hardly counts."""


class Runner(Protocol):
    """What runs simulations.

    It may have a ``batch``: how many runs it is given at least, if there are so many, lest a worker wait for others;
    one, if it has none.
    """

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """Outcome of each run, in order; a failed simulation is an error in its place, not an exception."""


class InProcess:
    """One after another on a simulator that is loaded already."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        return [simulate(self.simulator, run) for run in runs]


class Processes:
    """In processes of this machine, each with its own simulator."""

    def __init__(self, system: System, workers: int, pool: ProcessPoolExecutor) -> None:
        self._what = (system.canonical(), str(system.path))
        self.workers, self.batch = workers, _ROUNDS * workers
        self._pool = pool

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        parts = _parts(runs, self.workers)
        try:
            with starting():  # the first call starts the processes
                done = self._pool.map(_simulate_all, [self._what] * len(parts), parts)
            return [one for part in done for one in part]
        except BrokenProcessPool:
            raise ClusterError(
                f"one of {self.workers} processes that simulate was killed, as they are where memory runs out; expected"
                " all of them to stay. Give fewer --workers: the same command goes on from there"
            ) from None


class Cluster:
    """On the workers of a Dask client, which see the FMU under the same path as this machine."""

    def __init__(self, system: System, client: Any) -> None:
        self._what = (system.canonical(), str(system.path))
        self._client = client

    @property
    def batch(self) -> int:
        """See :class:`Runner`."""
        return _ROUNDS * self._workers

    @property
    def _workers(self) -> int:
        return max(len(self._client.scheduler_info(n_workers=-1)["workers"]), 1)

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        parts = _parts(runs, self._workers)
        futures = [self._client.submit(_simulate_all, self._what, part, pure=False) for part in parts]
        return [one for part in self._client.gather(futures) for one in part]


@contextmanager
def side_by_side(simulator: Simulator, *, workers: int | None = None, scheduler: str | None = None) -> Iterator[Runner]:
    """A runner: on a Dask cluster where a scheduler is given, in ``workers`` processes, or in this one.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, there would be no worker, or both are given: a cluster has its own workers.
    """
    if workers is not None and workers < 1:
        raise ClusterError(f"workers is {workers}; expected at least 1")
    if scheduler is not None:
        from datagen.farming.cluster import connect

        with connect(workers=workers, scheduler=scheduler) as client:
            yield Cluster(simulator.system, client)
    elif workers is not None and workers > 1:
        with worker_pool(workers) as pool:
            yield Processes(simulator.system, workers, pool)
    else:
        yield InProcess(simulator)


def simulate(simulator: Simulator, run: Run) -> Outcome:
    """Simulate one run."""
    try:
        return warmed(simulator).outputs(run)
    except SimulationError as error:
        return error
    except (ZeroshotError, *FAILURES) as error:  # such as a discrete input that an effect has bent
        return SimulationError(reason(error))


def _parts(runs: Sequence[Run], workers: int) -> list[list[Run]]:
    """Consecutive parts, a few for each worker, so that none waits long for another."""
    count = max(min(4 * workers, len(runs)), 1)
    edges = np.linspace(0, len(runs), count + 1).round().astype(int)
    return [list(runs[a:b]) for a, b in pairwise(edges) if b > a]


def _simulate_all(what: tuple[str, str], runs: Sequence[Run]) -> list[Outcome]:
    from datagen.farming.worker import simulator_for  # with distributed, which only workers need

    simulator = simulator_for(*what)
    if simulator is None:
        return [SimulationError(f"{what[1]}: its FMU is not on this worker; expected the same path")] * len(runs)
    return [simulate(simulator, run) for run in runs]
