"""The schema of a shard: what a file of simulated systems holds, and how it is held to that.

A shard has dimensions (system, time). Outputs and inputs are float32, parameters float64, one value a system.
Every variable says its role (``parameter``, ``constant``, ``output``, ``input``), its units and, for series, its CF
cell method: ``time: point`` is an instant, ``time: mean`` the mean over the step that ends there (see ``time_bnds``).
Time runs from the beginning of each system's own record, which is ``start``. Where all records begin at time zero it is
a date; where they begin on days of their own it is an elapsed time, which no reader can take for one.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
import xarray as xr

from shared.errors import DatasetError
from shared.reading import newer, shown
from shared.system import System

SCHEMA_VERSION = "2.3"
"""2.0 added ``start``: a reader of 1.0 would take every record to begin at time zero. 2.1: where records begin on days
of their own, ``start`` is a date and ``time`` is none; the values are the same. 2.2: where uncertain constants were
drawn, a variable each says by what theirs were multiplied."""
EPOCH = "2001-01-01 00:00:00"
"""Time zero of every simulated year: 1 January of a common year that began on a Monday, local standard time."""
CLOCK = {
    "standard_name": "time",
    "units": f"seconds since {EPOCH}",
    "units_metadata": "leap_seconds: none",
    "calendar": "standard",
}
"""CF attributes of a time that is a date."""
STEP_END = {"long_name": "end of the output step, local standard time", "axis": "T", "bounds": "time_bnds"}
"""What else is said of the time of a record that is on the clock."""
CONTENT_HASH = "content_hash"
"""Global attribute of a shard that holds its own content hash."""
RECORDING = "a recording (NetCDF), which `diagnosis import` makes of a CSV"
"""What a reader of recordings expects."""
DISTURBANCES = "disturbances"
"""Variable of a shard: how many effects of the description act on a system."""
SPLITS = ("train", "validation", "test")
Method = Literal["point", "mean"]
"""CF cell method of a series over time."""
_METHODS = {"mean": "a mean over each step", "point": "an instant at each step's end"}


def methods_of(system: System) -> dict[str, Method]:
    """Cell method of each output and input, by name: an input that holds over a step is its mean."""
    methods: dict[str, Method] = {output.name: output.method for output in system.outputs}
    return methods | {one.name: "mean" if one.interpolation == "previous" else "point" for one in system.inputs}


def method_fault(series: xr.DataArray, method: Method, whose: str) -> str:
    """What is wrong with a series' cell method, to follow its name; empty if it states no other.

    Nothing is wrong with a series that never changes: its instants are its means. ``whose`` method it should be is how
    the sentence goes on, for example ``by the system description``.
    """
    said = re.search(r"\btime:\s*(\w+)", str(series.attrs.get("cell_methods", "")))
    if said is None or said[1] == method or len(np.unique(series.values)) <= 1:
        return ""
    found = _METHODS.get(said[1], f"the {said[1]} of each step")
    return f"is {found} (its cell_methods); {whose} it is {_METHODS[method]}"


def of_another(attributes: Mapping[Any, Any], name: str, whose: str) -> str:
    """A clause on a recording of another system than ``name``, which is ``whose``; empty if it is of that one."""
    said = attributes.get("system_name")
    if not isinstance(said, str) or said == name:
        return ""
    return f"; the recording is of the system {shown(said)}, and {whose} of {name!r}"


def split_of(root_seed: int, index: int) -> int:
    """Split of a system: of each ten consecutive systems eight train, one validates, one tests.

    It depends on the root seed and the index alone, so that extending a dataset moves nobody.
    """
    block, place = divmod(index, 10)
    order = np.random.default_rng(np.random.SeedSequence(root_seed, spawn_key=(0x5B17, block))).permutation(10)
    rank = int(np.flatnonzero(order == place)[0])
    return 0 if rank < 8 else rank - 7


def time_axis(step: float, count: int) -> np.ndarray:
    """Ends of the output steps [s since time zero], shape (count,)."""
    return step * np.arange(1, count + 1, dtype=np.float64)


def build_shard(
    system: System,
    *,
    indices: np.ndarray,
    root_seed: int,
    parameters: np.ndarray,
    outputs: np.ndarray,
    inputs: np.ndarray,
    attributes: dict[str, str],
    starts: np.ndarray | None = None,
    factors: np.ndarray | None = None,
    given: np.ndarray | None = None,
    disturbances: np.ndarray | None = None,
) -> xr.Dataset:
    """Put simulated systems into a dataset that follows the schema.

    Parameters
    ----------
    indices
        System indices, shape (systems,).
    parameters
        Shape (systems, parameters), in the order of the description [unit of each].
    outputs, inputs
        Shapes (systems, outputs, time) and (systems, inputs, time) [unit of each].
    attributes
        Further global attributes, for example hashes and versions.
    starts
        When each system's record begins, shape (systems,) [s since time zero]; zero if not given.
    factors
        By what each system's uncertain constants were multiplied, shape (systems, constants), in the order of the
        description [1]; none if they have their values.
    given
        Values of the given facts that are told, shape (systems, facts), in the order of the description [unit of each].
    disturbances
        How many effects of the description act on each system, shape (systems,); none are stored if not given.
    """
    step = system.experiment.step
    count = outputs.shape[2]
    time = time_axis(step, count)
    series = ("system", "time")
    methods = methods_of(system)
    variables: dict[str, tuple] = {
        "time_bnds": (("time", "bnds"), np.stack([time - step, time], axis=1)),
        "start": (
            ("system",),
            np.zeros(len(indices)) if starts is None else np.asarray(starts, dtype=np.float64),
            {"long_name": "beginning of the record, local standard time; its time runs from there", **CLOCK},
        ),
        "split": (
            ("system",),
            np.array([split_of(root_seed, int(i)) for i in indices], dtype=np.int8),
            {
                "long_name": "split that the system belongs to",
                "flag_values": np.arange(3, dtype=np.int8),
                "flag_meanings": " ".join(SPLITS),
            },
        ),
    }
    for k, parameter in enumerate(system.parameters):
        about = {"long_name": parameter.description or parameter.name, "units": parameter.unit, "role": "parameter"}
        values = parameters[:, k].astype(np.float64)
        # readers that follow CF take what lies beyond for missing: a value that was set need not be of the prior
        within = ((values >= parameter.min) & (values <= parameter.max)).all()
        span = {"valid_min": parameter.min, "valid_max": parameter.max} if within else {}
        variables[parameter.name] = (("system",), values, about | span)
    for k, constant in enumerate(system.uncertain if factors is not None else ()):
        assert factors is not None
        what = constant.description or constant.name
        about = {"long_name": f"{what}, as a multiple of its value", "units": "1", "role": "constant"}
        variables[constant.name] = (("system",), factors[:, k].astype(np.float64), about)
    for k, fact in enumerate(system.told if given is not None else ()):
        assert given is not None
        about = {"long_name": fact.description or fact.name, "units": fact.unit, "role": "given"}
        variables[fact.name] = (("system",), given[:, k].astype(np.float64), about)
    if disturbances is not None:
        about = {"long_name": "how many effects act", "units": "1", "role": "disturbance"}
        variables[DISTURBANCES] = (("system",), disturbances.astype(np.int8), about)
    for k, output in enumerate(system.outputs):
        attrs = {"long_name": output.long_name or output.name, "units": output.unit, "role": "output"}
        attrs["cell_methods"] = f"time: {methods[output.name]}"
        if output.standard_name:
            attrs["standard_name"] = output.standard_name
            if "temperature" in output.standard_name:
                attrs["units_metadata"] = "temperature: on_scale"
        variables[output.name] = (series, outputs[:, k].astype(np.float32), attrs)
    for k, one in enumerate(system.inputs):
        attrs = {"long_name": f"input {one.name}", "units": one.unit, "role": "input", "source": one.source}
        attrs["cell_methods"] = f"time: {methods[one.name]}"
        variables[one.name] = (series, inputs[:, k].astype(np.float32), attrs)
    coordinates = {
        "system": (("system",), np.asarray(indices, dtype=np.int64), {"long_name": "system index", "units": "1"}),
        "time": (
            ("time",),
            time,
            _ELAPSED if system.experiment.start[1] > 0 else STEP_END | CLOCK,
        ),
    }
    attrs = {
        "Conventions": "CF-1.11",
        "title": f"Simulated systems of {system.name}",
        "history": "simulated by zeroshot-fmu",
        "zeroshot_schema_version": SCHEMA_VERSION,
        "system_name": system.name,
        "system_hash": system.hash(),
        **attributes,
    }
    return xr.Dataset(variables, coordinates, attrs)


_ELAPSED = {
    "long_name": "end of the output step after the beginning of the record (start)",
    "units": "s",
    "bounds": "time_bnds",
}


def content_hash(arrays: Iterable[tuple[str, np.ndarray]]) -> str:
    """sha256 over names, types, shapes and values in the order of the names: independent of how a file is laid out."""
    digest = hashlib.sha256()
    for name, values in sorted(arrays, key=lambda pair: pair[0]):
        data = np.ascontiguousarray(values)
        digest.update(f"{name}:{data.dtype.str}:{data.shape};".encode())
        digest.update(data.tobytes())
    return digest.hexdigest()


def dataset_hash(dataset: xr.Dataset) -> str:
    """Content hash of a shard in memory."""
    return content_hash((str(name), variable.values) for name, variable in dataset.variables.items())


def check_version(found: str, where: str) -> None:
    """Refuse data of a newer major version.

    Raises
    ------
    DatasetError
        If this reader does not know the version.
    """
    if said := newer(found, int(SCHEMA_VERSION.split(".")[0])):
        raise DatasetError(f"{where}: {said}")


def newer_minor(found: str) -> str:
    """What to say of a schema of the same major version that has more than this one; empty if it has no more."""
    theirs, ours = (one.partition(".")[::2] for one in (found, SCHEMA_VERSION))
    if theirs[0] != ours[0] or not theirs[1].isdecimal() or int(theirs[1]) <= int(ours[1]):
        return ""
    return f"schema version is {shown(found)}, and this version of zeroshot-fmu writes {SCHEMA_VERSION}: update it"


FLAGS = {
    "missing": 1,
    "partly_covered": 2,
    "impossible_readings_left_out": 4,
    "stuck_readings_left_out": 8,
    "gap_interpolated": 16,
    "assumed": 32,
    "computed_from_other_quantities": 64,
}
"""Bits of the flag variables of a recording, in CF's ``flag_meanings``."""
MISSING, PARTLY, IMPOSSIBLE, STUCK, INTERPOLATED, ASSUMED, COMPUTED = FLAGS.values()
