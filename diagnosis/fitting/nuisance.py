"""What is not known about the inputs and not asked for either: who was in the room, and what came before the recording.

Both enter as pulses on inputs with a Gaussian prior, around which the simulation is linearised: with ``o`` the heights,

    outputs(z, o) = outputs(z, o*) + H(z) (o - o*),   o ~ N(mean, C),

so that they can be integrated out of a likelihood (:class:`.linear.Marginal`), and estimated where they are wanted.

- **Unknown occupancy** is the mean number of persons in each half hour, with mean and covariance of the description's
  random occupancy: only hours at which somebody may come carry unknowns. How many persons belong to the room scales
  everything, and so much that a Gaussian would not do: that headcount is an unknown of its own (:class:`Level`), and
  the pulses say which share of these persons is there.
- **Measured occupancy and replayed actuators** are known as means over the recording's steps; when within a step people
  came, or the heater was on, is not known.
- **History**: what an input was before the recording, against the first day that stands in for it, in a few spans
  that get longer the further back they lie. Its spread is that of the input in the recording itself from day to day.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array

from datagen.driving.tables import SNAP, InputTable
from diagnosis.recording import DAY

SPACING = DAY
"""Pulses are followed for so long [s]: what one does is over, or nearly, when the next one of a simulation comes."""
TURNED = 0.5 * DAY
"""The same of pulses that turn [s], at most: what takes back as much as it gives is over sooner."""


SPARSE = 0.05
"""Share of a factor that is not zero up to which products leave the zeros out."""
FIELDS = ("column", "begin", "end", "turns", "recorded", "mean", "followed")


@dataclass(frozen=True)
class Level:
    """What all pulses on one input, and its signal, are multiplied by: anything from ``low`` to ``high`` alike."""

    column: int
    low: float
    high: float


@dataclass(frozen=True)
class Nuisance:
    """Pulses on inputs and their prior.

    ``column`` (pulses,) places among the inputs; ``begin`` and ``end`` (pulses,) [s]; ``turns`` (pulses,): the second
    half of the pulse has the opposite sign; ``recorded`` (pulses,): within the recording, not before it; ``mean``
    (pulses,) and ``factor`` (pulses, unknowns) [unit of the input]: heights are ``mean + factor @ N(0, 1)``;
    ``followed`` (pulses,): from its beginning on a pulse is taken to do something for so long [s], by default
    :data:`SPACING`, or :data:`TURNED`.
    """

    column: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    turns: np.ndarray
    recorded: np.ndarray
    mean: np.ndarray
    factor: np.ndarray
    levels: tuple[Level, ...] = ()
    followed: np.ndarray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        if len(self.followed) != len(self.mean):
            object.__setattr__(self, "followed", np.where(self.turns, TURNED, SPACING))

    @property
    def size(self) -> int:
        """Number of pulses."""
        return len(self.mean)

    @cached_property
    def sd(self) -> np.ndarray:
        """Prior standard deviation of each height [unit of the input]."""
        return np.asarray(np.sqrt(np.sum(self.factor**2, axis=1)))

    @cached_property
    def _sparse(self) -> csr_array | None:
        """The factor, transposed, where nearly all of it is zero, as with unknowns of a pulse or a step each."""
        few = np.count_nonzero(self.factor) < SPARSE * self.factor.size
        return csr_array(self.factor.T) if few else None

    def by_unknown(self, response: np.ndarray, outputs: np.ndarray | None = None) -> np.ndarray:
        """A response to heights (outputs, steps, pulses), by the unknowns: (outputs, steps, unknowns).

        Where ``outputs`` (outputs,) are named, all others are zero.
        """
        made = np.zeros((*response.shape[:-1], self.factor.shape[1]))
        for k in range(len(response)) if outputs is None else np.flatnonzero(outputs):
            made[k] = response[k] @ self.factor if self._sparse is None else (self._sparse @ response[k].T).T
        return made

    @property
    def guessed(self) -> np.ndarray:
        """Pulses (pulses,) that are persons nobody counted: recorded, of an input with a level, and without a turn."""
        return self.recorded & ~self.turns & np.isin(self.column, [level.column for level in self.levels])

    @property
    def edges(self) -> np.ndarray:
        """All times at which a pulse begins, turns or ends [s]."""
        return np.unique(np.concatenate([self.begin, self.end, (0.5 * (self.begin + self.end))[self.turns]]))

    def added(self, table: InputTable, heights: np.ndarray) -> InputTable:
        """A table, whose knots hold :attr:`edges`, with pulses of these heights added [unit of the input]."""
        some = np.flatnonzero(heights)
        if not len(some):
            return table
        steps = np.zeros((len(table.time), len(table.names)))

        def step(times: np.ndarray, which: np.ndarray, by: np.ndarray) -> None:
            np.add.at(steps, (np.searchsorted(table.time, times - SNAP), self.column[which]), by)

        step(self.begin[some], some, heights[some])
        turning = some[self.turns[some]]
        step(0.5 * (self.begin + self.end)[turning], turning, -2 * heights[turning])
        step(self.end[some], some, np.where(self.turns[some], heights[some], -heights[some]))
        raised = np.cumsum(steps, axis=0)[:-1]
        jump = table.jump | (np.abs(steps) > 0).any(axis=1)
        jump[[0, -1]] = False
        return InputTable(table.names, table.time, table.left + raised, table.right + raised, jump)

    def only(self, keep: np.ndarray) -> Nuisance:
        """Some of the pulses (pulses,); the others stay at their prior mean, which must be zero."""
        factor = self.factor[keep]
        used = np.abs(factor).any(axis=0)
        fields = {name: getattr(self, name)[keep] for name in FIELDS}
        return replace(self, **fields, factor=factor[:, used])

    def shortened(self, lasting: float) -> Nuisance:
        """The same where pulses that turn are followed for no longer than ``lasting`` [s]."""
        return replace(self, followed=np.where(self.turns, np.minimum(self.followed, lasting), self.followed))

    def heights(self, unknowns: np.ndarray) -> np.ndarray:
        """Heights for standard normal unknowns, shape (pulses,): nobody can be fewer than none."""
        heights = self.mean + self.factor @ unknowns
        return np.where(self.guessed, np.maximum(heights, 0.0), heights)


def pulses_on(
    column: int,
    begin: np.ndarray,
    end: np.ndarray,
    factor: np.ndarray,
    *,
    turns: bool = False,
    recorded: bool = True,
    followed: np.ndarray | None = None,
) -> Nuisance:
    """Pulses of zero mean on one input that are alike; the arguments as of :class:`Nuisance`."""
    count = len(begin)
    return Nuisance(
        column=np.full(count, column),
        begin=begin,
        end=end,
        turns=np.full(count, turns),
        recorded=np.full(count, recorded),
        mean=np.zeros(count),
        factor=factor,
        followed=np.empty(0) if followed is None else followed,
    )


def pulses_between(edges: np.ndarray, column: int, factor: np.ndarray, followed: float) -> Nuisance:
    """Pulses of zero mean on one input, each from one of ``edges`` (pulses + 1,) [s] to the next, within a recording.

    ``factor`` (pulses, unknowns) [unit of the input]; ``followed`` [s].
    """
    return pulses_on(column, edges[:-1], edges[1:], factor, followed=np.full(len(edges) - 1, followed))


def no_nuisance() -> Nuisance:
    """Nothing unknown."""
    return pulses_on(0, np.empty(0), np.empty(0), np.empty((0, 0)))


def joined(*parts: Nuisance) -> Nuisance:
    """Several nuisances, or none, independent of each other."""
    parts = (no_nuisance(), *parts)
    fields = {name: np.concatenate([getattr(one, name) for one in parts]) for name in FIELDS}
    levels = tuple(level for one in parts for level in one.levels)
    return Nuisance(**fields, factor=block_diag(*(one.factor for one in parts)), levels=levels)
