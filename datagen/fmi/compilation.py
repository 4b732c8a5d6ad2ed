"""Compiled functions, kept on disk for the next process.

Numba keeps them beside their source or in the user's home. A container with a read-only root has neither, a node of a
cluster may lack the home, a quota may be used up: then they are kept in the temporary folder, or compiled anew in each
process. What cannot be kept, or read again, is no reason to stop.

Numba does not see that a file which a kept function took others or constants from has changed. So all are compiled anew
where any source of :data:`SOURCES` has.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from functools import cache, lru_cache
from logging import INFO, WARNING
from pathlib import Path
from typing import Any

import numba
from numba.core import config, sigutils
from numba.core.caching import FunctionCache, NullCache
from numba.core.ccallback import CFunc

from shared.logs import logger
from shared.places import own_folder
from shared.reading import why

_log = logger(__name__)
_settings: Any = config
_once = lru_cache(maxsize=2)(_log.log)  # in a process, with the same words


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """As :func:`numba.njit`, with numpy's floating-point errors, and kept."""

    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher = numba.njit(error_model="numpy", **options)(function)
        dispatcher._cache = _cache(function)
        return dispatcher

    return compiled if function is None else compiled(function)


def cfunc(signature: str) -> Callable[[Callable[..., Any]], Any]:
    """As :func:`numba.cfunc`, with numpy's floating-point errors, and kept."""

    def compiled(function: Callable[..., Any]) -> Any:
        options = {"error_model": "numpy"}
        callback: Any = CFunc(function, sigutils.normalize_signature(signature), locals={}, options=options)
        callback._cache = _cache(function)
        callback.compile()
        return callback

    return compiled


_LOST = (
    "compiled code is not kept in %s (%s), so each process takes some ten seconds to compile it; expected a folder that"
    " can be written to: set NUMBA_CACHE_DIR to one"
)


SOURCES = ("driving", "fmi", "simulating")
"""Folders of the package with compiled functions, and with all that they take from others."""


@cache
def built_on() -> str:
    """Hash of the sources of all compiled functions."""
    package = Path(__file__).parents[1]
    paths = sorted(path for folder in SOURCES for path in (package / folder).glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


class _Cache(FunctionCache):
    """Numba's own, which goes on without a file that cannot be read or written."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file._source_stamp = (self._cache_file._source_stamp, built_on())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was kept, or None."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # a file that was cut off raises whatever unpickling meets in it
            try:
                self.flush()
            except OSError:
                self._give_up(error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep it, if that can be done."""
        try:
            super().save_overload(sig, data)
        except Exception as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        self.disable()
        _once(WARNING, _LOST, Path(self.cache_path).parent, getattr(error, "strerror", None) or why(error))


def _cache(function: Callable[..., Any]) -> Any:
    """Where a function is kept: where numba would keep it, else in the temporary folder, else nowhere."""
    before = _settings.CACHE_DIR
    try:
        return _Cache(function)
    except (RuntimeError, UnicodeError):  # numba has no place; the name of one is not UTF-8
        pass
    try:
        _settings.CACHE_DIR = f"{own_folder('compiled')}"
        cache = _Cache(function)
        _once(INFO, "compiled code is kept in %s: NUMBA_CACHE_DIR names another folder", _settings.CACHE_DIR)
        return cache
    except (OSError, RuntimeError, UnicodeError) as error:
        _once(WARNING, _LOST, tempfile.gettempdir(), getattr(error, "strerror", None) or why(error))
        return NullCache()
    finally:
        _settings.CACHE_DIR = before
