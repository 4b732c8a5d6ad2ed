"""Dockerfiles without an engine: what they say, and their steps run in a folder that stands for the root.

Every ``COPY`` and ``RUN`` is carried out, the ``ENV`` holds for what is run afterwards. What is changed on the way:
absolute paths of the Dockerfile point into the folder, ``python`` and ``pip`` are this machine's, no account is made.
What ``pip`` builds and installs, ``uv`` does: it takes the same words, and has unpacked most of it for other tests. It
compiles no modules as ``pip`` does, so the first program that imports one keeps it compiled.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import dockerfile
import matplotlib
import pathspec

from tests.packaging.wheels import uv, uv_settings

ROOT = Path(__file__).resolve().parents[2]
_FOLDERS = ("opt", "source", "wheels", "systems", "data", "runs", "tmp")
_ABSOLUTE = re.compile(rf"(?<![\w./$}}-])/(?=(?:{'|'.join(_FOLDERS)})\b)")


@dataclass
class Stage:
    """What stands between two ``FROM``."""

    base: str
    name: str | None
    commands: list[dockerfile.Command] = field(default_factory=list)

    def last(self, cmd: str) -> dockerfile.Command | None:
        """The command of a kind that counts: the last one."""
        found = [command for command in self.commands if command.cmd == cmd]
        return found[-1] if found else None

    @property
    def environment(self) -> dict[str, str]:
        """All ``ENV`` of the stage."""
        pairs: dict[str, str] = {}
        for command in self.commands:
            if command.cmd == "ENV":
                pairs |= dict(zip(command.value[::2], command.value[1::2], strict=True))
        return pairs


@dataclass
class Dockerfile:
    """A parsed Dockerfile: its build arguments with their defaults, its stages."""

    path: Path
    arguments: dict[str, str | None]
    stages: list[Stage]

    @property
    def final(self) -> Stage:
        """The stage that becomes the image."""
        return self.stages[-1]

    @property
    def python(self) -> str:
        """Version of Python, as in 3.11."""
        return ".".join((self.arguments["PYTHON"] or "").split(".")[:2])


def read(path: Path) -> Dockerfile:
    """Parse a Dockerfile with BuildKit's own parser."""
    arguments: dict[str, str | None] = {}
    stages: list[Stage] = []
    for command in dockerfile.parse_file(str(path)):
        if command.cmd == "ARG":
            name, sign, value = command.value[0].partition("=")
            arguments[name] = value if sign else None
        elif command.cmd == "FROM":
            base = command.value[0]
            for name, value in arguments.items():
                base = base.replace(f"${{{name}}}", value or "")
            stages.append(Stage(base, command.value[2] if len(command.value) > 2 else None))
        else:
            stages[-1].commands.append(command)
    return Dockerfile(path, arguments, stages)


def context() -> list[str]:
    """Files that the build gets: all that .dockerignore does not leave out."""
    lines = []
    for line in (ROOT / ".dockerignore").read_text().splitlines():
        if line and not line.startswith("#"):
            # unlike git, Docker takes every pattern from the context's root
            sign, pattern = ("!", line[1:]) if line.startswith("!") else ("", line)
            lines.append(f"{sign}{pattern if pattern.startswith('**') else '/' + pattern}")
    ignored = pathspec.GitIgnoreSpec.from_lines(lines)
    found = []
    for folder, folders, files in os.walk(ROOT):
        here = Path(folder).relative_to(ROOT)
        folders[:] = [name for name in folders if not name.startswith(".") and name not in ("demo", "build", "dist")]
        found += [(here / name).as_posix() for name in files if not ignored.match_file((here / name).as_posix())]
    return found


@dataclass
class Built:
    """An image's file system in a folder."""

    root: Path
    final: Stage
    accounts: str = ""

    def inside(self, path: str) -> Path:
        """Where a path of the image lies."""
        return self.root / path.lstrip("/")

    def run(self, *words: str, cwd: Path, timeout: float = 300) -> subprocess.CompletedProcess[str]:
        """Run a command with the image's environment, and nothing of ours but the list of this machine's fonts."""
        environment = {name: _moved(value, self.root) for name, value in self.final.environment.items()}
        environment["PATH"] = environment["PATH"].replace("$PATH", "/usr/bin:/bin")
        environment["PYTHONDONTWRITEBYTECODE"] = ""  # else each program would compile torch, numba and pandas anew
        if "MPLCONFIGDIR" in environment:
            environment["MPLCONFIGDIR"] = matplotlib.get_cachedir()  # of which fonts this machine has is known there
        program = shutil.which(words[0], path=environment["PATH"]) or words[0]
        moved = [_moved(word, self.root) for word in words[1:]]
        return subprocess.run(
            [program, *moved], cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout
        )

    def megabytes(self) -> float:
        """Size of what the last stage takes over [MB]."""
        files = (path for path in self.inside("/opt/zeroshot").rglob("*") if path.is_file() and not path.is_symlink())
        return sum(path.stat().st_size for path in files) / 1e6


def build(described: Dockerfile, root: Path, python: str) -> Built:
    """Carry out a Dockerfile's steps below ``root`` with the interpreter ``python``.

    Raises
    ------
    RuntimeError
        With the step and what it printed, if one fails.
    """
    tools = root / "tools"
    for name in (*_FOLDERS, "tools"):
        (root / name).mkdir(parents=True, exist_ok=True)
    _tool(tools / "python", f'exec "{python}" "$@"')
    into = f'[ "$1 $3" = "--python install" ] && {{ it="$2"; shift 3; exec "{uv()}" pip install --python "$it" "$@"; }}'
    wheel = f'[ "$*" = "wheel --no-deps --wheel-dir $4 ." ] && exec "{uv()}" build --wheel --quiet --out-dir "$4" .'
    _tool(tools / "pip", f'{into}\n{wheel}\nexec "{sys.executable}" -m pip "$@"')
    _tool(tools / "groupadd", f'echo "group $@" >> "{root}/accounts"')
    _tool(tools / "useradd", f'echo "user $@" >> "{root}/accounts"')
    _tool(tools / "install", 'for w; do case "$w" in --*) ;; *) mkdir -p "$w" ;; esac; done')
    built = Built(root, described.final)
    sent = root / "context"  # as Docker does, everything at once before the first step
    for name in context():
        (sent / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, sent / name)
    for stage in described.stages:
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        environment |= {n: _moved(v, root) for n, v in stage.environment.items() if n not in ("PATH", "HOME")}
        environment |= uv_settings()
        environment.pop("PIP_NO_CACHE_DIR", None)  # what this saves is in the image only; here it would cost downloads
        environment["PATH"] = f"{tools}{os.pathsep}{os.environ['PATH']}"
        here = root
        for command in stage.commands:
            if command.cmd == "WORKDIR":
                here = Path(_moved(command.value[0], root))
            elif command.cmd == "COPY":
                _copy(command, sent, here)
            elif command.cmd == "RUN":
                done = subprocess.run(
                    ["sh", "-c", _moved(command.value[0], root)],
                    cwd=here,
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=False,
                )
                if done.returncode:
                    raise RuntimeError(f"{command.original}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
    built.accounts = (root / "accounts").read_text()
    return built


def _copy(command: dockerfile.Command, sent: Path, here: Path) -> None:
    *sources, target = command.value
    if command.flags:  # from the first stage, which has the same root here
        assert sources == [target], "a virtual environment stays at its path"
        return
    for source in sources:
        assert (sent / source).exists(), f"COPY {source}: .dockerignore leaves nothing of it"
        if (sent / source).is_dir():
            shutil.copytree(sent / source, here / target, dirs_exist_ok=True)
        else:
            shutil.copy(sent / source, here / target)


def _moved(text: str, root: Path) -> str:
    return _ABSOLUTE.sub(f"{root}/", text)


def _tool(path: Path, line: str) -> None:
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)
