"""The notebooks run from their beginning, and are stored with what they draw."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"docs/making/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_draws_as_many_pictures_as_are_stored(path):
    notebooks = script("notebooks")
    stored = notebooks.nbformat.read(path, as_version=4)
    made = notebooks.executed(path)
    assert len(notebooks.pictures(made)) == len(notebooks.pictures(stored)) > 0
    assert path.with_suffix(".png").is_file()


def test_the_pages_have_every_notebook_with_its_code_and_pictures():
    pages, index = script("pages"), (ROOT / "docs/notebooks/index.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 4
    for path in NOTEBOOKS:
        made = pages.notebook_page(path)
        assert "import trainer" in made and "data:image/png;base64," in made
        assert f"]({path.name})" in index
