"""Blind sets and verdicts made by hand, and judges that are no diagnosis: for tests of running and scoring."""

import json
import os
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from diagnosis.blind.sealed import publish, seal
from diagnosis.blind.verdicts import Outcome, Run, Verdict, write_outcome, write_run
from shared.store import sha256_of

SINCE = {"units": "seconds since 2001-01-01 00:00:00"}

STEPS, STEP = 96, 3600.0
ROOM, AIR = "room", "air"


def length_at_once(_, path, answer, *__):
    """In place of lengths beyond imitation those of the gaps: the real ones take most of the time of a set."""
    return {"length": sum(answer["gap"].values())}


def prepare_quickly(*given):
    """What a process prepares that makes recordings, with :func:`length_at_once`: it sees no patch of ours."""
    import diagnosis.blind.make as module  # takes a while, and most who import this module do not need it

    module.detectability = length_at_once
    module._prepare(*given)


@dataclass
class Case:
    """One recording: what is true of it, and what was said."""

    stratum: str
    effects: tuple[str, ...] = ()
    truth: str = "effect"
    sizes: tuple[float, ...] = ()
    room: float = 0.0
    air: float = 0.0
    replay: bool = False
    hours: tuple[int, int] = (0, 24)
    length: float | None = None
    verdict: Verdict | None = field(default_factory=lambda: Verdict(verdict="no_gap"))
    parameters: dict[str, float] = field(default_factory=lambda: {"r": 1.0, "v": 10.0})


def gap_series(rms, hours):
    """A gap of a given root mean square over the whole recording that lies in some hours only, shape (STEPS,)."""
    inside = (np.arange(STEPS) % 24 >= hours[0]) & (np.arange(STEPS) % 24 < hours[1])
    return np.where(inside, rms / np.sqrt(inside.mean()), 0.0)


def write_set(folder, cases, seed=7, system_name="Hand"):
    """A published set and its sealed answers: (folder, answers). Noise is 2 in the room and 5 in the air."""
    (folder / "recordings").mkdir(parents=True)
    noise = {ROOM: 2.0, AIR: 5.0}
    listed, opened = [], []
    for k, case in enumerate(cases):
        file = f"recordings/{k:04}.nc"
        gaps = {ROOM: case.room, AIR: case.air}
        base = {name: np.linspace(20.0, 21.0, STEPS) for name in gaps}
        clean = {name: base[name] + gap_series(rms * noise[name], case.hours) for name, rms in gaps.items()}
        data = xr.Dataset(coords={"time": ("time", STEP * np.arange(1, STEPS + 1), SINCE)})
        for name, values in clean.items():
            data[name] = ("time", values, {"units": "1", "role": "output"})
        data["sun"] = ("time", np.arange(STEPS) % 24.0, {"units": "W/m2", "role": "input"})
        data.to_netcdf(folder / file, format="NETCDF3_64BIT", engine="scipy")
        names = [*case.effects] or ([""] if case.truth == "none_of_these" else [])
        listed.append(
            {"file": file, "sha256": sha256_of(folder / file), "occupancy": "measured", "replay": case.replay}
        )
        opened.append(
            {
                "file": file,
                "stratum": case.stratum,
                "verdict": case.truth,
                "effects": list(case.effects),
                "causes": [
                    {"effect": name, "form": "", "amplitude": 3.0 * size, "unit": "1", "scale": 3.0}
                    for name, size in zip(names, case.sizes or (1.0,) * len(names), strict=True)
                ],
                "replay": case.replay,
                "occupancy": "measured",
                "start": 0.0,
                "parameters": case.parameters,
                "gap": {name: rms * noise[name] for name, rms in gaps.items()},
                "gap_over_noise": gaps,
                "clean": {name: values.tolist() for name, values in clean.items()},
                "base": {name: values.tolist() for name, values in base.items()},
            }
        )
        if case.length is not None:
            opened[-1]["detectability"] = {"length": case.length}
    about = {"system_name": system_name, "system_hash": "h", "fmu_sha256": "f", "step": STEP, "hours": float(STEPS)}
    answers = folder.with_name(f"{folder.name}.answers.json")
    digest = seal(answers, {"salt": "s", "seed": seed, **about, "recordings": opened})
    publish(folder, {**about, "answers_sha256": digest, "recordings": listed})
    return folder, answers


def write_results(results, folder, cases, library=("a", "b", "c"), without=()):
    """Verdict files for the cases of a set."""
    manifest = json.loads((folder / "manifest.json").read_text())
    run = Run(
        system_name="Hand",
        system_hash="h",
        answers_sha256=manifest["answers_sha256"],
        library=list(library),
        without=list(without),
    )
    write_run(results, run)
    for one, case in zip(manifest["recordings"], cases, strict=True):
        failure = "" if case.verdict is not None else "SimulationError: it stopped"
        write_outcome(
            results,
            Outcome(file=one["file"], sha256=one["sha256"], seconds=10.0, verdict=case.verdict, failure=failure),
        )
    return results


@dataclass(frozen=True)
class Spoken:
    """What a judge by hand says: always the same, without an effect that is withheld."""

    verdict: Verdict
    breaks: tuple[str, ...] = ()

    def without(self, name):
        if name in self.breaks:
            raise ValueError(f"cannot do without {name}")
        return Verdict(verdict="none_of_these", none=1.0, named=[], probabilities={name: 0.0})


@dataclass(frozen=True)
class HandJudge:
    """Says `effect a` of recordings whose room is off on average, else `no_gap`; on demand it fails, dies or hangs.

    ``asked`` is a folder that gets a file for every recording it was asked about; ``breaks`` are effects that it
    cannot do without.
    """

    asked: Path | None = None
    fails: tuple[str, ...] = ()
    dies: tuple[str, ...] = ()
    hangs: tuple[str, ...] = ()
    breaks: tuple[str, ...] = ()

    def __call__(self, recording, *, replay, occupancy):
        if self.asked is not None:
            (self.asked / f"{recording.stem}.{time.monotonic_ns()}").write_text(f"{replay} {occupancy}")
        if recording.stem in self.fails:
            raise ValueError("cannot judge this")
        if recording.stem in self.dies:
            os._exit(17)
        if recording.stem in self.hangs:
            time.sleep(3600)
        with xr.open_dataset(recording, decode_times=False, engine="scipy") as data:
            off = float(data[ROOM].mean()) > 21.0
        said = {"a": 0.9, "b": 0.05, "c": 0.005} if off else {}
        verdict = Verdict(verdict="effect", probabilities=said, none=0.05, nothing=0.0, named=["a"])
        return Spoken(verdict if off else Verdict(verdict="no_gap", nothing=0.99), self.breaks)


QUIET = Verdict(verdict="no_gap", probabilities={"a": 0.1}, none=0.0, nothing=0.9)
"""Of a diagnosis that found no gap."""


def said(*named, p=None, none=0.0, nothing=0.0, **more):
    """A verdict that names effects, with probabilities p."""
    word = "effect" if len(named) == 1 else "ambiguous"
    p = p or {name: (1 - none - nothing) / len(named) for name in named}
    return Verdict(verdict=word, probabilities=p, none=none, nothing=nothing, named=list(named), **more)


def hand_set(folder, system, rooms):
    """A set of recordings that are off or not, published as if they were of a system."""
    cases = [Case("library", ("a",), room=room, replay=k == 1) for k, room in enumerate(rooms)]
    folder, answers = write_set(folder, cases)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest |= {"system_hash": system.hash(), "fmu_sha256": sha256_of(system.fmu_path)}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder, answers


def files(folder):
    """Names of all files below a folder."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def one_after_another(jobs, workers, limit, tell):
    """In place of processes, which see no patch of ours."""
    import diagnosis.blind.running as running

    for job in jobs:
        running.work(job)
        tell()
