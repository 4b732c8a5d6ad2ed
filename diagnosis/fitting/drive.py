"""What drives the model over a recording: every input as a signal, measured or from the description.

Before its start the recording's first day is repeated, so that the simulation arrives at it warmed up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from datagen.driving.inputs import schedule_signal
from datagen.driving.tables import Piecewise
from diagnosis.fitting.meters import Cleared, cleared
from diagnosis.recording import HOUR, Recording, extended, whole_days
from shared.errors import RecordingError, SystemDescriptionError
from shared.system import System
from shared.variables import MeasuredInput

LOST = 0.05
"""Share of an actuator's readings that may be bridged without a word."""


@dataclass(frozen=True)
class Drive:
    """All inputs of a system over a recording and its warm-up.

    ``signals`` by name in the order of the description; ``assumed`` says of each input that was not measured what
    stands in for it; ``replayed`` names the outputs whose measurement drives the model, which therefore tell nothing;
    ``begin`` is the start of the warm-up, ``start`` and ``stop`` those of the recording [s]; ``meters`` by input: what
    was read of an actuator, where the description says how well.
    """

    signals: dict[str, Piecewise]
    assumed: dict[str, str]
    replayed: tuple[str, ...]
    begin: float
    start: float
    stop: float
    meters: dict[str, Cleared] = field(default_factory=dict)


def drive(
    system: System,
    recording: Recording,
    *,
    warm_up: float,
    replay: bool = False,
    noise: Mapping[str, float] | None = None,
    occupancy: str | None = None,
) -> Drive:
    """Collect the inputs over a recording and ``warm_up`` seconds before it.

    What was not measured is taken from the description: constants and schedules as they are, excitation as none, and
    actuators where the FMU has controllers of its own, which ``[replay]`` would switch off. The occupancy is left at
    zero where it was not measured: see :mod:`diagnosis.fitting.nuisance`.

    Parameters
    ----------
    noise
        Standard deviation of each output's meter [unit of the output], which is cleared from what is replayed; none if
        not given.
    occupancy
        ``unknown`` leaves persons at zero that were counted.

    Raises
    ------
    RecordingError
        If the weather was not measured, or an actuator that is to be replayed or has no controller in the FMU.
    SystemDescriptionError
        If actuators are to be replayed and the system has none.
    """
    if replay and not any(one.source == "measured" for one in system.inputs):
        raise SystemDescriptionError(
            f"{system.path}: inputs: none has the source 'measured', so that there is no actuator to replay; expected"
            " one, or no replay"
        )
    lead = round(warm_up / recording.step)
    begin = recording.start - whole_days(recording, lead) * recording.step
    signals: dict[str, Piecewise] = {}
    assumed: dict[str, str] = {}
    replayed = []
    meters: dict[str, Cleared] = {}
    for one in system.inputs:
        values = recording.inputs.get(one.name)
        if one.source == "measured":
            if replay:
                meter = _actuator(system, recording, one, noise or {})
                values = meter.values
                replayed.append(one.column)
                if lost := _lost(system, recording, one):
                    assumed[one.name] = lost
                if meter.courses:
                    meters[one.name] = meter
                if (values == one.value).all():
                    assumed[one.name] = f"{one.value:g} {one.unit} throughout"
            elif system.replay and (values is None or one.name in recording.assumed):
                assumed[one.name] = f"{one.value:g} {one.unit}, unused"  # the FMU's controllers act in its place
        if one.source == "occupancy" and occupancy == "unknown" and values is not None:
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "recorded, but not used: inferred with the prior of the description"
        elif values is not None:
            if one.name in recording.assumed and not (one.source == "measured" and replay):
                assumed.setdefault(one.name, recording.assumed[one.name])
            signals[one.name] = extended(recording, values, lead, held=one.interpolation == "previous")
        elif one.source == "weather" or (one.source == "measured" and not system.replay):
            raise RecordingError(f"{recording.path}: input {one.name!r} was not recorded; expected it in {one.unit}")
        elif one.source == "schedule":
            signals[one.name] = schedule_signal(system.schedules[one.schedule], begin, recording.stop)
            assumed[one.name] = f"schedule {one.schedule!r} of the description"
        elif one.source == "occupancy":
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "unknown, inferred with the prior of the description"
        elif one.source == "excitation":
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "none"
        else:
            signals[one.name] = Piecewise.constant(one.value)
            assumed.setdefault(one.name, f"{one.value:g} {one.unit} of the description")
    return Drive(signals, assumed, tuple(replayed), begin, recording.start, recording.stop, meters)


def crowd(system: System, recording: Recording, wanted: str | None) -> str:
    """Whether persons were counted: ``measured``, ``unknown``, or ``none`` for a system without.

    Raises
    ------
    RecordingError
        If they are to be measured and were not recorded; if they are unknown, and several inputs read them.
    """
    names = [one.name for one in system.inputs if one.source == "occupancy"]
    if not names:
        return "none"
    seen = all(name in recording.inputs for name in names)
    if wanted == "measured" and not seen:
        raise RecordingError(
            f"{recording.path}: {', '.join(names)} was not recorded; expected it, or occupancy unknown"
        )
    if wanted not in (None, "measured", "unknown"):
        raise ValueError(f"occupancy is {wanted!r}; expected 'measured', 'unknown' or None")
    found = wanted or ("measured" if seen else "unknown")
    if found == "unknown" and len(names) > 1:
        # each would be given a crowd of its own, where a simulated system has one for all of them
        raise RecordingError(
            f"{recording.path}: persons were not counted or are not to be used, and {system.path} has"
            f" {len(names)} inputs for them ({', '.join(names)}); expected them recorded and used, or one such input"
        )
    return found


def driving(system: System, recording: Recording) -> tuple[str, ...]:
    """Outputs whose readings drive the model in replay: those of actuators that have no column of their own that moves.

    Such a column has no gaps (:func:`diagnosis.recording.read_recording`).
    """
    return tuple(
        one.column
        for one in system.inputs
        if one.source == "measured" and one.column in system.output_names and not _has_own(recording, one)
    )


def _has_own(recording: Recording, one: MeasuredInput) -> bool:
    """Whether an actuator was logged under its own name: what rests at the description's value throughout was not."""
    own = recording.inputs.get(one.name)
    return own is not None and not (own == one.value).all()


def _actuator(system: System, recording: Recording, one: MeasuredInput, noise: Mapping[str, float]) -> Cleared:
    """A measured actuator: its own column, or the output that measures it, cleared of the meter's noise."""
    own = recording.inputs.get(one.name)
    if own is not None and _has_own(recording, one):
        return cleared(own, noise.get(one.column, 0.0), recording.step)
    if one.column in system.output_names:
        readings = recording.outputs[system.output_names.index(one.column)]
        if np.isfinite(readings).any():
            return cleared(readings, noise.get(one.column, 0.0), recording.step)
    elif own is not None:  # the system has no such output: its recordings cannot say more than this
        return Cleared(own)
    raise RecordingError(f"{recording.path}: {one.name!r} (column {one.column!r}) was not recorded; replay needs it")


def _lost(system: System, recording: Recording, one: MeasuredInput) -> str:
    """A sentence on an actuator's meter of which much was lost; nothing if little was."""
    if one.column not in system.output_names or _has_own(recording, one):
        return ""
    gone = ~np.isfinite(recording.outputs[system.output_names.index(one.column)])
    if gone.mean() <= LOST:
        return ""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
    longest = float((edges[1::2] - edges[::2]).max()) * recording.step / HOUR
    return f"{gone.mean():.0%} of its meter's readings, bridged; the longest loss is {longest:.3g} h"
