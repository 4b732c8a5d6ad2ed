"""What the public functions return, as it looks in a notebook: a line, a table, a picture."""

from __future__ import annotations

from html import escape
from typing import Any

MOST_ROWS = 40
"""Rows of a table that a notebook shows."""


class Result:
    """A result with a short text, a table, and a picture where there is something to draw.

    A class that derives from it says what it is in :attr:`headline`, and makes its table in :meth:`to_dataframe`.
    """

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        raise NotImplementedError

    def to_dataframe(self) -> Any:
        """The result as a table (pandas)."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.headline})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """For notebooks."""
        table = self.to_dataframe()
        shown = table.to_html(max_rows=MOST_ROWS, float_format=lambda value: f"{value:.4g}", na_rep="")
        return f"<p><b>{escape(self.headline)}</b></p>{shown}"
