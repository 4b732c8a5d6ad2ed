"""The distribution built from a clean copy of the sources, and its wheel in environments that hold nothing else.

``uv`` builds and installs: it keeps one cache of packages, and an environment's files are links into it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "zeroshot-fmu"


@dataclass(frozen=True)
class Promise:
    """What an extra brings, and what it must not bring."""

    imports: tuple[str, ...]
    """packages of ours of which every module can be imported"""
    present: frozenset[str]
    absent: frozenset[str]
    """distributions, by their normalised names"""


FARM = frozenset({"fmpy", "dask", "distributed", "numba", "pvlib", "bokeh", "jinja2"})
LEARNING = frozenset({"torch", "safetensors", "zuko", "optuna"})
TOOLS = frozenset({"pytest", "ruff", "mypy", "ziglang", "hypothesis", "uv"})
PROMISES = {
    "": Promise(("shared",), frozenset({"numpy", "xarray", "cyclopts"}), FARM | LEARNING | TOOLS | {"scipy"}),
    "datagen": Promise(("shared", "datagen"), FARM, LEARNING | TOOLS),
    "trainer": Promise(("shared", "trainer"), LEARNING, (FARM - {"jinja2"}) | TOOLS | {"llvmlite"}),
    "diagnosis": Promise(("diagnosis",), FARM | LEARNING | {"pint"}, TOOLS),
}
"""By extra; the empty one is the distribution without any. (torch itself requires jinja2.)"""

HOLDS = """
import importlib, importlib.metadata, importlib.util, json, pkgutil, sys
from shared.shipped import resolved
from shared.system import load_system
system, page, count = load_system(resolved("MixedAirCO2")), importlib.util.find_spec("panel") is not None, 0
for package in sys.argv[1:]:
    for found in pkgutil.walk_packages(importlib.import_module(package).__path__, package + "."):
        if page or not found.name.startswith("diagnosis.app."):
            importlib.import_module(found.name)
        count += 1
names = [one.name.lower().replace("_", "-") for one in importlib.metadata.distributions()]
where = sys.modules["shared"].__file__
print(json.dumps({"distributions": names, "where": where, "system": system.hash(), "modules": count}))
"""
"""Imports all modules of the packages that it is given, those of the local page with its extra; says what is there."""


@dataclass(frozen=True)
class Environment:
    """A virtual environment with the wheel in it, or one that has the wheel's files ``first`` on its path."""

    folder: Path
    first: Path | None = None

    def run(self, *words: str, cwd: Path, timeout: float = 900) -> subprocess.CompletedProcess[str]:
        """Run one of its programs with nothing of ours on the path."""
        named = {name: os.environ[name] for name in ("HOME", "LANG", "TMPDIR") if name in os.environ}
        environment = named | {"PATH": f"{self.folder / 'bin'}{os.pathsep}/usr/bin:/bin", "OMP_NUM_THREADS": "1"}
        environment |= {"PYTHONPATH": str(self.first)} if self.first else {}
        program = self.folder / "bin" / words[0]
        return subprocess.run(
            [str(program), *words[1:]], cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout
        )

    def out(self, *words: str, cwd: Path) -> str:
        """What a command prints that must succeed."""
        done = self.run(*words, cwd=cwd)
        assert done.returncode == 0, f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout


def sources(target: Path) -> None:
    """Copy what git knows, and new files that it does not ignore: nothing that a build or a test has left behind."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():  # a file that was just removed is still listed
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, target / name)


def build(folder: Path) -> tuple[Path, Path]:
    """Build the source distribution, and the wheel from it; returns both."""
    sources(folder / "sources")
    _uv("build", "--quiet", "--out-dir", str(folder / "dist"), str(folder / "sources"))
    (archive,), (wheel,) = (folder / "dist").glob("*.tar.gz"), (folder / "dist").glob("*.whl")
    return archive, wheel


def install(wheel: Path, extra: str, folder: Path, python: str = sys.executable) -> Environment:
    """The wheel with one extra, at the versions that the project is tested with, in a new environment."""
    _uv("venv", "--quiet", "--no-project", "--python", python, str(folder))
    what = f"{wheel}[{extra}]" if extra else str(wheel)
    pins = str(ROOT / "constraints.txt")
    _uv("pip", "install", "--quiet", "--python", str(folder / "bin" / "python"), "--constraint", pins, what)
    return Environment(folder)


def unpacked(wheel: Path, folder: Path) -> Environment:
    """This environment with the wheel's files in place of the sources."""
    with zipfile.ZipFile(wheel) as opened:
        opened.extractall(folder)
    return Environment(Path(sys.prefix), folder)


@cache
def index_answers() -> bool:
    """Whether there is an index to install from."""
    asked = [sys.executable, "-m", "pip", "index", "versions", "setuptools"]
    return subprocess.run(asked, capture_output=True, timeout=600).returncode == 0


def uv() -> str:
    """Path of the program."""
    return str(Path(sys.executable).parent / "uv")


def _uv(*words: str) -> None:
    done = subprocess.run([uv(), *words], env=os.environ | uv_settings(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"uv {' '.join(words)}\n{done.stderr[-4000:]}"


@cache
def uv_settings() -> dict[str, str]:
    """Variables that hand pip's settings on: uv has its own, but a machine is set up for pip."""
    listed = subprocess.run(
        [sys.executable, "-m", "pip", "config", "list"], capture_output=True, text=True, check=True
    ).stdout
    said = {
        line.partition("=")[0].rpartition(".")[2]: line.partition("=")[2].strip("'") for line in listed.splitlines()
    }
    handed = {"UV_FIND_LINKS": said.get("find-links"), "UV_DEFAULT_INDEX": said.get("index-url")}
    return {name: value.replace(" ", ",") for name, value in handed.items() if value and name not in os.environ}
