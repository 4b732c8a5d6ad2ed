"""Jobs of a queue that end, or are refused, with shell scripts in the place of Slurm's commands; the rest is real."""

import os
import signal
import sys
from contextlib import suppress

import pytest

from datagen.farming import jobs
from datagen.farming.cluster import connect
from tests.datagen.faults import wait_for

SUBMIT = """#!/bin/bash
n=$(( $(cat {folder}/count) + 1 )); echo $n > {folder}/count.new; mv {folder}/count.new {folder}/count
if grep -qx $n {folder}/refuse; then echo "sbatch: error: Invalid account" >&2; exit 1; fi
cp "$1" {folder}/job-$n.sh
setsid bash {folder}/job-$n.sh > {folder}/job-$n.log 2>&1 < /dev/null &
echo $! > {folder}/job-$n.pid
echo "Submitted batch job $n"
"""
CANCEL = """#!/bin/bash
kill -KILL -- -$(cat {folder}/job-$1.pid) 2>/dev/null
"""
pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="Slurm is Linux's")]


class Queue:
    """What was submitted; ``refuse`` has the numbers of submissions that are refused."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "bin").mkdir()
        for name, text in (("sbatch", SUBMIT), ("scancel", CANCEL)):
            (folder / "bin" / name).write_text(text.format(folder=folder))
            (folder / "bin" / name).chmod(0o755)
        (folder / "count").write_text("0")
        self.refuse()

    def refuse(self, *numbers):
        (self.folder / "refuse").write_text("".join(f"{number}\n" for number in numbers))

    @property
    def count(self):
        return int((self.folder / "count").read_text())

    def end(self, number):
        """As by its wall time."""
        with suppress(ProcessLookupError):
            os.killpg(int((self.folder / f"job-{number}.pid").read_text()), signal.SIGKILL)

    def connect(self, **options):
        options = {"log_directory": str(self.folder), **options}
        return connect(workers=1, cluster="slurm", host="127.0.0.1", options=options)


@pytest.fixture
def queue(tmp_path, monkeypatch):
    made = Queue(tmp_path)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    monkeypatch.setattr(jobs, "LOOK", 0.2)
    monkeypatch.setattr(jobs, "LOST", 1.0)
    monkeypatch.setattr(jobs, "AGAIN", 0.5)
    yield made
    for number in range(1, made.count + 1):
        if (tmp_path / f"job-{number}.pid").exists():
            made.end(number)


def test_a_job_that_ends_is_submitted_again_also_where_that_is_refused_once(queue):
    queue.refuse(2)
    with queue.connect() as client:
        client.wait_for_workers(1, timeout=60)
        assert queue.count == 1
        queue.end(1)
        wait_for(lambda: queue.count == 3)
        client.wait_for_workers(1, timeout=60)
    assert queue.count == 3


def test_that_no_worker_comes_is_said(queue, monkeypatch, caplog):
    monkeypatch.setattr(jobs, "SAY", 0.5)
    (queue.folder / "bin" / "sbatch").write_text("#!/bin/bash\necho Submitted batch job 1\n")  # and there it stays
    made, said = queue.connect(), "no worker for 0.00833333 min"
    monkeypatch.setattr(
        "datagen.farming.cluster.Client.wait_for_workers", lambda *_: wait_for(lambda: said in caplog.text)
    )
    with made:
        pass
    assert f"of 1 jobs that are asked for; the queue may say why, or they, in {queue.folder}" in caplog.text
