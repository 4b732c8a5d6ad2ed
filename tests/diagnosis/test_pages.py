"""How pages write numbers and names, and that they fit a telephone."""

import re
from importlib.resources import files

import pytest

from diagnosis.pages import whole


@pytest.mark.parametrize("name", ["gap", "calibration", "forecast", "blind_score"])
def test_tables_and_pictures_of_pages_scroll_within_the_page(name):
    """What is wider than a telephone would make the page so, and its sentences with it."""
    page = (files("diagnosis") / "templates" / f"{name}.html.j2").read_text(encoding="utf-8")
    wide = re.findall(r"<(?:table|img )", page)
    assert wide and len(wide) == len(re.findall(r'<div class="wide"><(?:table|img )', page))
    assert "common.css.j2" in page


def inside(folder):
    return sorted(str(one.relative_to(folder)) for one in folder.rglob("*"))


def test_a_folder_that_is_there_is_written_into_without_its_neighbours(tmp_path, monkeypatch):
    """What lies above may be another file system, as of a volume of a container: no file moves between the two."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "other").write_text("kept")
    with whole(out) as draft:
        (draft / "report").write_text("done")
        assert inside(tmp_path)[0] == "out" and all(one.startswith("out") for one in inside(tmp_path))
    assert inside(tmp_path) == ["out", "out/other", "out/report"]
    with pytest.raises(ZeroDivisionError), whole(out) as draft:
        (draft / "report").write_text("half")
        _ = 1 / 0
    assert (out / "report").read_text() == "done" and inside(out) == ["other", "report"]
