"""The interface that FMI 2.0 and FMI 3.0 both implement: what is called before and after a simulation.

What is called during one, from compiled code, is in :mod:`datagen.fmi.calls`.
"""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
import weakref
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from html import unescape
from itertools import count
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.model_description import ModelDescription, ScalarVariable

from shared.errors import FmuError
from shared.reading import listed, short

_NUMBERS = count(1)
_REMEMBERED = 3
_WARNING = 1
_SEVERE = re.compile("assert|error|fatal", re.IGNORECASE)
DOUBLE_P = ctypes.POINTER(ctypes.c_double)

_PACKAGES = {
    "libgfortran.so.3": "the compatibility package libgfortran3, or a JModelica runtime that brings it",
    "libgfortran.so.4": "the package libgfortran4",
    "libgfortran.so.5": "the package libgfortran5",
    "libquadmath.so.0": "the package libquadmath0",
    "libgomp.so.1": "the package libgomp1",
}
"""Libraries that exporters link to and machines lack, and what brings them on Debian and its kin."""


class Interface(ABC):
    """One FMU's shared library in this process, with at most one instance.

    Raises FmuError if there is no binary for this platform.

    Attributes
    ----------
    functions
        Names of the C functions by their places in the plan of :mod:`datagen.fmi.calls`.
    errors, warnings
        What the FMU has said since it was instantiated: the last :data:`_REMEMBERED` different messages of each kind.
    """

    version: int
    functions: dict[int, str]
    latest: weakref.ref[Interface] | None = None
    """the one of this process that began last: whose words those are that come with no name that is known"""

    def __init__(self, path: Path, folder: Path, description: ModelDescription) -> None:
        self.path = path
        self.cosimulation = description.modelExchange is None
        kind = description.coSimulation if self.cosimulation else description.modelExchange
        self.errors: deque[str] = deque(maxlen=_REMEMBERED)
        self.warnings: deque[str] = deque(maxlen=_REMEMBERED)
        self.name = f"instance-{next(_NUMBERS)}"
        where = library(folder, kind.modelIdentifier)
        if not where.is_file():
            raise FmuError(f"{path}: no usable binary for {fmpy.platform_tuple}: {_instead(folder, where.name)}")
        before = os.getcwd()
        try:
            self.binary: Any = self.load(
                guid=description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=kind.modelIdentifier,
                instanceName=self.name,
                libraryPath=str(where),
            )
        except Exception as error:
            if hasattr(os, "ST_NOEXEC") and os.statvfs(folder).f_flag & os.ST_NOEXEC:
                raise FmuError(
                    f"{path}: its binary cannot be loaded: the temporary folder {folder.parent}, into which it was"
                    " unpacked, is mounted noexec; expected a folder where programs may run: set TMPDIR to one"
                ) from None
            if missing := missing_libraries(where):
                raise FmuError(f"{path}: its binary {'; it '.join(map(lacks, missing))}") from None
            raise FmuError(f"{path}: no usable binary for {fmpy.platform_tuple}: {error}") from None
        finally:
            os.chdir(before)  # fmpy's constructor changes the working directory

    def begin(self) -> None:
        """Forget what was said: an instance is about to be made, or reset."""
        self.errors.clear()
        self.warnings.clear()
        Interface.latest = weakref.ref(self)

    def hear(self, status: int, category: bytes | None, message: bytes | None) -> None:
        """Take in what the FMU says of a call that was not OK; any of it may be missing, and in any encoding.

        Some tools call everything OK, and say only by the category that it is an error. Others call an assertion that
        stops the simulation a warning.
        """
        about = text_of(category)
        words = text_of(message) or about
        severe = status > _WARNING or _SEVERE.search(words if status == _WARNING else about) is not None
        kept = self.errors if severe else self.warnings
        words = _without_tags(words)
        if words and (severe or status == _WARNING) and words not in kept:
            kept.append(words)

    def last_words(self) -> str:
        """The last errors that the FMU told; of one that told none the last warning; empty if it told nothing."""
        return " | ".join(self.errors) or (self.warnings[-1] if self.warnings else "")

    def address(self, function: str) -> int:
        """Address of one of the FMU's C functions, for example ``fmi2GetReal``."""
        return ctypes.cast(getattr(self.binary.dll, function), ctypes.c_void_p).value or 0

    @property
    def instance(self) -> int:
        """Address of the instance, 0 without one."""
        return ctypes.c_void_p(getattr(self.binary, "component", None)).value or 0

    @abstractmethod
    def load(self, **arguments: str) -> Any:
        """Load the shared library through fmpy."""

    @abstractmethod
    def instantiate(self) -> None:
        """Make an instance; raises any exception if that fails."""

    @abstractmethod
    def free(self) -> None:
        """Free the instance."""

    @abstractmethod
    def set_up(self, start: float, stop: float, tolerance: float) -> None:
        """Announce the simulation, before parameters and inputs are set."""

    @abstractmethod
    def enter_initialisation(self) -> None:
        """Enter initialisation mode; parameters and inputs have been set."""

    @abstractmethod
    def set_floats(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set variables of doubles."""

    @abstractmethod
    def set_value(self, variable: ScalarVariable, value: float | bool) -> bool:
        """Set a number or a boolean; false if the variable is neither."""

    @abstractmethod
    def new_discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """One iteration of event mode; see ``datagen.fmi.calls.new_discrete`` for the flags."""

    @abstractmethod
    def states(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Continuous states and their nominal values, shape (n,) each."""

    @abstractmethod
    def set_states(self, x: np.ndarray) -> None:
        """Set the continuous states."""

    def why_discarded(self) -> str:
        """More about a communication step that was refused, if the FMU can tell."""
        return ""


def text_of(raw: bytes | None) -> str:
    """A C string as one line: UTF-8, as FMI wants it, or what a tool on Windows takes for that."""
    try:
        text = (raw or b"").decode("utf-8")
    except UnicodeDecodeError:
        text = (raw or b"").decode("cp1252", "replace")
    return short(" ".join("".join(c if c.isprintable() else " " for c in text).split()))


def _without_tags(text: str) -> str:
    """A message without the tags of those tools that write it as XML."""
    if not text.startswith("<"):
        return text
    return " ".join(unescape(re.sub(r"<[^<>]*>|&##\d+;", " ", text)).split())


def library(folder: Path, identifier: str) -> Path:
    """The shared library for this machine.

    FMI 2.0 has no folder name for Linux on ARM, so that FMUs use that of FMI 3.0 there: it is looked into first.
    """
    names = [folder / "binaries" / one / f"{identifier}{fmpy.sharedLibraryExtension}" for one in _folders()]
    return next((name for name in names if name.is_file()), names[-1])


def missing_libraries(binary: Path) -> tuple[str, ...] | None:
    """Shared libraries that a binary needs and this machine lacks; None where there is no ``ldd``, or no binary."""
    if not sys.platform.startswith("linux") or not binary.is_file():
        return None
    try:
        told = subprocess.run(["ldd", str(binary)], capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.SubprocessError):
        return None
    return tuple(dict.fromkeys(line.split()[0] for line in told.stdout.splitlines() if "not found" in line))


def lacks(name: str) -> str:
    """A shared library that a binary needs and this machine lacks, and what brings it, to follow the binary's name."""
    return f"needs {name}, which this machine lacks; install {_PACKAGES.get(name, 'what brings it')}"


def _instead(folder: Path, name: str) -> str:
    """What an unpacked FMU has in place of the shared library of that name, and where it is expected."""
    binaries = folder / "binaries"
    found = sorted(one.name for one in binaries.iterdir() if one.is_dir()) if binaries.is_dir() else []
    sources = (folder / "sources").is_dir()
    has = f"binaries for {listed(found)}" if found else "sources only" if sources else "no binaries"
    also = ", and sources" if found and sources else ""
    cure = "compile its sources, or export it for this platform" if sources else "export it for this platform, too"
    expected = " or ".join(f"binaries/{one}/{name}" for one in dict.fromkeys(reversed(_folders())))
    return f"found {has}{also}; expected {expected}: {cure}"


def _folders() -> tuple[str, str]:
    return fmpy.platform_tuple, fmpy.platform
