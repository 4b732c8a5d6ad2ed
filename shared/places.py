"""Places to write to, looked at before long work rather than after it."""

from __future__ import annotations

import errno
import getpass
import os
import stat
import tempfile
from pathlib import Path

from shared.errors import ZeroshotError


def check_folder(folder: Path, kind: type[ZeroshotError]) -> None:
    """Refuse a folder that could not be made or written into.

    Leaves nothing behind.

    Raises
    ------
    ZeroshotError
        Of that kind, saying what is in the way.
    """
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


def own_folder(name: str) -> Path:
    """A folder in the temporary folder that this user's processes share, and nobody else writes to.

    Raises
    ------
    OSError
        If it cannot be made, or somebody else made it: what is read from it is executed.
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
