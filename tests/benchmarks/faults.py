"""The fault table: a farm killed at random points, run again, and its content hashes beside an undisturbed farm's.

Run: ``python tests/benchmarks/faults.py [--points 20]``.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.datagen.faults import farm, finish, hashes, kill, shards_in, wait_for, workers_of

WORDS = ["--systems", 30, "--seed", 3, "--shard-size", 1, "--hours", 8760, "--quiet"]


def cluster_of_its_own() -> tuple[str, subprocess.Popen[str], subprocess.Popen[str]]:
    """A scheduler and two workers with their nannies, as a cluster has them."""
    port = random.randint(20000, 50000)
    address = f"tcp://127.0.0.1:{port}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "text": True}
    words = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    scheduler = subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_scheduler", *words], **quiet)
    words = [address, "--nthreads", "1", "--no-dashboard", "--local-directory", tempfile.mkdtemp()]
    nannies = [
        subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_worker", *words], **quiet) for _ in range(2)
    ]
    return address, scheduler, nannies


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=20)
    options = parser.parse_args()
    dice = random.Random(0)
    root = Path(tempfile.mkdtemp(prefix="faults-"))
    good = Path(__file__).resolve().parents[2] / "fmus" / "MixedAirCO2"
    code, said = finish(farm(good, "--out", root / "whole", *WORDS, "--workers", 2), 300)
    assert code == 0, said
    want = hashes(root / "whole")
    print("| # | killed | after [s] | shards by then | what happened | hashes equal |")
    print("|---|---|---|---|---|---|")
    for number in range(options.points):
        victim = ("client", "worker", "nanny")[number % 3]
        out = root / f"ds{number}"
        others: list[subprocess.Popen[str]] = []
        place: list[object] = ["--workers", 2]
        if victim == "nanny":
            address, scheduler, nannies = cluster_of_its_own()
            others = [scheduler, *nannies]
            place = ["--scheduler", address]
        process = farm(good, "--out", out, *WORDS, *place)
        wait_for(lambda out=out, process=process: len(shards_in(out)) >= 1 or process.poll() is not None)
        delay = dice.uniform(0, 3.5)
        time.sleep(delay)
        there = len(shards_in(out))
        assert process.poll() is None, f"{there} shards: the farm was done before anything could be killed"
        if victim == "client":
            kill(process.pid)
        elif victim == "worker":
            kill(workers_of(process.pid)[0])
        else:
            kill(others[1].pid)
        code, said = finish(process, 300)
        if code:
            wait_for(lambda pid=process.pid: not psutil.pid_exists(pid))
            code, said = finish(farm(good, "--out", out, *WORDS, "--workers", 2), 300)
            happened = "run again" if code == 0 else said.strip().splitlines()[-1]
        else:
            happened = "went on by itself"
        for one in others:
            one.kill()
            one.wait()
        print(f"| {number + 1} | {victim} | {delay:.2f} | {there} | {happened} | {hashes(out) == want} |", flush=True)


if __name__ == "__main__":
    main()
