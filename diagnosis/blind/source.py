"""The sha256 of packages' source: what two programs made is not mixed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path


def source_sha256(*packages: str, counts: Callable[[str], bool] = lambda _: True) -> str:
    """The sha256 of all modules of packages, with their names; packages that are not installed have none.

    Parameters
    ----------
    counts
        Whether a module counts, by its path that begins with the package, with slashes.
    """
    whole = hashlib.sha256()
    for package in packages:
        found = find_spec(package)
        if found is None or found.origin is None:
            continue
        root = Path(found.origin).parent
        for path in sorted(root.rglob("*.py")):
            name = f"{package}/{path.relative_to(root).as_posix()}"
            if counts(name):
                whole.update(f"{name}\n".encode() + path.read_bytes())
    return whole.hexdigest()
