"""How pages write numbers and names, and that they fit a telephone."""

import re
from importlib.resources import files

import numpy as np
import pytest

from diagnosis.pages import long_named, percent, within_sentence
from diagnosis.pictures import at_day


def test_a_share_of_nothing_has_no_sign():
    assert [percent(one, 0) for one in (-0.004, -0.006, 0.004, None)] == ["0%", "-1%", "0%", "–"]
    assert percent(-0.0004) == "0.0%"


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


def test_a_date_has_a_time_where_it_is_not_midnight():
    zero = np.datetime64("2024-02-28T00:00")
    assert [at_day(zero, 86400.0 * day) for day in (1.0, 2.5)] == ["29 Feb", "1 Mar 12:00"]
    assert at_day(zero, 86400.0, minutes=True) == "29 Feb 00:00"


@pytest.mark.parametrize("name", ["gap", "calibration", "forecast", "blind_score"])
def test_tables_and_pictures_of_pages_scroll_within_the_page(name):
    """What is wider than a telephone would make the page so, and its sentences with it."""
    page = (files("diagnosis") / "templates" / f"{name}.html.j2").read_text(encoding="utf-8")
    wide = re.findall(r"<(?:table|img )", page)
    assert wide and len(wide) == len(re.findall(r'<div class="wide"><(?:table|img )', page))
    assert "common.css.j2" in page
