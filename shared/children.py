"""Child processes of this package's own modules: what may crash or never end is not done in this process.

A child finds modules where its parent does, and nowhere else: ``python -m`` by itself would look into the current
folder first, which may be one that came from elsewhere.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping


def command(module: str, *arguments: str) -> list[str]:
    """A command line that runs a module with this interpreter."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment(base: Mapping[str, str] | None = None) -> dict[str, str]:
    """Environment of a child: ``base``, or that of this process, with the places where this process finds modules."""
    places = os.pathsep.join(place or os.getcwd() for place in sys.path)
    return {**(os.environ if base is None else base), "PYTHONPATH": places}
