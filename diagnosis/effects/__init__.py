"""The effect library: candidates for what the base model leaves out.

``library(system)`` gives the effects that a system's TOML declares and those that installed packages add.
"""

from __future__ import annotations

from diagnosis.effects.base import Effect, Nothing, clash, moved_in_time
from diagnosis.effects.library import ENTRY_POINTS, build, library

__all__ = ["ENTRY_POINTS", "Effect", "Nothing", "build", "clash", "library", "moved_in_time"]
