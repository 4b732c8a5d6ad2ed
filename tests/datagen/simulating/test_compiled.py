"""Compiled code that Numba keeps on disk is that of the source that is here."""

import ast
import hashlib
from pathlib import Path

import pytest

import datagen

PACKAGE = Path(datagen.__file__).parent
KEPT = sorted(
    path for path in PACKAGE.rglob("*.py") if "from datagen.fmi.compilation import" in path.read_text(encoding="utf-8")
)


def test_there_is_compiled_code():
    assert {"calls.py", "native.py", "newton.py", "cosimulation.py"} <= {path.name for path in KEPT}


def built_on(path: Path) -> str:
    """Hash of the modules of the package that a module imports, which have the hash of theirs in them."""
    imported = {
        node.module
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("datagen.")
    }
    files = sorted(PACKAGE.parent / f"{name.replace('.', '/')}.py" for name in imported)
    return hashlib.sha256(b"".join(one.read_bytes() for one in files)).hexdigest()[:16]


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_a_kept_file_changes_with_what_it_is_built_on(path):
    """Numba compiles a file anew where that file has changed, and takes what it calls from others as it was."""
    expected = f'BUILT_ON = "{built_on(path)}"\n'
    assert expected in path.read_text(encoding="utf-8"), f"{path}: expected {expected}"
