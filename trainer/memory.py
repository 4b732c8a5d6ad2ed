"""What to say where there is not enough memory for what was asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from shared.errors import EstimatorError
from shared.reading import why


@contextmanager
def memory_for(what: str, *, kind: type[EstimatorError] = EstimatorError) -> Iterator[None]:
    """A context in which the end of memory, numpy's or torch's (which raises a RuntimeError), is raised as ``kind``.

    ``what`` takes the memory, and names the argument that says how much.
    """
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and "allocate memory" not in str(error):
            raise
        raise kind(f"not enough memory for {what} ({why(error)}); expected less") from None
