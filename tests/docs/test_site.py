"""The documentation site: built with warnings as errors, complete, and in need of nobody else's servers."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow
PUBLIC = {
    "datagen": ["run", "simulate", "verify", "merge", "identifiability"],
    "trainer": ["fit", "evaluate", "predict", "load_run"],
    "diagnosis": ["import_recording", "calibrate", "forecast"],
}


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """The site, built as ``make docs`` does, and what the build said."""
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(
        words, cwd=ROOT, capture_output=True, text=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return folder


class Loaded(HTMLParser):
    """Addresses of what a browser loads by itself, and of where links lead."""

    def __init__(self):
        super().__init__()
        self.loads, self.links, self.names = [], [], set()

    def handle_starttag(self, tag, attrs):
        """Collect."""
        given = dict(attrs)
        if "id" in given:
            self.names.add(given["id"])
        if tag in {"script", "img", "iframe", "source", "video", "embed"} and given.get("src"):
            self.loads.append(given["src"])
        if tag == "link" and given.get("rel") not in {"canonical", "prev", "next"}:
            self.loads.append(given["href"])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        self.loads += re.findall(r"url\(([^)]+)\)", given.get("style") or "")


@pytest.fixture(scope="session")
def pages(site):
    """Every page, parsed."""
    parsed = {}
    for path in sorted(site.rglob("*.html")):
        parsed[path] = Loaded()
        parsed[path].feed(path.read_text(encoding="utf-8"))
    return parsed


def test_every_page_loads_from_the_site_alone(site, pages):
    assert len(pages) > 30
    for path, page in pages.items():
        for address in page.loads:
            parts = urlsplit(address.strip("\"'"))
            assert parts.scheme in {"", "data"} and not parts.netloc, f"{path.relative_to(site)}: {address}"
    for path in site.rglob("*.css"):
        for address in re.findall(r"(?:@import\s+|url\()[\"']?([^\"')\s]+)", path.read_text(encoding="utf-8")):
            assert not address.startswith(("http:", "https:", "//")), f"{path.relative_to(site)}: {address}"


def test_every_picture_and_every_page_that_is_linked_is_there(site, pages):
    for path, page in pages.items():
        for address in [*page.loads, *page.links]:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc or path.name == "404.html":
                continue
            target = (path.parent / parts.path).resolve() if parts.path else path
            assert target.is_file(), f"{path.relative_to(site)}: {address}"
            if parts.fragment and target in pages:
                known = parts.fragment in pages[target].names or parts.fragment.startswith("__")  # the theme's own
                assert known, f"{path.relative_to(site)}: {address}"


def test_the_reference_has_the_public_functions_with_their_parameters(site):
    for package, names in PUBLIC.items():
        text = (site / "reference" / f"{package}.html").read_text(encoding="utf-8")
        for name in names:
            assert re.search(rf"<h2[^>]*>\s*{package}\.{name}\b", text), f"{package}.{name}"
    assert "relative tolerance of the integrator" in _text(site / "reference/system.html")


def test_files_of_the_repository_are_on_their_pages(site):
    assert "fmu = " in _text(site / "docs/gallery/house/system.toml.html")


def _text(path):
    return re.sub(r"<[^>]+>", "", path.read_text(encoding="utf-8"))
