"""The variables table of the default FMU: read, expanded over array elements, numbered."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FMU_DIR = Path(__file__).resolve().parent / "MixedAirCO2"
SOURCE_DIR = FMU_DIR / "sources"
TABLE_FILE = FMU_DIR / "variables.toml"

KINDS = ("input", "output", "local", "parameter", "state")


@dataclass(frozen=True)
class Variable:
    """One scalar variable of the FMU, in the unit of its `unit`."""

    name: str
    kind: str  # input, output, local, parameter, state, derivative, boolean
    vr: int
    unit: str | None
    description: str
    start: float | bool | None = None
    nominal: float | None = None
    display: str | None = None
    low: float | None = None
    low_open: bool = False
    high: float | None = None
    high_open: bool = False
    base: str = ""  # C name, shared by the elements of an array
    first: bool = True  # whether this is the first element of its array


@dataclass(frozen=True)
class Table:
    """All variables, in order of value reference, with what else the build needs."""

    identifier: str
    description: str
    units: dict[str, dict[str, Any]]
    variables: tuple[Variable, ...]
    nodes: int
    layers: int
    event_indicators: int
    source_hash: str

    def kind(self, *kinds: str) -> list[Variable]:
        """Variables of the given kinds."""
        return [v for v in self.variables if v.kind in kinds]

    @property
    def guid(self) -> str:
        """GUID of the FMU: changes with any source, with the table, and with the number of nodes."""
        digest = hashlib.sha256(f"{self.source_hash} nodes={self.nodes}".encode()).hexdigest()
        return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def source_files() -> list[Path]:
    """The C sources, sorted by name."""
    return sorted(p for p in SOURCE_DIR.iterdir() if p.suffix in {".c", ".h"})


def source_hash() -> str:
    """sha256 over names and contents of the C sources and of the variables table."""
    digest = hashlib.sha256()
    for path in [*source_files(), TABLE_FILE]:
        content = path.read_bytes().replace(b"\r\n", b"\n")  # a checkout may have changed line ends
        digest.update(f"{path.name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def load_table(nodes: int = 3) -> Table:
    """Read the variables table for walls of `nodes` nodes (at least 2)."""
    return table_of(tomllib.loads(TABLE_FILE.read_text(encoding="utf-8")), nodes, source_hash())


def table_of(raw: dict[str, Any], nodes: int, digest: str) -> Table:
    """The table of what a variables file holds, for walls of `nodes` nodes; `digest` is the hash of the sources."""
    if nodes < 2:
        raise ValueError(f"a wall needs at least 2 nodes, not {nodes}")
    counts = {"nodes": nodes, "layers": raw["model"]["layers"]}
    variables: list[Variable] = []
    for kind in KINDS:
        for entry in raw[kind]:
            variables += _expand(entry, kind, len(variables), counts)
    for state in [v for v in variables if v.kind == "state"]:
        variables.append(_derivative(state, len(variables)))
    for vr, entry in enumerate(raw["boolean"]):
        variables += _expand(entry, "boolean", vr, counts)
    for v in variables:
        if v.unit is not None and v.unit not in raw["units"]:
            raise ValueError(f"{v.name}: unit {v.unit!r} is not in [units]")
    return Table(
        identifier=raw["model"]["identifier"],
        description=raw["model"]["description"],
        units=raw["units"],
        variables=tuple(variables),
        nodes=nodes,
        layers=counts["layers"],
        event_indicators=raw["model"]["event_indicators"],
        source_hash=digest,
    )


def _expand(entry: dict[str, Any], kind: str, vr: int, counts: dict[str, int]) -> list[Variable]:
    """The scalar variables of one entry of the table, numbered from value reference `vr`."""
    count = counts[entry["count"]] if "count" in entry else 1
    starts = entry.get("start")
    if not isinstance(starts, list):
        starts = [starts] * count
    if len(starts) != count:
        raise ValueError(f"{entry['name']}: {len(starts)} start values for {count} elements")
    base = entry["name"].replace("[{i}]", "").replace(".", "_")
    low, low_open = (entry["above"], True) if "above" in entry else (entry.get("min"), False)
    high, high_open = (entry["below"], True) if "below" in entry else (entry.get("max"), False)
    return [
        Variable(
            name=entry["name"].replace("{i}", str(i + 1)),
            kind=kind,
            vr=vr + i,
            unit=entry.get("unit"),
            description=entry["description"],
            start=starts[i],
            nominal=entry.get("nominal"),
            display=entry.get("display"),
            low=low,
            low_open=low_open,
            high=high,
            high_open=high_open,
            base=base,
            first=i == 0,
        )
        for i in range(count)
    ]


def _derivative(state: Variable, vr: int) -> Variable:
    unit = "1/s" if state.unit == "1" else f"{state.unit}/s"
    return Variable(
        name=f"der({state.name})",
        kind="derivative",
        vr=vr,
        unit=unit,
        description=f"Time derivative of: {state.description}",
        base=state.base,
        first=state.first,
    )
