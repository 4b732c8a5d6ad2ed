"""The notebooks run from their beginning, and are stored with what they draw."""

import importlib.util
from copy import deepcopy
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"docs/making/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_notebooks_run_and_draw_as_many_pictures_as_are_stored():
    """One after another without each other's names, in one process: so packages are imported once."""
    notebooks = script("notebooks")
    stored = [nbformat.read(path, as_version=4) for path in NOTEBOOKS]
    cells = [cell for one in stored for cell in (new_code_cell("%reset_selective -f ."), *deepcopy(one.cells))]
    made = notebooks.executed(new_notebook(cells=cells)).cells
    for path, one in zip(NOTEBOOKS, stored, strict=True):
        own, made = made[1 : 1 + len(one.cells)], made[1 + len(one.cells) :]
        drawn = notebooks.pictures(new_notebook(cells=own))
        assert len(drawn) == len(notebooks.pictures(one)) > 0, path.name
        assert path.with_suffix(".png").is_file()


def test_the_pages_have_every_notebook_with_its_code_and_pictures():
    pages, index = script("pages"), (ROOT / "docs/notebooks/index.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 4
    for path in NOTEBOOKS:
        made = pages.notebook_page(path)
        assert "import trainer" in made and "data:image/png;base64," in made
        assert f"]({path.name})" in index
