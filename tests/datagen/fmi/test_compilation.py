"""Compiled code where the places in which numba keeps it cannot be written to, or what is there cannot be read."""

import subprocess
import sys

import pytest

from shared.children import environment

MODULE = """
import resource, sys
from datagen.fmi.compilation import cfunc, njit

if sys.argv[1:]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))

@njit
def double(x):
    return 2 * x

@cfunc("float64(float64)")
def half(x):
    return x / 2

print(double(21), half.ctypes(42.0), sum(double.stats.cache_hits.values()), half.cache_hits)
"""
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no limits of a process there")


@pytest.fixture
def place(tmp_path):
    """A module beside which nothing can be kept, and a temporary folder; there is no home."""
    (tmp_path / "module.py").write_text(MODULE)
    (tmp_path / "__pycache__").write_text("a file in the place of a folder")
    (tmp_path / "temporary").mkdir()
    return tmp_path


def carried_out(place, *arguments):
    env = environment() | {"HOME": "/proc/nohome", "TMPDIR": str(place / "temporary")}
    env = {name: value for name, value in env.items() if not name.startswith(("XDG_", "NUMBA_"))}
    words = [sys.executable, str(place / "module.py"), *arguments]
    done = subprocess.run(words, env=env, capture_output=True, text=True, check=True)
    return done.stdout.strip(), done.stderr


def test_the_next_process_finds_it_in_the_temporary_folder(place):
    assert carried_out(place) == ("42 21.0 0 0", "")
    assert carried_out(place) == ("42 21.0 1 1", "")
    for one in place.rglob("*.nbi"):
        one.write_bytes(one.read_bytes()[:20])  # as a machine leaves it that loses its power
    assert carried_out(place) == ("42 21.0 0 0", "")


def test_a_full_disk_and_a_folder_of_somebody_else_are_said_once(place):
    said, cause = carried_out(place, "16")
    assert said == "42 21.0 0 0" and cause.count("\n") == 1 and "File too large" in cause
    (root,) = (place / "temporary").iterdir()
    root.chmod(0o777)
    said, cause = carried_out(place)
    assert said == "42 21.0 0 0" and cause.count("\n") == 1 and "others may write to it" in cause
