"""One trial: a damaged file is read under limits, and what comes back is one of three things.

``read`` (nothing was wrong, or nothing that matters), ``refused`` (one of the project's errors with a sentence that
names the file), or anything else, which is a bug: another exception, a crash, no end, too much memory, a file written,
a program or a library started.
"""

import os
import re
import signal
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from shared.errors import ZeroshotError

SECONDS = 60
"""Of processor time, of this process, for one file."""
ROOM = 3 << 30
"""Bytes of address space that reading one file may add."""
_CHILD = "shared.netcdf_child"
_FORBIDDEN = {"os.system", "os.exec", "os.posix_spawn", "pickle.find_class", "ctypes.dlopen", "socket.connect"}


_LIBRARY = re.compile(
    r"\b[A-Z]\w*(Error|Exception|Warning)\b|could not convert|invalid literal|does(n't| not) match format|codec can't"
    r"|Error tokenizing|Expected \d+ fields|out of bounds|out of range for|list index|must be str"
    r"|must be a (timedelta|string)|has no attribute|unsupported operand|not subscriptable|cannot unpack"
    r"|values to unpack|Length mismatch|Unknown (string|datetime)|unconverted data|need at least one array"
)
"""What a library says of its own trouble, which tells nobody what is wrong with the file."""


@dataclass
class Reader:
    """Something that reads a file; ``file`` is that file in a folder that is whole.

    ``read`` gets the folder; ``seal`` makes the rest of the folder agree with the damaged file, as an attacker would;
    ``examples`` is how many a short test tries; ``named`` whether a refusal must name the file itself, ``own_words``
    whether it must be free of what a library says.
    """

    name: str
    folder: Path
    file: str
    read: Callable[[Path], Any]
    damage: Callable[[bytes, Random], bytes]
    seal: Callable[[Path], None] | None = None
    examples: int = 4
    named: bool = True
    own_words: bool = False

    def __post_init__(self) -> None:
        self.whole = (self.folder / self.file).read_bytes()
        self.others = {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}


class _Watch:
    """Hears of programs and libraries that are started, of pickles and of connections, while it is on."""

    on = False
    heard: list[str] = []

    def __call__(self, event: str, arguments: tuple) -> None:
        if not self.on:
            return
        if event in _FORBIDDEN or (event == "subprocess.Popen" and _CHILD not in map(str, arguments[1])):
            self.heard.append(f"{event} {arguments!r}"[:200])


_WATCH = _Watch()
sys.addaudithook(_WATCH)


class NoEnd(BaseException):
    """Reading takes too long."""


def _no_end(*_: Any) -> None:
    raise NoEnd


def read_whole(reader: Reader) -> None:
    """The file as it should be is read; otherwise a trial shows nothing."""
    reader.read(reader.folder)


def outcome_of(reader: Reader, content: bytes) -> str:
    """``read``, ``refused``, or what else happened, in words."""
    path = reader.folder / reader.file
    path.write_bytes(content)
    try:
        if reader.seal is not None:
            reader.seal(reader.folder)
        before = sorted(reader.folder.rglob("*"))
        said = _limited(reader)
        if sorted(reader.folder.rglob("*")) != before:
            return "left files behind"
        return said
    finally:
        for one, data in reader.others.items():
            if not one.exists() or one.read_bytes() != data:
                one.write_bytes(data)


def _limited(reader: Reader) -> str:
    _WATCH.heard.clear()
    before = signal.signal(signal.SIGVTALRM, _no_end)
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    set_room(ROOM)
    _WATCH.on = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what is said beside a result is not what is tried here
            reader.read(reader.folder)
        said = "read"
    except ZeroshotError as error:
        said = _judged(reader, str(error))
    except NoEnd:
        said = f"took more than {SECONDS} s"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"[:300]
    finally:
        _WATCH.on = False
        set_room(None)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
    return f"started {_WATCH.heard[0]}" if _WATCH.heard else said


def _judged(reader: Reader, text: str) -> str:
    if len(text) > 10_000:
        return f"a sentence of {len(text)} characters"
    if reader.own_words and (raw := _LIBRARY.search(text)):
        return f"a library's message ({raw.group()}) in place of a sentence: {text[:300]}"
    if reader.named and Path(reader.file).name not in text:
        return f"a sentence that does not name the file: {text[:300]}"
    return "refused"


def set_room(more: int | None) -> None:
    """Bound this process's address space to ``more`` bytes above what it has; None lifts the bound."""
    if not sys.platform.startswith("linux"):
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if more is None:
        resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
        return
    has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has + more, hard))


def spent() -> float:
    """Processor time of this process and of the children that it had [s]."""
    return sum(os.times()[:4])


def try_for(reader: Reader, seconds: float, seed: int, most: int) -> tuple[dict[str, int], list[str], float]:
    """Try damaged files for a while: counts of ``read`` and ``refused``, all else in words, the longest read [s]."""
    counts, other, longest = {"read": 0, "refused": 0}, [], 0.0
    end = spent() + seconds
    number = 0
    while spent() < end and number < most:
        content = reader.damage(reader.whole, Random(f"{seed} {reader.name} {number}"))
        began = spent()
        said = outcome_of(reader, content)
        longest = max(longest, spent() - began)
        number += 1
        if said in counts:
            counts[said] += 1
        else:
            other.append(f"input {number - 1}: {said}")
    return counts, other, longest
