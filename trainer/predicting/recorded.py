"""The last context window of a recording, as an estimator reads it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from shared.errors import RecordingError
from shared.reading import shown
from shared.schema import EPOCH, Method, method_fault, of_another
from shared.stretches import LONGEST, Steps, Stretch, bridge, chosen
from shared.times import read_recorded, recorded_begins, recorded_times
from trainer.predicting.readings import GapError, check_gaps, comparable, date_of
from trainer.reading.encoding import Encoding

BRIDGED = 2
"""Readings that may be missing in a row, of an output, and are put in on a straight line: an estimator has seen longer
gaps in training, and none that come one by one."""


class Window(NamedTuple):
    """The last context window of a recording.

    ``values`` float32 (systems, length, recorded) [the run's units], ``stamps`` (length,) [s since time zero, or since
    ``begins``], ``begins`` (systems,) [s since time zero], ``systems`` their indices (None for a recording without
    them), ``absent`` the optional channels that the recording lacks, or lacks too much of, ``bridged`` how many
    readings of each system were put in where single ones were missing, ``failed`` why a channel that the recording has
    is absent, a sentence each, ``passed`` why no longer window was read, if one was tried,
    ``longer`` the outputs over each longer window that was not read, longest first: float32 (systems, its length,
    recorded), not a number where nothing was read, and in all other channels.
    """

    values: np.ndarray
    stamps: np.ndarray
    begins: np.ndarray
    systems: list[int | None]
    absent: list[str]
    bridged: tuple[int, ...] = ()
    failed: tuple[str, ...] = ()
    passed: str | None = None
    longer: tuple[np.ndarray, ...] = ()


def read_window(
    given: Path | xr.Dataset, encoding: Encoding, system: str | None = None, stretch: Stretch | None = None
) -> Window:
    """The last context window of a recording: the longest of those that the run was trained on, and can read.

    It is of one stretch, the longest if none is given, in which the inputs that the run cannot do without have no gaps.
    Of several systems it is as long for each and lacks the same channels: what one lacks too much of is read of none.
    ``system`` is the one that the run estimates, said where a recording is of another and does not fit. Raises
    RecordingError if the recording does not fit the run; the sentence says in what, of the longest window that it has.
    """
    path, recording = read_recorded(given)
    try:
        first, after = _taken(path, recording, encoding, stretch)
        return _read(path, recording.isel(time=slice(0, after)), first, encoding)
    except GapError:
        raise
    except RecordingError as error:
        other = of_another(recording.attrs, system, "the run") if system is not None else ""
        raise RecordingError(f"{error}{other}") from None


def _taken(path: Path, recording: xr.Dataset, encoding: Encoding, stretch: Stretch | None) -> tuple[int, int]:
    """The steps that are taken: the inputs that the run cannot do without have no gaps there."""
    seconds = recorded_times(path, recording)
    known = {
        name: ~np.isnan(recording[name].values).reshape(-1, len(seconds)).any(axis=0)
        for name in encoding.recorded[encoding.outputs :]
        if name not in encoding.optional and name in recording and recording[name].dims[-1:] == ("time",)
    }
    if stretch in (None, LONGEST) and all(there.all() for there in known.values()):
        return 0, len(seconds)
    begins = recorded_begins(path, recording, recording.sizes.get("system", 1))
    if stretch is not None and (stretch.begin or stretch.end) and (begins != begins[0]).any():
        raise RecordingError(f"{path}: its systems begin on different days; expected --stretch in place of dates")
    ends = np.datetime64(EPOCH, "s") + np.round(seconds + begins[0]).astype("timedelta64[s]")
    return chosen(Steps(path, ends, encoding.step), known, stretch)


def _read(path: Path, known: xr.Dataset, begin: int, encoding: Encoding) -> Window:
    """The window of the stretch of a recording from step ``begin`` to its end, of which all before is ``known``."""
    recording, before = known.isel(time=slice(begin, None)), recorded_times(path, known)
    seconds = before[begin:]
    lengths = sorted((length for length in encoding.lengths if length <= len(seconds)), reverse=True)
    if not lengths:
        hours, least = len(seconds) * encoding.step / 3600, min(encoding.lengths)
        raise RecordingError(
            f"{path}: has {len(seconds)} samples ({hours:g} h at the run's step);"
            f" the run needs {least} ({least * encoding.step / 3600:g} h)"
        )
    first: GapError | None = None
    for length in lengths:
        try:
            window = _window(path, recording, seconds[-length:], encoding)
        except GapError as error:  # an outage long ago does not spoil the days since; a code or another unit does
            first = first or error
            continue
        more = [one for one in sorted(encoding.lengths, reverse=True) if length < one <= len(before)]
        if not more:
            return window
        longest = _outputs(path, known, before, encoding, len(window.systems), more[0])
        longer = tuple(longest[:, -one:] for one in more)
        short = (
            f"{path}: the stretch without gaps that is taken has {len(seconds)} samples; the next window has {more[-1]}"
        )
        return window._replace(passed=short if first is None else str(first), longer=longer)
    assert first is not None
    raise first


def _window(path: Path, recording: xr.Dataset, stamps: np.ndarray, encoding: Encoding) -> Window:
    """The window of a recording that has these time stamps [s since time zero], its last ones."""
    _check_step(path, recording, stamps, encoding)
    length = len(stamps)
    absent = [name for name in encoding.optional if name not in recording.data_vars]
    if lacking := [name for name in encoding.recorded if name not in {*recording.data_vars, *absent}]:
        read = {str(n): one for n, one in recording.data_vars.items() if one.dims in (("time",), ("system", "time"))}
        found = ", ".join(name for name, one in read.items() if "flag_meanings" not in one.attrs)
        raise RecordingError(
            f"{path}: has no {', '.join(map(repr, lacking))}, which the run reads; found {found or 'nothing over time'}"
        )
    methods: list[Method] | list[None] = encoding.methods or [None] * len(encoding.recorded)
    series = [
        np.full(length, np.nan, dtype=np.float32) if name in absent else _channel(path, recording, name, unit, method)
        for name, unit, method in zip(encoding.recorded, encoding.units, methods, strict=True)
    ]
    # a channel that all systems share may come without the dimension system
    values = np.stack(np.broadcast_arrays(*(one[..., -length:] for one in series)), axis=-1)
    indices: list[int | None] = [None]
    if values.ndim == 3:
        known = "system" in recording.coords and recording["system"].dtype.kind in "iu"
        indices = [int(i) for i in recording["system"].values] if known else list(range(len(values)))
    if not len(indices):
        raise RecordingError(f"{path}: its dimension system is empty; expected at least one system")
    values = values.reshape(-1, length, len(encoding.recorded))
    failed = []
    for k, name in enumerate(encoding.recorded):
        if name in absent:
            continue
        largest = encoding.largest_gap if k < encoding.outputs else 0.0
        try:
            check_gaps(path, name, values[..., k], indices, largest)
        except GapError as error:
            if name not in encoding.optional:
                raise
            values[..., k] = np.nan  # a meter that failed: the run does without it
            absent.append(name)
            failed.append(str(error))
    begins = recorded_begins(path, recording, len(values))
    values = comparable(path, values, begins[:, None] + stamps, indices, encoding)
    bridged = tuple(
        sum(int(bridge(one[:, k], BRIDGED).sum()) for k in range(encoding.outputs) if np.isnan(one[:, k]).any())
        for one in values
    )
    return Window(values, stamps, begins, indices, absent, bridged, tuple(failed))


def _outputs(
    path: Path, recording: xr.Dataset, seconds: np.ndarray, encoding: Encoding, systems: int, length: int
) -> np.ndarray:
    """The outputs that every recording has, over so many steps at its end, (systems, length, recorded).

    Each reading is put where its time stamp says, for rows may be missing; all else is not a number.
    """
    values = np.full((systems, length, len(encoding.recorded)), np.nan, dtype=np.float32)
    places = (seconds - seconds[-1]) / encoding.step + length - 1
    nearest = np.round(places)
    rows = np.flatnonzero((np.abs(places - nearest) <= 1e-3) & (nearest >= 0) & (nearest < length))
    methods: list[Method] | list[None] = encoding.methods or [None] * len(encoding.recorded)
    for k, name in enumerate(encoding.recorded[: encoding.outputs]):
        if name not in encoding.optional:
            readings = _channel(path, recording, name, encoding.units[k], methods[k])
            values[:, nearest[rows].astype(int), k] = readings[..., rows]
    return values


def _check_step(path: Path, recording: xr.Dataset, window: np.ndarray, encoding: Encoding) -> None:
    """Refuse time stamps [s since time zero] that are not the run's step apart."""
    if not np.isfinite(window).all():
        raise RecordingError(f"{path}: a time stamp is missing; expected one for each sample")
    steps = np.diff(window)
    wrong = np.flatnonzero(~(np.abs(steps - encoding.step) <= 1e-3 * encoding.step))
    if len(wrong):
        at = float(window[wrong[0]])
        dated = np.issubdtype(recording["time"].dtype, np.datetime64)
        where = date_of(at) if dated else f"{at:g} s"
        raise GapError(
            f"{path}: its step is {steps[wrong[0]]:g} s after {where};"
            f" the run was trained on steps of {encoding.step:g} s throughout"
        )


def _channel(path: Path, recording: xr.Dataset, name: str, unit: str, method: Method | None) -> np.ndarray:
    """One channel, (time,) or (system, time), in the run's unit and of its cell method, where that is known."""
    variable = recording[name]
    units = variable.attrs.get("units")
    if units is None:
        raise RecordingError(f"{path}: {name} has no units; the run expects {unit!r}")
    if not isinstance(units, str) or units != unit:
        raise RecordingError(f"{path}: {name} is in {shown(units)}; the run expects {unit!r}: convert it first")
    if method is not None and (fault := method_fault(variable, method, "for the run")):
        raise RecordingError(f"{path}: {name} {fault}")
    if variable.dims not in (("time",), ("system", "time")):
        raise RecordingError(
            f"{path}: {name} has dimensions ({', '.join(map(str, variable.dims))}); expected (time) or (system, time)"
        )
    with np.errstate(over="ignore"):  # beyond a float32 is infinite, and refused as such
        return variable.values.astype(np.float32)
