"""Builds the FMU that misbehaves."""

from __future__ import annotations

import re
import zipfile
from functools import cache
from pathlib import Path

from fmus.toolchain import BINARIES, compile_binary, native_platform

HERE = Path(__file__).resolve().parent


@cache
def _binary(old: str = "", new: str = "") -> tuple[str, bytes]:
    """Its place in the archive and what it is: compiled once in a process."""
    text = (HERE / "faulty.c").read_text()
    assert old in text, old
    return compile_binary(BINARIES[native_platform()], {"faulty.c": text.replace(old, new) if old else text}, "faulty")


def build(folder: Path, change: tuple[str, str] = ("", "")) -> Path:
    """Write ``faulty.fmu`` into a folder, with one text of its source changed."""
    path, content = _binary(*change)
    with zipfile.ZipFile(folder / "faulty.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / "modelDescription.xml", "modelDescription.xml")
        archive.writestr(path, content)
    return folder / "faulty.fmu"


def describe(folder: Path, **fixed: float) -> Path:
    """Write a system description beside a built FMU, with values of ``fault``, ``above``, ``leak``."""
    text = (HERE / "system.toml").read_text()
    for name, value in fixed.items():
        text = re.sub(rf"(?m)^{name} = .*$", f"{name} = {float(value)!r}", text)
    path = folder / ("-".join(["system", *(f"{n}{v:g}" for n, v in fixed.items())]) + ".toml")
    path.write_text(text)
    return path
