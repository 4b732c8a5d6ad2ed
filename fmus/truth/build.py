"""Build fmus/truth/MixedAirCO2Truth.fmu, the room that the blind check calls true.

    python fmus/truth/build.py                       # all platforms
    python fmus/truth/build.py --platforms native --nodes 17 --out finest.fmu

It is the default FMU's own source with finer walls, with the variables of `variables.toml`, and with the changes of
`changes.toml`, which call `sources/truth.h`: so the truth follows the model wherever it is not meant to differ.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

if __package__ in (None, ""):  # run as a script
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fmus.build import write_fmu
from fmus.render import render_header, render_tables
from fmus.tables import TABLE_FILE, Table, source_files, source_hash, table_of
from fmus.toolchain import BINARIES, native_platform

HERE = Path(__file__).resolve().parent
DEFAULT_OUT = HERE / "MixedAirCO2Truth.fmu"
NODES = 9


def truth_table(nodes: int = NODES) -> Table:
    """The model's variables and the truth's own, for walls of ``nodes`` nodes."""
    raw = tomllib.loads(TABLE_FILE.read_text(encoding="utf-8"))
    extra = tomllib.loads((HERE / "variables.toml").read_text(encoding="utf-8"))
    for kind, entries in extra.items():
        if kind == "model":
            raw["model"] |= entries
        else:
            raw[kind] += entries
    digest = hashlib.sha256(source_hash().encode())
    for path in [HERE / "variables.toml", HERE / "changes.toml", HERE / "sources" / "truth.h"]:
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.name}\0{len(content)}\0".encode() + content)
    return table_of(raw, nodes, digest.hexdigest())


def truth_sources(table: Table) -> dict[str, str]:
    """All C files by name: the model's own, changed, and what is rendered from the table.

    Raises
    ------
    ValueError
        If a place that is to change is not there exactly once.
    """
    sources = {p.name: p.read_text(encoding="utf-8") for p in source_files()}
    for change in tomllib.loads((HERE / "changes.toml").read_text(encoding="utf-8"))["change"]:
        found = sources[change["file"]].count(change["old"])
        if found != 1:
            raise ValueError(f"{change['file']}: {change['old']!r} is there {found} times; expected once")
        sources[change["file"]] = sources[change["file"]].replace(change["old"], change["new"])
    sources["truth.h"] = (HERE / "sources" / "truth.h").read_text(encoding="utf-8")
    return sources | {"variables.h": render_header(table), "variables.c": render_tables(table)}


def build(out: Path = DEFAULT_OUT, nodes: int = NODES, platforms: Iterable[str] = tuple(BINARIES)) -> Path:
    """Write the FMU with binaries for ``platforms`` (keys of BINARIES)."""
    table = truth_table(nodes)
    return write_fmu(out, table, truth_sources(table), platforms)


def main(argv: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Build the truth of the blind check.")
    parser.add_argument("--nodes", type=int, default=NODES, help=f"nodes per opaque wall (default {NODES})")
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT, help="file to write")
    parser.add_argument("--platforms", choices=["all", "native"], default="all")
    args = parser.parse_args(argv)
    platforms = list(BINARIES) if args.platforms == "all" else [native_platform()]
    out = build(args.out, args.nodes, platforms)
    sys.stdout.write(f"{out}  {out.stat().st_size / 1024:.0f} kB  {', '.join(platforms)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
