"""Compiled code that Numba keeps on disk is that of the source that is here."""

from pathlib import Path

import datagen

PACKAGE = Path(datagen.__file__).parent
KEPT = sorted(
    path for path in PACKAGE.rglob("*.py") if "from datagen.fmi.compilation import" in path.read_text(encoding="utf-8")
)


def test_there_is_compiled_code():
    assert {"calls.py", "native.py", "newton.py", "cosimulation.py"} <= {path.name for path in KEPT}
