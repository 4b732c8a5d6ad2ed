"""What all HTML pages share: where their templates lie, and how numbers and shares are written."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined


def page_environment(decimals: int = 1) -> Environment:
    """Templates of this package with the filters ``number`` and ``percent``; a dash where there is no value.

    Parameters
    ----------
    decimals
        Of a percentage.
    """
    environment = Environment(
        loader=PackageLoader("diagnosis"), undefined=StrictUndefined, autoescape=True, trim_blocks=True
    )
    environment.filters["number"] = lambda value: "–" if value is None else f"{value:.4g}"
    environment.filters["percent"] = lambda value: "–" if value is None else f"{value:.{decimals}%}"
    return environment
