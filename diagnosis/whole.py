"""Results that are written in full or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shared.errors import RecordingError


@contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """A folder to write into that takes its name only when everything in it is written.

    An existing folder of that name keeps its other files; those written replace their namesakes.
    """
    # within a folder that is there: what is above it may be another file system, or another user's
    place = folder if folder.is_dir() else folder.parent
    place.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=place))
    try:
        yield draft
        folder.mkdir(exist_ok=True)
        for path in sorted(draft.iterdir()):
            path.replace(folder / path.name)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def check_writable(folder: Path) -> None:
    """Refuse a folder that :func:`whole` could not make or write into: before long work, not after it.

    Leaves nothing behind.

    Raises
    ------
    RecordingError
        Saying what is in the way.
    """
    full = Path(os.path.normpath(folder.absolute()))  # a link that leads nowhere stays one
    place = next(one for one in (full, *full.parents) if os.path.lexists(one))
    expected = "expected a folder, or a name for one that can be made"
    if not place.is_dir():
        what = "leads nowhere" if place.is_symlink() and not place.exists() else "is a file"
        raise RecordingError(f"{folder}: nothing can be written there, because {place} {what}; {expected}")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{place.name}-", dir=place) as draft:
            # names that are too long for the file system
            Path(draft, full.relative_to(place)).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder}: nothing can be written there ({error.strerror}); {expected}") from None
