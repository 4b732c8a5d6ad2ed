"""Which hypothesis explains a recording best, by three ways of comparing candidates with the base model.

    python tests/benchmarks/hypotheses.py run FOLDER OUT.jsonl --seed SEED --recordings 40
    python tests/benchmarks/hypotheses.py table FOLDER OUT.jsonl

``FOLDER`` holds recordings ``INDEX.nc`` with their answers ``INDEX.json``; with ``--seed`` it is made first, as
``diagnosis blind make`` makes a set. Each way writes one JSON line per recording: log evidences of the base model
(``nothing``) and of every candidate, by its law, by its family of laws, and with a discrepancy beside it, processor
seconds and simulations.

- **line**: an encompassing fit (free sources, sensors and inputs as Ornstein-Uhlenbeck processes beside the parameters)
  gives one straight line; every hypothesis has its evidence on it in closed form;
- **start**: the base model and every candidate are refitted from one start, the zero-shot estimate, on one line by the
  nuisance, without simulating derivatives anew (:func:`diagnosis.gap.refit.from_one_start`);
- **best**: the foremost of these and the base model are refitted on one line that is drawn where the best of them is;
- **diagnosis**: what ``diagnosis run`` says (``--ways diagnosis``).

On the 23 recordings of the opened set 70710678 whose cause acts by another law and whose gap is 8 standard deviations
or longer, with 35 candidates (a machine with other work; processor seconds are medians):

=================================================  ==========  ===========  =========
way                                                true first  among three  processor
=================================================  ==========  ===========  =========
line, by law                                       13 of 23    20 of 23     22 s
line, by family of laws                            14 of 23    20 of 23     22 s
start                                              15 of 23    19 of 23     15 s
start, derivatives simulated anew for each         12 of 20    16 of 20     80 s
each to its own rest, from the same two starts     6 of 12     10 of 12     214 s
start, on the same 12                              8 of 12     10 of 12
=================================================  ==========  ===========  =========

Fitted each to its own rest, the base model's log evidence differed between the two starts by 0.1 to 18 where persons
were counted (8 recordings), and by 5 to 120 where nobody counted them (4).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import opened
from diagnosis.effects import Effect, library
from diagnosis.effects.base import foreseen
from diagnosis.fitting.fit import pruned
from diagnosis.fitting.linear import Linearisation
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Colour, Colours, Grams, discrepancy, estimated_colours
from diagnosis.gap.linear import applicable, felt, linearised, widened
from diagnosis.gap.places import operators
from diagnosis.gap.refit import Refit, Rivals, from_one_start, line_at, on_the_best_line
from diagnosis.gap.scan import mass
from diagnosis.gap.search import FITTED
from diagnosis.gap.starting import ZeroShot, zero_shot
from diagnosis.recording import HOUR
from diagnosis.usual import WARM_UP
from shared.errors import SimulationError

NOTHING = "nothing"
DIAGNOSIS = "diagnosis"
BEST = "best"
ORDER = ("form", "none", "library", "outside", "two")
MEMORIES = (2 * HOUR, 12 * HOUR, 72 * HOUR)
"""Of an unknown process [s]."""
SIZES = (0.5, 1.0, 2.5, 6.0)
"""Of an unknown process: root mean square of what it does to the readings [standard deviations of the noise]."""
NOISES = (0.7, 0.85, 1.0, 1.2, 1.5, 2.0)
"""Standard deviation of a channel's error over the declared one."""
COST = 2.0
"""Log prior odds against a process that is there."""
LAWS = (0.3, 0.7)
"""Standard deviation of a law's modulation over its amplitude, in a family of laws."""


@dataclass
class Room:
    """One recording, what is known of it, and what its simulations cost so far."""

    whole: Problem
    usable: list[Effect]
    begin: np.ndarray
    began: float = field(default_factory=time.process_time)

    @property
    def spent(self) -> dict[str, float]:
        return {"cpu": round(time.process_time() - self.began, 2), "simulations": self.whole.runner.made}


class Rows:
    """Standardised readings of a problem as one vector: values, channels and times."""

    def __init__(self, problem: Problem) -> None:
        self.seen, self.sd = problem.observed, problem.floor
        self.channel = np.repeat(np.arange(len(self.sd)), self.seen.sum(axis=1))
        self.time = np.concatenate([problem.time[one] for one in self.seen])

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Rows (readings[, n]) of series (outputs, steps[, n]) [unit of each]."""
        return np.concatenate([values[k, one] / self.sd[k] for k, one in enumerate(self.seen)])


def ornstein(time_: np.ndarray, memory: float) -> np.ndarray:
    """Covariance of an Ornstein-Uhlenbeck process of unit variance."""
    return np.asarray(np.exp(-np.abs(time_[:, None] - time_) / memory))


def gaussian(covariance: np.ndarray, y: np.ndarray) -> tuple[float, Any, np.ndarray]:
    """Log density of rows, but for a constant; the covariance's factor, and its inverse times the rows."""
    root = cho_factor(covariance, lower=True, check_finite=False)
    solved = cho_solve(root, y, check_finite=False)
    return -0.5 * float(y @ solved) - float(np.sum(np.log(np.diag(root[0])))), root, solved


def ports(problem: Problem, z: np.ndarray, heights: np.ndarray, rows: Rows) -> dict[str, list[np.ndarray]]:
    """Covariances of unit mean variance of what unknown processes do to the readings, by port and memory."""
    answers: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for one in operators(problem, z, heights)[0]:
        answers[one.name] = rows(one.response), 0.5 * (one.edges[1:] + one.edges[:-1])
    for k, one in enumerate(problem.system.inputs):
        read = one.name in problem.drive.replayed or (one.source == "measured" and problem.replay)
        if read or (one.source == "schedule" and not problem.replay):
            edges = np.append(np.arange(problem.drive.start, problem.drive.stop - 1.0, 3 * HOUR), problem.drive.stop)
            count = len(edges) - 1
            pulses = Nuisance(
                column=np.full(count, k),
                begin=edges[:-1],
                end=edges[1:],
                turns=np.zeros(count, bool),
                recorded=np.ones(count, bool),
                mean=np.zeros(count),
                factor=np.eye(count),
                followed=np.full(count, 72 * HOUR),
            )
            try:
                answers[f"input {one.name}"] = rows(felt(problem, z, heights, pulses)), 0.5 * (edges[1:] + edges[:-1])
            except SimulationError:
                continue
    found = {}
    for name, (response, centres) in answers.items():
        made = [response @ ornstein(centres, memory) @ response.T for memory in MEMORIES]
        if min(np.trace(one) for one in made) > 1e-9:
            found[name] = [one * len(one) / np.trace(one) for one in made]
    for k, name in enumerate(problem.system.output_names):
        mask = rows.channel == k
        if mask.any():
            found[f"sensor {name}"] = [
                ornstein(rows.time, memory) * np.outer(mask, mask) / mask.mean() for memory in MEMORIES
            ]
    return found


def processes(fixed: np.ndarray, kernels: dict[str, list[np.ndarray]], y: np.ndarray) -> np.ndarray:
    """Covariance with those processes that earn their cost, chosen one by one."""
    chosen: dict[str, np.ndarray] = {}
    for _ in range(2):
        for name, ones in kernels.items():
            chosen.pop(name, None)
            rest = fixed + sum(chosen.values(), np.zeros_like(fixed))
            least, best = gaussian(rest, y)[0] + COST, None
            for one in ones:
                for size in SIZES:
                    value = gaussian(rest + size**2 * one, y)[0]
                    if value > least:
                        least, best = value, size**2 * one
            if best is not None:
                chosen[name] = best
    return fixed + sum(chosen.values(), np.zeros_like(fixed))


def scaled(covariance: np.ndarray, noise: np.ndarray, y: np.ndarray, rows: Rows) -> np.ndarray:
    """Variance of each reading's error by marginal likelihood, shape (readings,)."""
    value = gaussian(covariance + np.diag(noise), y)[0]
    for k in np.unique(rows.channel):
        for size in NOISES:
            trial = np.where(rows.channel == k, size**2, noise)
            other = gaussian(covariance + np.diag(trial), y)[0]
            if other > value + 0.5:
                value, noise = other, trial
    return noise


def encompassing(problem: Problem, z: np.ndarray, around: Linearisation) -> tuple[np.ndarray, Linearisation, Rows, Any]:
    """Parameters, nuisance and processes together: unknowns, linearisation, rows, and the processes' kernels."""
    rows = Rows(problem)
    noise = np.ones(len(rows.time))
    kernels = ports(problem, z, around.heights, rows)
    for round_ in range(4):
        lin = linearised(problem, z, around)
        if round_ == 1:
            kernels = ports(problem, z, around.heights, rows)
        free, nuisance = rows(lin.by_unknown), rows(lin.by_nuisance)
        y = rows(np.where(np.isfinite(lin.residual), lin.residual, 0.0)) + free @ z
        known = nuisance @ nuisance.T + free @ free.T
        total = processes(known + np.diag(noise), kernels, y)
        other = scaled(total - np.diag(noise), noise, y, rows)
        total, noise = total + np.diag(other - noise), other
        _, root, solved = gaussian(total, y)
        target = np.clip(free.T @ solved, *problem.bounds)
        spread = np.sqrt(np.maximum(1 - np.sum(free * cho_solve(root, free), axis=0), 1e-9))
        inner = cho_factor(total - free @ free.T, lower=True)
        around_, rest = around, problem.nuisance.mean - around.heights

        def loss(
            at: np.ndarray, around_: Linearisation = around_, rest: np.ndarray = rest, inner: Any = inner
        ) -> float:
            try:
                made = problem.simulate(at, around_.heights) + around_.response @ rest
            except SimulationError:
                return np.inf
            left = rows(np.where(np.isfinite(problem.measured), problem.measured - made, 0.0))
            return 0.5 * float(left @ cho_solve(inner, left) + at @ at)

        before, share = loss(z), 1.0
        while share > 0.05 and loss(z + share * (target - z)) > before:
            share *= 0.5
        step = share * (target - z)
        likely = np.clip(lin.turn @ (nuisance.T @ solved), -4, 4)
        z = z + step
        try:
            around = problem.linearise(z, likely)
        except SimulationError:
            around = problem.linearise(z)
        if float(np.sqrt(np.mean((step / spread) ** 2))) < 0.3:
            break
    return z, around, rows, kernels


def by_law(grams: Grams, colours: dict[int, Colour]) -> dict[str, tuple[float, float]]:
    """Log Bayes factor over the base model of each candidate on one line, and its amplitude [scales]."""
    left = grams.without_nuisance(colours)
    unknown = grams.n_unknown
    information, score = left.information, left.score
    precision = information[:unknown, :unknown] + np.eye(unknown)
    across = np.linalg.solve(precision, information[:unknown, unknown:])
    size = np.diag(information)[unknown:] - np.sum(information[:unknown, unknown:] * across, axis=0)
    found = {}
    for k, effect in enumerate(grams.lin.effects):
        gain = float(score[unknown + k] - across[:, k] @ score[:unknown])
        root = np.sqrt(max(float(size[k]), 0.0) + AMPLITUDE**-2)
        mean = gain / root**2
        low, high = effect.lower / effect.scale, effect.upper / effect.scale
        value = 0.5 * gain * mean - np.log(root * AMPLITUDE)
        value += mass((low - mean) * root, (high - mean) * root) - mass(low / AMPLITUDE, high / AMPLITUDE)
        found[effect.name] = float(value), float(np.clip(mean, low, high))
    return found


def modulation(rows: Rows) -> np.ndarray:
    """Covariance of how a law may differ by day and by hour of the day, of unit variance."""
    day, hour = np.floor(rows.time / 86400.0), rows.time % 86400.0 / 3600.0
    by_day = np.exp(-np.abs(day[:, None] - day) / 2.0)
    by_hour = np.exp(-2.0 * np.sin(np.pi * (hour[:, None] - hour) / 24.0) ** 2)
    return 0.5 * by_day + 0.5 * by_hour


def by_family(grams: Grams, colours: dict[int, Colour], rows: Rows, column: np.ndarray, amplitude: float) -> float:
    """Log Bayes factor of a family of laws over the one law: its signature modulated by day and by hour."""
    lin = grams.lin
    noise = np.zeros((len(rows.time), len(rows.time)))
    for k in grams.channels:
        white, slow, memory = (colours[k][0] / rows.sd[k], colours[k][1] / rows.sd[k], colours[k][2])
        at = np.flatnonzero(rows.channel == k)
        noise[np.ix_(at, at)] = white**2 * np.eye(len(at)) + slow**2 * ornstein(rows.time[at], memory)
    columns = np.column_stack([rows(lin.by_nuisance), rows(lin.by_unknown * grams.spread)])
    y = rows(grams.rows)
    one = rows(column) * amplitude
    fixed = noise + columns @ columns.T
    plain = gaussian(fixed, y)[0]
    shape = np.outer(one, one) * modulation(rows)
    return max(gaussian(fixed + size**2 * shape, y)[0] - plain for size in LAWS) - float(np.log(len(LAWS)))


def prepared(system: str, path: Path, replay: bool, occupancy: str | None, known: dict[str, float] | None) -> Room:
    """A recording as a diagnosis begins with it, and the zero-shot estimate (the middle of the prior without one)."""
    described, record = opened(system, path, noise="sensor", warm_up=WARM_UP)
    whole = Problem(
        Simulator(described), record, noise="sensor", occupancy=occupancy, replay=replay, warm_up=WARM_UP * HOUR
    )
    usable, _ = applicable(whole, library(described))
    whole = whole.with_observed(foreseen(usable, record))
    if known is None:
        estimated = zero_shot(described, record, None, lambda _: None)
        known = {} if estimated is None else estimated.values
    return Room(whole, usable, whole.unknowns(known) if known else np.zeros(whole.size))


def judged(one: Refit, colours: dict[int, Colour], rows: Rows) -> dict[str, Any]:
    """Evidence of a refit by its law, by its family, and with a discrepancy beside it."""
    slow, _ = discrepancy(one.grams, Colours(colours, {}, 0.0), one.lin.problem.floor)
    found = {"law": one.evidence, "tempered": one.evidence + slow, "settled": one.settled}
    family = one.evidence
    if one.lin.chosen:
        place = len(one.lin.problem.system.parameters)
        found["amplitude"] = float(one.lin.amplitudes[0])
        family += max(by_family(one.grams, colours, rows, one.lin.by_unknown[..., place], found["amplitude"]), 0.0)
    return found | {"family": family}


def evaluated(room: Room) -> Iterator[tuple[str, dict[str, Any]]]:
    """The first three ways in turn."""
    whole, usable = room.whole, room.usable
    # one line
    begun = whole.linearise(room.begin)
    problem_, around = pruned(whole, begun)
    problem, around = widened(problem_, around)
    z, around, rows, kernels = encompassing(problem, room.begin, around)
    lin = linearised(problem, z, around, usable)
    grams = Grams(lin, problem.observed)
    colours = estimated_colours(grams, problem.floor).best
    laws = by_law(grams, colours)
    base = grams.evidence(colours)
    plain = Grams(replace(lin, by_effect=lin.by_effect[..., :0], effects=()), problem.observed)
    table = {
        NOTHING: {
            "law": base,
            "family": base,
            "tempered": base + discrepancy(plain, Colours(colours, {}, 0.0), problem.floor)[0],
        }
    }
    for k, effect in enumerate(usable):
        value, amplitude = laws[effect.name]
        family = (
            by_family(plain, colours, rows, lin.by_effect[..., k], max(abs(amplitude), 0.3))
            if abs(amplitude) > 0.05
            else -9.0
        )
        table[effect.name] = {"law": base + value, "family": base + value + max(family, 0.0), "amplitude": amplitude}
    y = rows(grams.rows)
    columns = np.column_stack([rows(lin.by_nuisance), rows(lin.by_unknown)])
    fixed = columns @ columns.T + np.eye(len(y))
    none = gaussian(fixed, y)[0]
    sources = {
        name: max(gaussian(fixed + size**2 * one, y)[0] - none for one in ones for size in SIZES)
        for name, ones in kernels.items()
    }
    yield "line", {"hypotheses": table, "ports": sources, **room.spent}

    # one start, one line by the nuisance, each at its own optimum
    own = from_one_start(line_at(problem_, room.begin), usable, whole.observed, colours)
    yield "start", {"hypotheses": shown(own, colours), **room.spent}
    yield (
        BEST,
        {
            "hypotheses": shown(
                on_the_best_line(replace(own, refits=own.refits[:FITTED]), z, whole.observed, colours), colours
            ),
            **room.spent,
        },
    )


def shown(rivals: Rivals, colours: dict[int, Colour]) -> dict[str, dict[str, Any]]:
    """Evidences of the base model and of candidates on one line."""
    rows = Rows(rivals.base.lin.problem)
    return {(one.names or (NOTHING,))[0]: judged(one, colours, rows) for one in (rivals.base, *rivals.refits)}


def answers(folder: Path) -> list[dict[str, Any]]:
    """All answers of a folder, the most telling strata first."""
    found = []
    for path in folder.glob("*.json"):
        one = json.loads(path.read_text(encoding="utf-8"))
        if "stratum" in one:
            found.append(one | {"index": int(path.stem)})
    return sorted(found, key=lambda one: (ORDER.index(one["stratum"]), one.get("rank", 0), one["index"]))


def diagnosed(system: str, path: Path, answer: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """What ``diagnosis run`` says of a recording: log probabilities, verdict and names."""
    from diagnosis.gap import diagnosed as module

    if "estimate" in answer:
        known = module.zero_shot
        vars(module)["zero_shot"] = lambda *_: ZeroShot(answer["estimate"], "estimator") if answer["estimate"] else None
    began = time.process_time()
    try:
        done = module.diagnose(system, path, replay=answer["replay"], occupancy=answer["occupancy"])
    finally:
        if "estimate" in answer:
            vars(module)["zero_shot"] = known
    said = done.decision
    chances = said.probabilities | {NOTHING: said.nothing, "none of these": said.none}
    found = {name: {"law": float(np.log(max(one, 1e-12)))} for name, one in chances.items()}
    spent = {"cpu": time.process_time() - began, "simulations": done.report.simulations}
    yield DIAGNOSIS, {"hypotheses": found, "verdict": said.verdict, "named": said.named, **spent}


def worked(job: tuple[str, Path, dict[str, Any], Path, str]) -> str:
    """One recording, its lines appended to a file as they are known."""
    system, folder, answer, out, kind = job
    path = folder / f"{answer['index']}.nc"
    try:
        if kind == DIAGNOSIS:
            ways = diagnosed(system, path, answer)
        else:
            ways = evaluated(prepared(system, path, answer["replay"], answer["occupancy"], answer.get("estimate")))
        for way, found in ways:
            line = {"index": answer["index"], "stratum": answer["stratum"], "effects": answer["effects"], "way": way}
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line | found, default=float) + "\n")
    except Exception as error:  # the other recordings are to be done all the same
        with out.open("a", encoding="utf-8") as file:
            file.write(
                json.dumps({"index": answer["index"], "way": "failed", "error": traceback.format_exc()[-900:]}) + "\n"
            )
        return f"{answer['index']}: {error!r}"
    return f"{answer['index']} {answer['stratum']} {answer['effects']}"


def made(system: str, folder: Path, seed: int, recordings: int) -> None:
    """Make a set of blind recordings with their answers."""
    from diagnosis.blind.generator import Generator
    from diagnosis.blind.make import write_one
    from diagnosis.blind.truth import default_truth, load_truth
    from shared.system import load_system

    folder.mkdir(parents=True, exist_ok=True)
    described = load_system(system)
    generator = Generator(described, load_truth(default_truth(described), described), hours=168.0)
    for index in range(recordings):
        if not (folder / f"{index}.json").exists():
            write_one(generator, seed, index, folder)


def ran(arguments: argparse.Namespace) -> None:
    """Work on recordings until all are done or the time is up."""
    if arguments.seed is not None:
        made(arguments.system, arguments.folder, arguments.seed, arguments.recordings)
    out, begin = arguments.out, time.monotonic()
    lines = [json.loads(one) for one in out.read_text(encoding="utf-8").splitlines()] if out.exists() else []
    done = {(one["index"], one["way"]) for one in lines}
    jobs = []
    for one in answers(arguments.folder):
        for kind in arguments.ways:
            wanted = not arguments.only or one["index"] in arguments.only
            if wanted and (one["index"], kind) not in done:
                jobs.append((arguments.system, arguments.folder, one, out, kind))
    first = {"form": 0, "none": 1}  # the product's own answer after those
    jobs.sort(key=lambda job: (first.get(job[2]["stratum"], 3) if job[4] == BEST else 2, job[2].get("rank", 0)))
    if arguments.workers <= 1:
        for job in jobs:
            if time.monotonic() - begin < arguments.seconds:
                print(worked(job), f"{time.monotonic() - begin:.0f} s", flush=True)
        return
    with multiprocessing.get_context("spawn").Pool(arguments.workers) as pool:
        results = pool.imap_unordered(worked, jobs)
        for _ in jobs:
            try:
                print(
                    results.next(max(arguments.seconds - (time.monotonic() - begin), 0.1)),
                    f"{time.monotonic() - begin:.0f} s",
                    flush=True,
                )
            except multiprocessing.TimeoutError:
                print("the time is up", flush=True)
                break
        pool.terminate()


def table(arguments: argparse.Namespace) -> None:
    """Ranks of the true cause, and the largest Bayes factors where there is none, by way and evidence."""
    known = {one["index"]: one for one in answers(arguments.folder)}
    lines = [json.loads(one) for one in arguments.out.read_text(encoding="utf-8").splitlines()]
    lines = [one for one in lines if one["way"] != "failed" and one["index"] in known]
    for way in ("line", "start", BEST, DIAGNOSIS):
        some = [one for one in lines if one["way"] == way]
        if not some:
            continue
        cpu, count = (np.median([one[what] for one in some]) for what in ("cpu", "simulations"))
        print(
            f"\n{way}: {len(some)} recordings; with what went before {cpu:.0f} s of processor, {count:.0f} simulations"
        )
        for kind in ("law", "family", "tempered"):
            print(f"  by {kind}: {report(some, known, kind, arguments.length)}")


def report(some: list[dict[str, Any]], known: dict[int, dict[str, Any]], kind: str, least: float) -> str:
    """One line of the table."""
    said = []
    for stratum in ORDER:
        ranks, factors = [], []
        for line in (one for one in some if one["stratum"] == stratum):
            worth = {n: h[kind] for n, h in line["hypotheses"].items() if kind in h}
            nothing = worth.pop(NOTHING, None)
            if not worth or nothing is None:
                continue
            order = sorted(worth, key=lambda n: -worth[n])
            factors.append(worth[order[0]] - nothing)
            length = (known[line["index"]].get("detectability") or {}).get("length", np.inf)
            if stratum != "none" and length >= least:
                ranks.append(min((order.index(n) + 1 for n in line["effects"] if n in order), default=99))
        if ranks and stratum != "outside":
            got = np.array(ranks)
            said.append(f"{stratum} first {np.sum(got == 1)}, among three {np.sum(got <= 3)} of {len(got)}")
        if factors and stratum in ("none", "outside"):
            q = np.quantile(factors, [0.5, 0.9, 1.0])
            said.append(
                f"{stratum} Bayes factor {q[0]:.1f}, {q[1]:.1f}, {q[2]:.1f} (half, 90 %, all of {len(factors)})"
            )
    return "; ".join(said)


def main(given: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=["run", "table"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--system", default="fmus/MixedAirCO2")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--recordings", type=int, default=40)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--ways", nargs="*", default=[BEST], help=f"{BEST} (all three) or {DIAGNOSIS}")
    parser.add_argument("--seconds", type=float, default=np.inf)
    parser.add_argument("--only", type=int, nargs="*", help="indices of recordings")
    parser.add_argument("--length", type=float, default=8.0, help="least length of a gap that counts [noise sd]")
    arguments = parser.parse_args(given)
    {"run": ran, "table": table}[arguments.do](arguments)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
    sys.exit(0)
