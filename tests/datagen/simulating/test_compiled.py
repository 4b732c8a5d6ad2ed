"""Compiled code that Numba keeps on disk is that of the source that is here."""

import ast
from pathlib import Path

import pytest

import datagen
from datagen.fmi import compilation

PACKAGE = Path(datagen.__file__).parent
KEPT = sorted(
    path for path in PACKAGE.rglob("*.py") if "from datagen.fmi.compilation import" in path.read_text(encoding="utf-8")
)


def test_all_that_compiled_functions_are_made_of_is_looked_at():
    assert {"calls.py", "native.py", "newton.py", "cosimulation.py"} <= {path.name for path in KEPT}
    for path in KEPT:
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        taken = [node.module.split(".") for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
        assert {one[1] for one in taken if one[0] == "datagen"} <= {*compilation.SOURCES}, path


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """How often a function was compiled, and not found, by processes that begin with these sources."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", f"{tmp_path}")
    compilation._settings.reload_config()  # Numba does so itself at the next function, once a variable has changed

    def run(sources):
        monkeypatch.setattr(compilation, "built_on", lambda: sources)
        made = compilation.njit(twice)
        assert made(21) == 42
        return sum(made.stats.cache_misses.values())

    yield run
    monkeypatch.undo()
    compilation._settings.reload_config()


def twice(number):
    return 2 * number


def test_a_kept_function_is_compiled_anew_where_another_source_has_changed(compiled):
    assert [compiled(sources) for sources in ("old", "old", "new", "new")] == [1, 0, 1, 0]


def test_the_sources_of_all_of_them_are_told_apart_by_their_content(tmp_path, monkeypatch):
    monkeypatch.setattr(compilation, "__file__", f"{tmp_path / 'fmi' / 'compilation.py'}")
    for folder in compilation.SOURCES:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "one.py").write_text("A = 1\n")
    before = compilation.built_on.__wrapped__()
    assert compilation.built_on.__wrapped__() == before
    (tmp_path / "simulating" / "one.py").write_text("A = 2\n")
    assert compilation.built_on.__wrapped__() != before
