"""From unknowns and a nuisance to a simulation: its parameters and its inputs.

Effects see the inputs that drive the model. Persons whom nobody counted are pulses of the nuisance, so an effect that
follows or changes them is asked anew in each run, with that run's pulses and level in the signal.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from hashlib import blake2b
from typing import TypeVar

import numpy as np

from datagen.driving.tables import InputTable, Piecewise, merge
from diagnosis.effects.asked import inputs_of
from diagnosis.effects.base import Effect
from diagnosis.fitting.drive import Drive
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.run import Run
from diagnosis.fitting.unknowns import Unknowns
from diagnosis.recording import Recording

TABLES = 64
"""Inputs that are remembered at most, and so many changes of them: those that were asked for last."""

Signals = dict[str, Piecewise]
Key = TypeVar("Key")
Value = TypeVar("Value")


class Runs:
    """Makes simulations of one recording.

    Parameters
    ----------
    driven
        The inputs.
    stand_ins
        Signals in place of those of inputs that the nuisance describes.
    """

    def __init__(
        self, driven: Drive, stand_ins: Signals, recording: Recording, *, replay: bool, tolerance: float
    ) -> None:
        self._drive, self._recording = driven, recording
        # inputs in the order of the description
        self._signals = {name: {**driven.signals, **stand_ins}[name] for name in driven.signals}
        self._replay, self._tolerance = replay, tolerance
        self._tables: OrderedDict[tuple[bytes, ...], InputTable] = OrderedDict()
        self._changes: OrderedDict[tuple[object, ...], Signals] = OrderedDict()

    def run(self, unknown: Unknowns, nuisance: Nuisance, z: np.ndarray, heights: np.ndarray) -> Run:
        """The simulation for ``z`` (unknowns,) and nuisance ``heights`` (pulses,) before their level."""
        levels = unknown.level_values(z)
        persons: Signals = {}
        if any(unknown.amplitudes(z)) and nuisance.levels:
            driving = self._driving({}, nuisance, levels, heights)
            persons = {driving.names[one.column]: _held(driving, one.column) for one in nuisance.levels}
        changed = self._changed(unknown.effects, unknown.amplitudes(z), persons)
        return Run(
            unknown.parameters(z),
            self._driving(changed, nuisance, levels, heights),
            start=self._drive.begin,
            stop=self._drive.stop,
            record_from=self._drive.start,
            replay=self._replay,
            tolerance=self._tolerance,
        )

    def _driving(self, changed: Signals, nuisance: Nuisance, levels: np.ndarray, heights: np.ndarray) -> InputTable:
        """All inputs with the nuisance: persons of a changed signal are in it already, and so is their level."""
        table = self._table(changed, nuisance)
        for level, factor in zip(nuisance.levels, levels, strict=True):
            done = table.names[level.column] in changed
            heights = np.where(nuisance.column == level.column, 0.0 if done else factor * heights, heights)
            scale = np.where(np.arange(len(table.names)) == level.column, 1.0 if done else factor, 1.0)
            table = replace(table, left=table.left * scale, right=table.right * scale)
        return nuisance.added(table, heights)

    def _changed(self, effects: tuple[Effect, ...], amplitudes: tuple[float, ...], persons: Signals) -> Signals:
        """The inputs that effects change, of those that they see: with the persons of this run."""
        key = (tuple(one.name for one in effects), amplitudes, _digest(persons))
        if key not in self._changes:
            seen = {**self._signals, **persons}
            signals = seen
            for effect, amplitude in zip(effects, amplitudes, strict=True):
                signals = inputs_of(effect, amplitude, signals, self._recording)
            self._changes[key] = {name: signals[name] for name in seen if signals[name] is not seen[name]}
        return _latest(self._changes, key)

    def _table(self, changed: Signals, nuisance: Nuisance) -> InputTable:
        """All inputs but for the nuisance, with knots where its pulses begin and end."""
        key = (_digest(changed), nuisance.edges.tobytes())
        if key not in self._tables:
            signals = {**self._signals, **changed}
            self._tables[key] = merge(signals, self._drive.begin, self._drive.stop).refined(nuisance.edges)
        return _latest(self._tables, key)


def _held(table: InputTable, column: int) -> Piecewise:
    """An input of a table that holds its values between knots, as a signal."""
    values = table.left[:, column]
    first = np.append(True, values[1:] != values[:-1])
    return Piecewise(table.time[:-1][first], values[first], "previous")


def _digest(signals: Signals) -> bytes:
    """What tells signals from others."""
    digest = blake2b(digest_size=16)
    for name, signal in signals.items():
        digest.update(repr((name, signal.kind, len(signal.times))).encode())
        digest.update(signal.times.tobytes() + signal.values.tobytes())
    return digest.digest()


def _latest(known: OrderedDict[Key, Value], key: Key) -> Value:
    """A value that is known, which is the last to be forgotten from now on."""
    known.move_to_end(key)
    if len(known) > TABLES:
        known.popitem(last=False)
    return known[key]
