"""The pictures of the benchmark's page are drawn from its tables."""

import importlib.util
from pathlib import Path

import matplotlib.image
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("benchmark_pictures", ROOT / "docs/making/benchmark.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@pytest.fixture(scope="module")
def page():
    return (ROOT / "docs/benchmark.md").read_text(encoding="utf-8")


def test_tables_are_read_as_they_stand(script, page):
    rows = script.lines_of(page, "Table 4: estimators and context")
    assert len(rows) == 15
    for labels, points, limit in rows:  # each of these numbers stands in one row of the page
        value, low, high = points["unseen"]
        (row,) = [
            one
            for one in page.splitlines()
            if one.startswith(f"| {labels[0]} | {labels[1]} |") and f" [{low:.2f}, {high:.2f}] | {limit:.3f} |" in one
        ]
        assert f"| {value:.3f} ± " in row
    lacking = script.lines_of(page, "What each added sensor buys")
    assert [limit is None for _, _, limit in lacking] == [False, False, True, True, False]


def test_pictures_are_those_of_the_tables(script, page, tmp_path):
    """Pixel by pixel, but for what another version of the fonts does to letters."""
    script.draw(page, tmp_path)
    for path in sorted(tmp_path.iterdir()):
        made, kept = (matplotlib.image.imread(one) for one in (path, ROOT / "docs" / "pictures" / path.name))
        assert abs(made.shape[0] - kept.shape[0]) < 20 and abs(made.shape[1] - kept.shape[1]) < 20
        if made.shape == kept.shape:
            assert (abs(made - kept) > 0.2).mean() < 0.03
    assert len(list(tmp_path.iterdir())) == 3
