"""MkDocs' hooks: pages that are made from the repository when the site is built.

- Markdown outside of ``docs/`` becomes a page, and any other file of the project that a page links to is shown as one:
  the pages' links are those of the repository, and work in both.
- ``<!-- text FILE -->`` is replaced by a file as it is, ``<!-- source FILE -->`` by a file shown as code.
- ``<!-- public PACKAGE -->`` is replaced by the reference of the package's public functions.
"""

from __future__ import annotations

import os
import re
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
ALWAYS = ("CHANGELOG.md", "CONTRIBUTING.md", "docker/README.md")
"""Markdown outside of ``docs/`` that the navigation names."""
LANGUAGES = {".toml": "toml", ".json": "json", ".py": "python", ".sh": "sh", ".yaml": "yaml", ".yml": "yaml"}
LANGUAGES |= {".c": "c", ".h": "c", ".xml": "xml", ".cff": "yaml", ".Dockerfile": "dockerfile"}
_LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]*)\]\((?P<target>[^)\s#:]+)(?P<anchor>#[^)\s]*)?\)")
_ROLE = re.compile(r":(?:func|class|meth|mod|data|attr):<code>~?")
_FILE = re.compile(r"<!-- (?P<kind>text|source) (?P<file>\S+) -->")
_NUMBERS = r"[-+±/%,.:;()\[\] \d–−]*"
_FIGURES = re.compile(rf"<td(?P<how>(?: style=[^>]*)?)>(?P<what>{_NUMBERS}\d{_NUMBERS}|<code>[^<]{{1,40}}</code>)</td>")
_PUBLIC = re.compile(r"<!-- public (?P<package>\w+) -->")


def place_of(uri: str) -> PurePosixPath:
    """Where a page's text lies in the repository: pages of the site that are not in ``docs/`` have its own paths."""
    return PurePosixPath("docs", uri) if (ROOT / "docs" / uri).exists() else PurePosixPath(uri)


def page_of(place: PurePosixPath) -> str | None:
    """The page of a file of the repository; None where there is no such file."""
    if (ROOT / place).is_dir():
        place = place / "README.md"
    if not (ROOT / place).is_file():
        return None
    if place == PurePosixPath("README.md"):
        return "index.md"
    if in_docs(place):
        return str(PurePosixPath(*place.parts[1:]))
    return str(place) if place.suffix == ".md" else f"{place}.md"


def linked(place: PurePosixPath, text: str) -> set[PurePosixPath]:
    """Files of the project outside of the pages' folder that a page links to."""
    targets = (resolve(place, one["target"]) for one in _LINK.finditer(_without_code(text)))
    return {one for one in targets if (ROOT / one).exists() and page_of(one) is not None and not in_docs(one)}


def in_docs(place: PurePosixPath) -> bool:
    """Whether MkDocs finds the file by itself."""
    return place.parts[0] == "docs" and place.suffix in {".md", ".png", ".svg", ".csv"}


def resolve(place: PurePosixPath, target: str) -> PurePosixPath:
    """A relative link of a file, as a path in the repository."""
    return PurePosixPath(os.path.normpath(place.parent / target))


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that lie outside of ``docs/``, and all that they link to."""
    todo = {PurePosixPath(one) for one in ALWAYS}
    for file in files.documentation_pages():
        todo |= linked(PurePosixPath("docs", file.src_uri), file.content_string)
    while todo:
        place = todo.pop()
        uri = page_of(place)
        if uri is None or files.get_file_from_path(uri) is not None:
            continue
        source = ROOT / place if (ROOT / place).is_file() else ROOT / place / "README.md"
        text = source.read_text(encoding="utf-8")
        inclusion = InclusionLevel.INCLUDED
        if source.suffix == ".md":
            todo |= linked(PurePosixPath(source.relative_to(ROOT).as_posix()), text)
        else:
            text = f"# {source.name}\n\n{_code(source, text)}\n"
            inclusion = InclusionLevel.NOT_IN_NAV
        files.append(File.generated(config, uri, content=text, inclusion=inclusion))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put in files and references, and turn the repository's links into the site's."""
    here = place_of(page.file.src_uri)
    markdown = _moved(markdown, here, page.file.src_uri)
    markdown = _FILE.sub(lambda found: _file(found["kind"], ROOT / found["file"]), markdown)
    return _PUBLIC.sub(lambda found: _reference(found["package"]), markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Docstrings name other functions as Sphinx has it; of ``:func:`name``` the name is left. Figures are marked."""
    return marked(_ROLE.sub("<code>", html))


def marked(html: str) -> str:
    """Mark a table's cells of figures or of a piece of code alone, which are not to be broken over lines."""
    return _FIGURES.sub(r'<td class="figures"\g<how>>\g<what></td>', html)


def _moved(markdown: str, here: PurePosixPath, uri: str) -> str:
    """Text of the repository's file ``here`` with its links as the page ``uri`` needs them."""

    def link(found: re.Match[str]) -> str:
        target = page_of(resolve(here, found["target"]))
        if target is None:
            return found[0]
        path = os.path.relpath(target, PurePosixPath(uri).parent)
        text = PurePosixPath(found["text"]).stem if found["text"].endswith(".md") else found["text"]
        return f"[{text}]({Path(path).as_posix()}{found['anchor'] or ''})"

    parts = re.split(r"(^```.*?^```)", markdown, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else _LINK.sub(link, part) for part in parts)


def _code(path: Path, text: str) -> str:
    """A file's text as a block of code."""
    return f"````{LANGUAGES.get(path.suffix, 'text')}\n{text.rstrip()}\n````"


def _file(kind: str, path: Path) -> str:
    """A file's text, as it is or as code."""
    text = path.read_text(encoding="utf-8")
    return text if kind == "text" else _code(path, text)


def _reference(package: str) -> str:
    """Mkdocstrings' directives for a package's public functions."""
    homes: dict[str, Any] = import_module(package)._HOMES
    return "\n".join(
        f'::: {home}.{name}\n    options:\n      heading: "{package}.{name}"\n      toc_label: "{name}"\n'
        for name, home in homes.items()
    )
