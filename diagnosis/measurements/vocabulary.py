"""Words of a building's log: what a column's name says of its quantity, its place and its unit.

The words, in six languages, stand in ``vocabulary.toml`` beside this module.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

SHORT = 3
"""Words of so many letters are parts of too many others: they count only where they stand alone."""


@dataclass(frozen=True)
class Meaning:
    """What a name says: quantities, places, roles (set point, mean, ...) and its unit; empty where it says nothing.

    ``words`` are those of the name that told.
    """

    quantities: frozenset[str] = frozenset()
    places: frozenset[str] = frozenset()
    roles: frozenset[str] = frozenset()
    unit: str = ""
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Words:
    """The vocabulary: of each plain word what it stands for, the longest first; of units how they are written."""

    kinds: dict[str, tuple[tuple[str, str], ...]]
    long: re.Pattern[str]
    units: dict[str, str]
    alone: dict[str, str]
    of: dict[str, tuple[str, ...]]
    weather: dict[str, tuple[str, ...]]


@lru_cache(maxsize=1)
def _words() -> _Words:
    raw: dict[str, Any] = tomllib.loads((Path(__file__).with_suffix(".toml")).read_text(encoding="utf-8"))
    kinds: dict[str, list[tuple[str, str]]] = {}
    for table in ("quantities", "places", "roles"):
        for meaning, words in raw[table].items():
            for word in words:
                kinds.setdefault(plain(word), []).append((table, meaning))
    longest = sorted((one for one in kinds if len(one) > SHORT), key=len, reverse=True)
    return _Words(
        kinds={word: tuple(one) for word, one in kinds.items()},
        long=re.compile("|".join(re.escape(one) for one in longest)),
        units={_key(word): unit for unit, about in raw["units"].items() for word in about["written"]},
        alone={_key(word): unit for unit, about in raw["units"].items() for word in about.get("alone", [])},
        of={unit: tuple(about["of"]) for unit, about in raw["units"].items()},
        weather={name: tuple(tags) for name, tags in raw["weather"].items()},
    )


def weather_meanings() -> dict[str, tuple[str, ...]]:
    """What pvlib's names of weather quantities stand for: a quantity, and a place or role if it has one."""
    return _words().weather


def measured_in(unit: str) -> tuple[str, ...]:
    """Quantities that are measured in a unit, as the vocabulary spells it; none if it is not known."""
    return _words().of.get(unit, ())


def plain(text: str) -> str:
    """Small letters without accents, words apart: ``TRoo_2`` becomes ``t roo 2``, ``Außen-Temp.`` ``aussen temp``."""
    text = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    letters = unicodedata.normalize("NFKD", text.casefold())
    return " ".join(
        re.sub(r"[^a-z0-9]+", " ", "".join(one for one in letters if not unicodedata.combining(one))).split()
    )


def _key(text: str) -> str:
    """A unit without what stands between its letters: ``W / m²``, ``W m-2`` and ``W_m_2`` become ``wm2``."""
    text = unicodedata.normalize("NFKC", text.strip()).casefold()
    return re.sub(r"[\s/^.*·_()\-]+", "", text)


def meaning_of(name: str, unit: str = "") -> Meaning:
    """What a column's name says, and a unit that is written elsewhere, as in a row below the names."""
    vocabulary = _words()
    found, rest, alone = unit_in(name, unit)
    if found in ("persons", "presence"):  # a unit, and a word for what is counted
        rest = name
    tags: dict[str, set[str]] = {"quantities": set(), "places": set(), "roles": set()}
    said = []
    for word in _said(plain(rest), vocabulary):
        said.append(word)
        for table, meaning in vocabulary.kinds[word]:
            tags[table].add(meaning)
    quantities = _narrowed(tags["quantities"], tags["roles"])
    if {"outdoor", "ventilation"} <= tags["places"]:  # outdoor air is a place, and what a fan brings
        tags["places"].discard("outdoor" if "flow" in {*quantities, *measured_in(found)} else "ventilation")
    if alone and not tags["quantities"] and re.search(r"[a-z]_[cf]$", name) and tags["places"] & {"room", "outdoor"}:
        quantities = {"temperature"}  # as in outdoor_c; "Room C" is a room
    if alone and not quantities & set(measured_in(alone)):
        alone = ""
    return Meaning(
        frozenset(quantities), frozenset(tags["places"]), frozenset(tags["roles"]), found or alone, tuple(said)
    )


def _narrowed(quantities: set[str], roles: set[str]) -> set[str]:
    """Quantities without those that another one includes: a dew point is a temperature, and so is a wet bulb's."""
    if quantities & {"dew_point", "wet_bulb", "sky"}:
        quantities = quantities - {"temperature"}
    if {"persons", "presence"} <= quantities:
        quantities = quantities - ({"presence"} if "count" in roles else {"persons"})
    if "flow" in quantities and "position" in quantities:
        quantities = quantities - {"flow"}
    return quantities


def _said(text: str, vocabulary: _Words) -> Iterator[str]:
    """Words of the vocabulary in a plain text: the longest that fit, then short ones that stand alone."""
    for match in vocabulary.long.finditer(text):
        yield match[0]
    for word in vocabulary.long.sub("  ", text).split():
        for one in (word, word.rstrip("0123456789")):
            if one in vocabulary.kinds and len(one) <= SHORT:
                yield one
                break


def unit_in(name: str, given: str = "") -> tuple[str, str, str]:
    """A unit that a name states, the name without it, and what a letter at its end may mean; empty where none."""
    vocabulary = _words()
    for text in [given, *re.findall(r"[\[({]([^\])}]*)[\])}]", name)]:
        key = _key(text)
        if unit := vocabulary.units.get(key, "") or vocabulary.alone.get(key, ""):
            return unit, re.sub(r"[\[({][^\])}]*[\])}]", " ", name), ""
    if match := re.search(r"(?:°|º|℃|℉)\s*([CF])?", name):
        unit = {"C": "degC", "F": "degF"}.get(match[1] or ("F" if "℉" in match[0] else "C"), "")
        return unit, re.sub(r"\bin\s*$", "", name.replace(match[0], " ")), ""
    for sign in (" / ", "/", ", ", " in ", " "):
        head, _, tail = name.rpartition(sign)
        unit = vocabulary.units.get(_key(tail), "") or ("" if sign == " " else vocabulary.alone.get(_key(tail), ""))
        if head and unit:
            return unit, head, ""
    parts = re.split(r"[\s_.\-]+", name)
    for count in (4, 3, 2, 1):
        if len(parts) >= count and (unit := vocabulary.units.get(_key("".join(parts[-count:])), "")):
            return unit, " ".join(parts[:-count]), ""
    last = _key(parts[-1]) if len(parts) > 1 else ""
    return "", name, vocabulary.alone.get(last, "")


def words_for(meanings: Iterable[str]) -> str:
    """Meanings for a sentence."""
    return " and ".join(one.replace("_", " ") for one in sorted(meanings))
