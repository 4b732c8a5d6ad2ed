"""Failures that cost what they touch and not the answer: of a simulation, of matrix algebra, of one step of many.

Whoever tries one of several things (a start, a candidate, a move) catches :data:`FAILURES` there. Where a candidate is
followed through many steps, :func:`blamed` says whose failure it was. What an answer can do without is made by
:meth:`Unfinished.attempt`, which notes what is lacking and why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from shared.errors import SimulationError, TimeUp, ZeroshotError
from shared.logs import logger

FAILURES = (SimulationError, ArithmeticError, ValueError)
"""What one try may end with. A matrix that is singular (LinAlgError) or not finite is a ValueError to numpy and scipy,
an overflow an ArithmeticError. TimeUp is none of them: whoever is asked next has no time either."""
NO_TIME = "the time was up"
_log = logger(__name__)
_Made = TypeVar("_Made")


class CandidateError(SimulationError):
    """A candidate could not be followed to its end; ``name`` is the effect's, the text says why."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(why)
        self.name = name


def reason(error: Exception) -> str:
    """Why something failed, for a table; what a library says of its own matrices goes to the log."""
    if isinstance(error, ZeroshotError):
        return str(error)
    _log.debug("failed by %s: %s", type(error).__name__, error, exc_info=error)
    return "a matrix of its fit is singular or not finite"


@contextmanager
def blamed(names: Sequence[str]) -> Iterator[None]:
    """Say of a failure within whose it was: the last of the effects that were fitted, if there are any.

    Raises
    ------
    CandidateError
        In place of any of :data:`FAILURES`.
    """
    try:
        yield
    except FAILURES as error:
        if not names or isinstance(error, CandidateError):
            raise
        raise CandidateError(names[-1], reason(error)) from error


@contextmanager
def said_by(what: object) -> Iterator[None]:
    """Say of a failure within, which leaves no answer, what it was of.

    Raises
    ------
    SimulationError
        In place of any of :data:`FAILURES`.
    """
    try:
        yield
    except FAILURES as error:
        raise SimulationError(
            f"{what}: the model cannot be fitted to it from any start: {reason(error)}; expected one that can be"
            " simulated there. `diagnosis residuals` with --set tells which parameters can"
        ) from error


@dataclass
class Unfinished:
    """Steps that an answer lacks, and why, in the order in which they were given up."""

    why: dict[str, str] = field(default_factory=dict)

    def attempt(self, step: str, make: Callable[[], _Made], otherwise: _Made) -> _Made:
        """What a step makes, or something in its place where it fails or the time is up."""
        try:
            return make()
        except TimeUp:
            self.why[step] = NO_TIME
        except FAILURES as error:
            self.why[step] = reason(error)
        return otherwise
