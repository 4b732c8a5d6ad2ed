"""How pages write numbers and names, and that they fit a telephone."""

import re
from importlib.resources import files

import pytest


@pytest.mark.parametrize("name", ["gap", "calibration", "forecast", "blind_score"])
def test_tables_and_pictures_of_pages_scroll_within_the_page(name):
    """What is wider than a telephone would make the page so, and its sentences with it."""
    page = (files("diagnosis") / "templates" / f"{name}.html.j2").read_text(encoding="utf-8")
    wide = re.findall(r"<(?:table|img )", page)
    assert wide and len(wide) == len(re.findall(r'<div class="wide"><(?:table|img )', page))
    assert "common.css.j2" in page
