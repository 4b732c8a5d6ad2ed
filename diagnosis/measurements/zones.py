"""Time zones by the names that people write, and where their towns lie."""

from __future__ import annotations

import re
from datetime import UTC, timedelta, timezone, tzinfo
from difflib import get_close_matches
from importlib.resources import files
from zoneinfo import ZoneInfo, available_timezones

from shared.errors import RecordingError

_OFFSET = re.compile(r"([+-])(\d{2}):?(\d{2})$")


def find_zone(name: str) -> tzinfo:
    """A time zone by its IANA name, ``UTC``, or a fixed offset such as ``+01:00``.

    Raises RecordingError if there is none of that name; similar ones are named.
    """
    fixed = _OFFSET.fullmatch(name)
    if fixed and int(fixed[2]) < 24 and int(fixed[3]) < 60:
        sign = -1 if fixed[1] == "-" else 1
        return timezone(sign * timedelta(hours=int(fixed[2]), minutes=int(fixed[3])))
    if name.upper() in ("UTC", "Z", "GMT"):
        return UTC
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        near = zones_of_country(name) or get_close_matches(name, sorted(available_timezones()), n=3, cutoff=0.6)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise RecordingError(
            f"is {name!r}; expected an IANA name such as 'Europe/Amsterdam', 'UTC', or an offset such as '+01:00'{hint}"
        ) from None


def zones_of_country(name: str) -> list[str]:
    """Up to three zones of a country, by its English name or its two letters; none where it is no country.

    From the tables of the time zone database, as tzdata brings them; without it no country is known.
    """
    codes = {row[0] for row in _zone_table("iso3166.tab") if name.casefold() in (row[0].casefold(), row[1].casefold())}
    return [row[2] for row in _zone_table("zone.tab") if row[0] in codes][:3]


def latitude_of(zone: str) -> float | None:
    """The latitude [degree] of the town that an IANA zone is named after; None where the tables do not have it."""
    links = (row[0].split() for row in _zone_table("tzdata.zi") if row[0].startswith("L "))
    known = {name: target for _, target, name in links}  # "L Asia/Kolkata Asia/Calcutta"
    towns = {row[2]: row[1] for row in _zone_table("zone.tab")}
    found = towns.get(zone) or towns.get(known.get(zone, ""))
    if found is None:
        return None
    sign, degrees, minutes = found[0], int(found[1:3]), int(found[3:5])  # as +404251-0740023
    return (-1.0 if sign == "-" else 1.0) * (degrees + minutes / 60.0)


def _zone_table(name: str) -> list[list[str]]:
    """The rows of a table of the time zone database; none where tzdata is not installed."""
    try:
        text = (files("tzdata") / "zoneinfo" / name).read_text(encoding="utf-8")
    except (ModuleNotFoundError, FileNotFoundError):
        return []
    return [row.split("\t") for row in text.splitlines() if row and row[0] != "#"]
