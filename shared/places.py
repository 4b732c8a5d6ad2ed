"""Places to write to, looked at before long work rather than after it."""

from __future__ import annotations

import errno
import getpass
import os
import re
import stat
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from shared.errors import ZeroshotError

OF_A_DISK = {
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS),
    *(errno.EACCES, errno.EPERM, errno.ENOENT, errno.ENOTDIR),
}
"""Errors of the operating system that are those of a place to write to, not of what is written."""
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):(?=/|:)")
"""The beginning of a URL; a single letter is a drive of Windows."""


def is_url(place: object) -> bool:
    """Whether a place is a URL, such as ``s3://bucket/folder``, also one that became a Path."""
    return isinstance(place, str | Path) and bool(_URL.match(_text(place)))


def url_of(place: Path | str) -> str:
    """A URL as it was before it became a Path, which joins the slashes of ``https://``."""
    if isinstance(place, str):
        return place
    restored = re.sub(r"(?<![A-Za-z0-9+.-])([A-Za-z][A-Za-z0-9+.-]+):/(?!/)", r"\1://", _text(place))
    return re.sub(r"(?<![A-Za-z0-9+.-])(file|local)://", r"\1:///", restored)


def _text(place: Path | str) -> str:
    return place.as_posix() if isinstance(place, Path) else place


def check_folder(folder: Path, kind: type[ZeroshotError]) -> None:
    """Refuse a folder that could not be made or written into.

    Leaves nothing behind. Raises ZeroshotError of that kind, saying what is in the way.
    """
    if is_url(folder):
        raise kind(
            f"{url_of(folder)}: is a URL; expected a folder on this machine: `datagen copy` brings it there later"
        )
    if said := no_text(f"{folder.absolute()}"):
        raise kind(f"nothing can be written to a folder of such a name: {said}")
    full = Path(os.path.normpath(folder.absolute()))  # a link that leads nowhere stays one
    place = next(one for one in (full, *full.parents) if os.path.lexists(one))
    expected = "expected a folder, or a name for one that can be made"
    if not place.is_dir():
        what = "leads nowhere" if place.is_symlink() and not place.exists() else "is a file"
        raise kind(f"{folder}: nothing can be written there, because {place} {what}; {expected}")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{place.name}-", dir=place) as draft:
            # names that are too long for the file system
            Path(draft, full.relative_to(place)).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise kind(f"{folder}: nothing can be written there ({error.strerror}); {expected}") from None


def no_text(name: str) -> str:
    """Why a name of a file cannot be written into reports and given to libraries, and what to do; empty if it can."""
    try:
        name.encode(sys.getfilesystemencoding())
        return ""
    except UnicodeEncodeError:
        raw = os.fsencode(name)
    shown = raw.decode("ascii", "backslashreplace")
    try:
        raw.decode("utf-8")
        cure = "set PYTHONUTF8=1, or LC_ALL=C.UTF-8"
    except UnicodeDecodeError:
        cure = "rename it"
    return f"{shown} is no text in {sys.getfilesystemencoding()}, this process's encoding; {cure}"


def own_folder(name: str) -> Path:
    """A folder in the temporary folder that this user's processes share, and nobody else writes to.

    Raises OSError if it cannot be made, or somebody else made it: what is read from it is executed.
    """
    user = getpass.getuser() if os.name == "nt" else str(os.getuid())  # a container's user may have no name
    root = Path(tempfile.gettempdir(), f"zeroshot-fmu-{user}")
    root.mkdir(mode=0o700, exist_ok=True)
    found = root.lstat()
    if not stat.S_ISDIR(found.st_mode) or (os.name != "nt" and (found.st_uid != os.getuid() or found.st_mode & 0o022)):
        raise PermissionError(errno.EPERM, "others may write to it; remove it", str(root))
    folder = root / name
    folder.mkdir(exist_ok=True)
    return folder


def no_temporary_place(error: OSError, folder: Path | None = None) -> str:
    """Why the temporary folder, or one in it, cannot be written to, and what to do: the end of an error's text."""
    try:
        where = f"the temporary folder {folder or tempfile.gettempdir()}"
    except OSError:  # there is none at all, and the error lists where it was looked for
        where = "a temporary folder"
    return (
        f"{where} cannot be written to: {error.strerror or error}; expected free space there, or another folder: set"
        " TMPDIR to one"
    )


def give_matplotlib_a_place() -> None:
    """Where a home cannot be written to, have matplotlib keep its settings and fonts in a folder of this user's own.

    It would complain at each start, and look for fonts anew. Whoever has set ``MPLCONFIGDIR`` is left with that.
    """
    if "MPLCONFIGDIR" in os.environ:
        return
    try:
        for name, usual in (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache")):
            folder = Path(os.environ.get(name) or Path.home() / usual)
            with tempfile.TemporaryFile(dir=next(one for one in (folder, *folder.parents) if one.is_dir())):
                pass
    except (OSError, RuntimeError):  # RuntimeError: nobody's home
        with suppress(OSError):
            os.environ["MPLCONFIGDIR"] = str(own_folder("matplotlib"))
