"""A disk that is full, as far as this process can tell."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

SAID = "File too large"


@contextmanager
def small_disk(size: int = 16 * 1024) -> Iterator[None]:
    """No file may grow beyond ``size`` [bytes]: a write beyond it fails as on a full disk, with :data:`SAID`."""
    import resource  # Unix alone has it

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
