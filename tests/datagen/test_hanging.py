"""An FMU that never returns from one of its functions: a signal or the time limit ends the command, with a sentence."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest

from tests.datagen.faults import alive, family_of, faulty, finish, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name == "nt", reason="signals are sent as POSIX has them")]
MOST = 60.0
"""Seconds from a signal to the end, which would never come: one and a little on a machine that is free."""


@pytest.fixture(scope="module")
def system(tank):
    return faulty.describe(tank.parent, fault=2, above=0)


def started(*words):
    return subprocess.Popen(
        [sys.executable, "-m", "datagen.cli", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def is_unpacked(process):
    """Whether some process of a command has an FMU's library loaded, and so runs it or is about to."""
    for one in family_of(process.pid):
        try:
            if "zeroshot-fmu-" in " ".join(m.path for m in one.memory_maps()):
                return True
        except Exception:  # it ended meanwhile
            continue
    return False


def test_a_signal_ends_a_simulation_that_never_returns(system, tmp_path):
    process = started("simulate", system, "--out", tmp_path / "one.nc")
    wait_for(lambda: is_unpacked(process))
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGTERM)
    found, said = finish(process, MOST)
    assert found == 143
    assert re.fullmatch("warning: stopped before its end; .*\n", said)
    assert not (tmp_path / "one.nc").exists()


def test_the_limit_ends_one_that_never_returns_and_leaves_no_folder(system, tmp_path):
    (tmp_path / "tmp").mkdir()
    words = [sys.executable, "-m", "datagen.cli", "simulate", system, "--out", tmp_path / "one.nc", "--timeout", "1"]
    done = subprocess.run(
        words, capture_output=True, text=True, timeout=300, env={**os.environ, "TMPDIR": f"{tmp_path / 'tmp'}"}
    )
    assert done.returncode == 1
    assert re.fullmatch(r"error: .*\.fmu: one of its functions had not returned after 1 s, .*\n", done.stderr)
    assert list((tmp_path / "tmp").glob("zeroshot-*")) == []


def test_ctrl_c_ends_workers_that_never_return(system):
    process = started("identifiability", system, "--systems", "2", "--timeout", "60", "--quiet")
    wait_for(lambda: is_unpacked(process))
    time.sleep(1.0)
    family = family_of(process.pid)
    os.kill(process.pid, signal.SIGINT)
    code, said = finish(process, MOST)
    assert code == 130
    assert said.count("\n") == 1
    assert alive(family) == []
