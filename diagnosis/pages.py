"""What all HTML pages share: where their templates lie, and how shares and names are written."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined

from shared.numbers import chance, number
from shared.variables import spaced

if TYPE_CHECKING:
    from pydantic import BaseModel

    from shared.system import System


WEATHER = {
    "temp_air": "outdoor temperature",
    "temp_dew": "outdoor dew point",
    "temp_sky": "sky temperature",
    "wind_speed": "wind speed",
    "ghi": "sun on the horizontal",
    "dni": "direct sun (beam)",
    "dhi": "diffuse sun",
    "poa_global": "sun on the facade",
    "opaque_cover": "cloud cover",
    "relative_humidity": "outdoor humidity",
}
"""Quantities of the weather, by pvlib's names, as people call them."""


def page_environment(decimals: int = 1) -> Environment:
    """Templates of this package; a dash for no value. Pages go to others, so files stand in them without their folders.

    Parameters
    ----------
    decimals
        Of a percentage.
    """
    environment = Environment(
        loader=PackageLoader("diagnosis"), undefined=StrictUndefined, autoescape=True, trim_blocks=True
    )
    environment.filters["number"] = number
    environment.filters["percent"] = lambda value: percent(value, decimals)
    environment.filters["chance"] = chance
    environment.filters["named"] = long_named
    environment.filters["spaced"] = spaced
    environment.filters["file_name"] = lambda path: Path(path).name
    return environment


def percent(value: float | None, decimals: int = 1) -> str:
    """A share as a percentage; zero without a sign."""
    if value is None:
        return "–"
    text = f"{value:.{decimals}%}"
    return text[1:] if text.startswith("-") and float(text[:-1]) == 0 else text


def within_sentence(text: str) -> str:
    """A description as it stands within a sentence: with a small letter, unless it begins with an abbreviation."""
    return text if text[1:2].isupper() or text[1:2] in "-0123456789" else f"{text[:1].lower()}{text[1:]}"


def long_named(name: str, long: Mapping[str, str] | str | None) -> str:
    """What something is, and in brackets the name that the model has for it; the name where nothing else is known.

    Parameters
    ----------
    long
        What it is, or that by name.
    """
    what = long.get(name) if isinstance(long, Mapping) else long
    return f"{what} ({name})" if what and what != name else name


@contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """A folder to write into that takes its name only when everything in it is written.

    An existing folder of that name keeps its other files; those written replace their namesakes.
    """
    # within a folder that is there: what is above it may be another file system, or another user's
    place = folder if folder.is_dir() else folder.parent
    place.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=place))
    try:
        yield draft
        folder.mkdir(exist_ok=True)
        for path in sorted(draft.iterdir()):
            path.replace(folder / path.name)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write_answer(folder: Path, name: str, report: BaseModel, page: str) -> None:
    """Write what was found as JSON and as HTML under one name into a folder, both or none."""
    with whole(folder) as draft:
        (draft / f"{name}.json").write_text(report.model_dump_json(indent=1) + "\n", encoding="utf-8")
        (draft / f"{name}.html").write_text(page, encoding="utf-8")


def input_labels(system: System) -> dict[str, str]:
    """What each input is, with the model's own name in brackets, by that name; or the name alone."""
    words = {one.name: WEATHER.get(one.column) for one in system.inputs if one.source == "weather"}
    words |= {one.name: "occupancy" for one in system.inputs if one.source == "occupancy"}
    return {one.name: long_named(one.name, words.get(one.name)) for one in system.inputs}
