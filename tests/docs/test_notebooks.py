"""The notebooks run from their beginning, and are stored with what they draw."""

from copy import deepcopy

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from tests.docs.documented import ROOT, script

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))
SMALLER = {
    "figure5": "SYSTEMS, HOURS, STEPS = 20, 48, 2",
    "own-fmu": "SYSTEMS, HOURS = 20, 48",
    "sensors": "CONTEXT, SETS = 24, {name: SETS[name] for name in [*SETS][::3]}",
}
"""Sizes that a notebook gets after its first piece of code, which sets them: what it draws is not kept."""
HERE = f"""
import sys
sys.path.append({str(ROOT)!r})
import pytest
from tests.datagen.faults import stay_in_this_process
stay_in_this_process(pytest.MonkeyPatch())
"""


@pytest.mark.slow
def test_notebooks_run_and_draw_as_many_pictures_as_are_stored():
    """One after another without each other's names, in one process: so packages are imported once."""
    notebooks = script("making/notebooks")
    stored = [nbformat.read(path, as_version=4) for path in NOTEBOOKS]
    cells, ends = [new_code_cell(HERE)], []
    for path, one in zip(NOTEBOOKS, stored, strict=True):
        own = deepcopy(one.cells)
        assert [cell.cell_type for cell in own[:2]] == ["markdown", "code"]
        cells += [new_code_cell("%reset_selective -f ."), *own[:2], new_code_cell(SMALLER.get(path.stem, "")), *own[2:]]
        ends.append(len(cells))
    made = notebooks.executed(new_notebook(cells=cells)).cells
    for path, one, begin, end in zip(NOTEBOOKS, stored, [0, *ends], ends, strict=False):
        drawn = notebooks.pictures(new_notebook(cells=made[begin:end]))
        assert len(drawn) == len(notebooks.pictures(one)) > 0, path.name
        assert path.with_suffix(".png").is_file()


def test_the_pages_have_every_notebook_with_its_code_and_pictures():
    index = (ROOT / "docs/notebooks/index.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 4
    for path in NOTEBOOKS:
        made = script("making/pages").notebook_page(path)
        assert "import trainer" in made and "data:image/png;base64," in made
        assert f"]({path.name})" in index
