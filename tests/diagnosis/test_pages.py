"""How pages write numbers and names, and that they fit a telephone."""

import re
from importlib.resources import files

import pytest

from diagnosis.pages import long_named, within_sentence


def test_things_are_told_by_what_they_are_and_their_names():
    assert long_named("TRoo", {"TRoo": "air of the room"}) == "air of the room (TRoo)"
    assert [long_named("room", one) for one in ("", None, "room", {})] == ["room"] * 4
    assert [within_sentence(one) for one in ("Floor area", "CO2 rate", "U-value", "A leak", "")] == [
        "floor area",
        "CO2 rate",
        "U-value",
        "a leak",
        "",
    ]


@pytest.mark.parametrize("name", ["gap", "calibration", "forecast", "blind_score"])
def test_tables_and_pictures_of_pages_scroll_within_the_page(name):
    """What is wider than a telephone would make the page so, and its sentences with it."""
    page = (files("diagnosis") / "templates" / f"{name}.html.j2").read_text(encoding="utf-8")
    wide = re.findall(r"<(?:table|img )", page)
    assert wide and len(wide) == len(re.findall(r'<div class="wide"><(?:table|img )', page))
    assert "common.css.j2" in page
