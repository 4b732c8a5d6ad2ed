"""Write ``docs/licences.md``: the licences of all that an installation brings, by extra, as the packages state them.

    python docs/making/licences.py

Reads the metadata of what is installed here: run it where every extra is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = "zeroshot-fmu"
EXTRAS = ("", "datagen", "cluster", "trainer", "diagnosis", "app", "tables", "remote", "docs")
"""Extras whose packages a user gets; the first is no extra."""
PAGE = Path(__file__).resolve().parents[1] / "licences.md"
HEAD = """# Licences

The project itself is under the MIT licence: [LICENSE](../LICENSE). The default room's FMU is the project's own code.
What an installation brings besides, with everything that comes along, as the packages themselves state it. Made by
`python docs/making/licences.py` from the versions of `constraints.txt` on Linux; the packages' own files are what
counts. What only developers install (`dev`) is not listed.

The weather file of the default room comes with pvlib; the CVODE library, a part of SUNDIALS (BSD-3-Clause), comes with
fmpy.
"""


def needed(extra: str) -> set[str]:
    """Canonical names of all distributions that the project needs with an extra, however indirectly."""
    found: set[str] = set()
    todo = [(PROJECT, frozenset([extra]))]
    done: set[tuple[str, frozenset[str]]] = set()
    while todo:
        name, extras = todo.pop()
        if (name, extras) in done:
            continue
        done.add((name, extras))
        if name != PROJECT:
            found.add(name)
        for text in _installed(name).requires or []:
            one = Requirement(text)
            wanted = [{"extra": e} for e in (*extras, "")]
            if one.marker is None or any(one.marker.evaluate(e) for e in wanted):
                todo.append((canonicalize_name(one.name), frozenset(one.extras)))
    return found


def _installed(name: str) -> Distribution:
    try:
        return distribution(name)
    except PackageNotFoundError:
        raise SystemExit(f"{name}: is not installed; install every extra first") from None


def licence_of(name: str) -> str:
    """What a distribution's metadata say about its licence, in one line."""
    metadata = _installed(name).metadata
    expression = metadata.get("License-Expression")
    if expression:
        return str(expression)
    classifiers = [one for one in metadata.get_all("Classifier") or [] if one.startswith("License ::")]
    names = [one.rsplit(" :: ", 1)[-1] for one in classifiers if not one.endswith("OSI Approved")]
    if names:
        return " / ".join(names)
    lines = [line.strip() for line in str(metadata.get("License") or "").splitlines() if line.strip()]
    return lines[0] if lines else _licence_in_files(name)


def _licence_in_files(name: str) -> str:
    """The sentence of a distribution's licence files that names a licence, where its metadata name none."""
    one = _installed(name)
    for file in one.metadata.get_all("License-File") or []:
        for path in one.files or []:
            if path.name == Path(file).name and ".dist-info" in str(path):
                found = re.search(r"^.*\b(?:MIT|BSD|Apache|ISC|MPL)\b[^:.\n]*", path.read_text(), re.MULTILINE)
                return f"its licence file: {found[0].strip()}" if found else f"see its {path.name}"
    return "not stated"


def page(extras: Iterable[str] = EXTRAS) -> str:
    """The page: a row for each package, with the extras that bring it."""
    brought = {extra: needed(extra) for extra in extras}
    names = sorted(set().union(*brought.values()))
    heads = [extra or "(none)" for extra in brought]
    lines = [f"| package | licence | {' | '.join(heads)} |", "|---|---|" + ":-:|" * len(heads)]
    for name in names:
        marks = ["x" if name in packages else "" for packages in brought.values()]
        lines.append(f"| {name} | {licence_of(name)} | {' | '.join(marks)} |")
    return f"{HEAD}\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
