"""Shapes over time: what drives an effect that comes and goes, and arithmetic on signals.

A shape covers the inputs' whole span, warm-up included: clocks run on, and what was measured is repeated before the
recording's start as its first day (:func:`diagnosis.recording.extended`, as with inputs).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
from scipy.special import expit

from datagen.driving.tables import SNAP, Piecewise
from diagnosis.recording import DAY, HOUR, Recording, extended
from shared.effects import DiurnalShape, PresenceShape, SeriesShape, Shape, ThresholdShape, TimetableShape
from shared.errors import RecordingError

RAMP = 60.0
"""How long a step takes where it is added to a signal of straight lines [s]."""

Function = Callable[[np.ndarray, np.ndarray], np.ndarray]


def span(inputs: dict[str, Piecewise], recording: Recording) -> tuple[float, float]:
    """First and last time that matter [s]: the earliest point of an input that varies, a day of margin each way."""
    begins = [signal.times[0] for signal in inputs.values() if len(signal.times) > 1]
    return float(min([recording.start, *begins])) - DAY, recording.stop + DAY


def shape_signal(
    shapes: Sequence[Shape],
    inputs: dict[str, Piecewise],
    recording: Recording,
    outputs: Sequence[str],
    means: Collection[str] = (),
) -> Piecewise:
    """The product of shapes over the span of the inputs; 1 without any.

    ``outputs``: the names of the recording's outputs, in their order; ``means`` of those that are means over steps.

    Raises
    ------
    RecordingError
        If a series that a shape follows is neither an input nor a measured output.
    """
    made = Piecewise.constant(1.0)
    for shape in shapes:
        made = joined(made, _one(shape, inputs, recording, outputs, means), np.multiply)
    return made


def _one(
    shape: Shape,
    inputs: dict[str, Piecewise],
    recording: Recording,
    outputs: Sequence[str],
    means: Collection[str],
) -> Piecewise:
    start, stop = span(inputs, recording)
    if isinstance(shape, TimetableShape):
        return timetable(shape, start, stop)
    if isinstance(shape, DiurnalShape):
        hours = np.arange(np.floor(start / HOUR), np.ceil(stop / HOUR) + 1)
        return Piecewise(hours * HOUR, np.cos(2 * np.pi * (hours - shape.peak) / 24))
    series = followed(shape.series, inputs, recording, outputs, means)
    return Piecewise(series.times, shape_value(shape, series.values), series.kind)


def shape_value(shape: ThresholdShape | PresenceShape | SeriesShape, x: np.ndarray) -> np.ndarray:
    """A shape that follows a series, at values ``x`` of the series (any shape)."""
    if isinstance(shape, ThresholdShape):
        return np.asarray(expit((x - shape.threshold) / shape.width))
    if isinstance(shape, PresenceShape):
        x = np.maximum(x, 0.0)
        return np.asarray(x / (x + shape.half))
    return np.asarray((x - shape.origin) / shape.reference)


def timetable(shape: TimetableShape, start: float, stop: float) -> Piecewise:
    """A timetable over ``start`` to ``stop`` [s since time zero]: steps between 0 and 1."""
    days = np.arange(np.floor(start / DAY) - 1, np.ceil(stop / DAY) + 1)
    weekend = days.astype(np.int64) % 7 >= 5
    days = days[{"all": np.ones_like(weekend), "weekday": ~weekend, "weekend": weekend}[shape.days]]
    times, changes = [np.array([start - 2 * DAY])], [np.zeros(1)]
    for first, last in shape.hours:
        times += [days * DAY + first * HOUR, days * DAY + (last + 24.0 * (last < first)) * HOUR]
        changes += [np.ones_like(days), -np.ones_like(days)]
    at, place = np.unique(np.concatenate(times), return_inverse=True)
    open_spans = np.cumsum(np.bincount(place, np.concatenate(changes)))
    return Piecewise(at, np.minimum(open_spans, 1.0), "previous")


def followed(
    name: str,
    inputs: dict[str, Piecewise],
    recording: Recording,
    outputs: Sequence[str],
    means: Collection[str] = (),
) -> Piecewise:
    """A series by its name: an input as it is, or a measured output with straight lines over its gaps.

    An instant is joined to the next by a straight line; a mean holds over its step.
    """
    if name in inputs:
        return inputs[name]
    values = recording.outputs[list(outputs).index(name)] if name in outputs else np.full(len(recording.time), np.nan)
    seen = np.isfinite(values)
    if not seen.any():
        raise RecordingError(f"{recording.path}: {name!r} was not measured; expected it for an effect that follows it")
    values = np.interp(recording.time, recording.time[seen], values[seen])
    lead = max(int(np.ceil((recording.time[0] - span(inputs, recording)[0]) / recording.step)), 0)
    return extended(recording, values, lead, held=name in means)


def joined(first: Piecewise, second: Piecewise, function: Function) -> Piecewise:
    """``function`` of two signals, of the first one's kind (of the second's where the first is constant).

    A step that joins straight lines becomes a ramp of :data:`RAMP`; straight lines that join steps become the means
    of their segments. Products of straight lines are exact at the points of both.
    """
    if len(first.times) == 1 and len(second.times) > 1:
        return Piecewise(
            second.times, function(np.full_like(second.values, first.values[0]), second.values), second.kind
        )
    if len(second.times) == 1:
        return Piecewise(first.times, function(first.values, np.full_like(first.values, second.values[0])), first.kind)
    if first.kind == "linear" and second.kind == "previous":
        second = ramped(second)
    elif first.kind == "previous" and second.kind == "linear":
        second = stepped(second)
    times = np.union1d(first.times, second.times)
    times = times[np.diff(times, prepend=-np.inf) > SNAP]
    return Piecewise(times, function(first.at(times), second.at(times)), first.kind)


def ramped(signal: Piecewise) -> Piecewise:
    """Steps as straight lines: each change takes :data:`RAMP`, or all of a step that is shorter."""
    changes = np.flatnonzero(np.diff(signal.values)) + 1
    if not changes.size:
        return Piecewise(signal.times[:1], signal.values[:1], "linear")
    begin = signal.times[changes]
    end = np.minimum(begin + RAMP, np.append(begin[1:], np.inf) - 2 * SNAP)
    times = np.stack([begin, end], axis=1).ravel()
    return Piecewise(times, np.stack([signal.values[changes - 1], signal.values[changes]], axis=1).ravel())


def stepped(signal: Piecewise) -> Piecewise:
    """Straight lines as steps that hold each segment's mean."""
    means = np.append(0.5 * (signal.values[:-1] + signal.values[1:]), signal.values[-1])
    return Piecewise(signal.times, means, "previous")
