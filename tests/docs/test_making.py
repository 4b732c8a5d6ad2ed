"""What the site's pages are made of."""

import re
from pathlib import Path

from diagnosis import read_report

ROOT = Path(__file__).resolve().parents[2]


def test_the_samples_are_pages_that_stand_alone():
    folder = ROOT / "docs/samples"
    assert {one.stem for one in folder.glob("*.html")} == {"effect", "none_of_these", "no_gap", "forecast"}
    for path in folder.glob("*.html"):
        page = path.read_text(encoding="utf-8")
        assert len(page) < 2_500_000 and "data:image/png;base64," in page
        outside = re.sub("<script>.*?</script>", "", page, flags=re.S)
        assert not re.findall(r"""<script|(?:src|href)=["'](?!data:|#)""", outside), path.name
        assert "/tmp/" not in page and str(Path.home()) not in page, path.name
    assert read_report(folder / "effect.json").verdict == "effect"
