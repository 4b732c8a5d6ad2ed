"""Versions of what trains and evaluates."""

from __future__ import annotations

import platform
from collections.abc import Mapping

import numpy as np
import torch

import shared

DECIDING = ("zeroshot-fmu", "torch")
"""What another training or other scores may come from, though settings and data are the same."""


def versions_here() -> dict[str, str]:
    """Versions of Python and of the packages that a training runs on, by name."""
    return {
        "zeroshot-fmu": shared.__version__,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
    }


def other_version(found: Mapping[str, str]) -> tuple[str, str, str] | None:
    """The first of :data:`DECIDING` that is another one here: its name, the version found, ours; None if none is."""
    ours = versions_here()
    return next(
        ((name, found.get(name, "unknown"), ours[name]) for name in DECIDING if found.get(name) != ours[name]), None
    )
