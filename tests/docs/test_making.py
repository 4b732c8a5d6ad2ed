"""What the site's pages are made of."""

import importlib.util
import re
from pathlib import Path

import pytest

from diagnosis import read_report

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("cell", "whole"),
    [
        ("0.011 ± 0.006 [-0.01, 0.02]", True),
        ("0.07 / 0.09 / 0.99 / 0.995", True),
        ("<code>--calm SHARE</code>", True),
        ("-", False),
        ("12 of 40 recordings", False),
    ],
)
def test_cells_of_figures_are_marked(cell, whole):
    spec = importlib.util.spec_from_file_location("pages_of_the_site", ROOT / "docs/making/pages.py")
    pages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pages)
    for how in ("", ' style="text-align: right;"'):
        made = pages.marked(f"<tr><td{how}>{cell}</td><td>word</td></tr>")
        assert (f'<td class="figures"{how}>{cell}</td>' in made) == whole
        assert "<td>word</td>" in made


def test_the_samples_are_pages_that_stand_alone():
    folder = ROOT / "docs/samples"
    assert {one.stem for one in folder.glob("*.html")} == {"effect", "none_of_these", "no_gap", "forecast"}
    for path in folder.glob("*.html"):
        page = path.read_text(encoding="utf-8")
        assert len(page) < 1_000_000 and "data:image/png;base64," in page
        assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page), path.name
        assert "/tmp/" not in page and str(Path.home()) not in page, path.name
    assert read_report(folder / "effect.json").verdict == "effect"
