"""From unknowns and a nuisance to a simulation: its parameters and its inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.tables import InputTable, Piecewise, merge
from diagnosis.effects.base import Effect
from diagnosis.fitting.drive import Drive
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.run import Run
from diagnosis.fitting.unknowns import Unknowns
from diagnosis.recording import Recording

TABLES = 64
"""Inputs that are remembered at most."""


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
        self, driven: Drive, stand_ins: dict[str, Piecewise], recording: Recording, *, replay: bool, tolerance: float
    ) -> None:
        self._drive, self._recording = driven, recording
        self._signals = {**driven.signals, **stand_ins}
        self._replay, self._tolerance = replay, tolerance
        self._tables: dict[tuple[object, ...], InputTable] = {}

    def run(self, unknown: Unknowns, nuisance: Nuisance, z: np.ndarray, heights: np.ndarray) -> Run:
        """The simulation for ``z`` (unknowns,) and nuisance ``heights`` (pulses,) before their level."""
        table = self._table(unknown.effects, unknown.amplitudes(z), nuisance)
        for level, factor in zip(nuisance.levels, unknown.level_values(z), strict=True):
            heights = np.where(nuisance.column == level.column, factor * heights, heights)
            scale = np.where(np.arange(len(table.names)) == level.column, factor, 1.0)
            table = replace(table, left=table.left * scale, right=table.right * scale)
        return Run(
            unknown.parameters(z),
            nuisance.added(table, heights),
            start=self._drive.begin,
            stop=self._drive.stop,
            record_from=self._drive.start,
            replay=self._replay,
            tolerance=self._tolerance,
        )

    def _table(self, effects: tuple[Effect, ...], amplitudes: tuple[float, ...], nuisance: Nuisance) -> InputTable:
        """All inputs but for the nuisance, with knots where its pulses begin and end."""
        key = (tuple(one.name for one in effects), amplitudes, nuisance.edges.tobytes())
        if key not in self._tables:
            signals = dict(self._signals)
            for effect, amplitude in zip(effects, amplitudes, strict=True):
                signals = effect.inputs(amplitude, signals, self._recording)
            # inputs in the order of the description
            ordered = {name: signals[name] for name in self._drive.signals}
            if len(self._tables) >= TABLES:
                self._tables.clear()
            self._tables[key] = merge(ordered, self._drive.begin, self._drive.stop).refined(nuisance.edges)
        return self._tables[key]
