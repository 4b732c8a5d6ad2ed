"""Build fmus/MixedAirCO2.fmu from its C sources and its variables table.

    python fmus/build.py                       # all platforms
    python fmus/build.py --platforms native --nodes 9 --out fine.fmu

The same sources give the same bytes. Needs PyPI's `ziglang` as compiler; who only runs the FMU needs nothing.
"""

from __future__ import annotations

import argparse
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path

if __package__ in (None, ""):  # run as a script
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from fmus.render import render_header, render_model_description, render_tables
from fmus.tables import Table, load_table, source_files
from fmus.toolchain import BINARIES, compile_binary, native_platform

DEFAULT_OUT = Path(__file__).resolve().parent / "MixedAirCO2.fmu"
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def c_sources(table: Table) -> dict[str, str]:
    """All C files by name, those rendered from the table included."""
    sources = {p.name: p.read_text(encoding="utf-8") for p in source_files()}
    return sources | {"variables.h": render_header(table), "variables.c": render_tables(table)}


def build(out: Path = DEFAULT_OUT, nodes: int = 3, platforms: Iterable[str] = tuple(BINARIES)) -> Path:
    """Write the FMU with walls of `nodes` nodes and binaries for `platforms` (keys of BINARIES)."""
    table = load_table(nodes)
    return write_fmu(out, table, c_sources(table), platforms)


def write_fmu(out: Path, table: Table, sources: dict[str, str], platforms: Iterable[str]) -> Path:
    """Compile sources for each platform and write them with their description as an FMU."""
    files: dict[str, bytes] = {
        "modelDescription.xml": render_model_description(table).encode(),
        "resources/source.sha256": f"{table.source_hash}\n".encode(),
    }
    files |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    for key in platforms:
        path, content = compile_binary(BINARIES[key], sources, table.identifier)
        files[path] = content
    write_zip(out, files)
    return out


def write_zip(out: Path, files: dict[str, bytes]) -> None:
    """Write files sorted, with fixed time stamps and modes, modelDescription.xml first."""
    temporary = out.with_name(out.name + ".part")
    with zipfile.ZipFile(temporary, "w") as archive:
        for name in sorted(files, key=lambda n: (n != "modelDescription.xml", n)):
            info = zipfile.ZipInfo(name, _ZIP_TIME)
            info.create_system = 3  # Unix, wherever it is built
            info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, files[name], compresslevel=9)
    temporary.replace(out)


def main(argv: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Build the MixedAirCO2 FMU.")
    parser.add_argument("--nodes", type=int, default=3, help="nodes per opaque wall (default 3)")
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT, help="file to write")
    parser.add_argument(
        "--platforms",
        default="all",
        help=f"'all', 'native', or a comma-separated list of {', '.join(BINARIES)} (default all)",
    )
    args = parser.parse_args(argv)
    if args.platforms == "all":
        platforms = list(BINARIES)
    elif args.platforms == "native":
        platforms = [native_platform()]
    else:
        platforms = args.platforms.split(",")
        if unknown := sorted(set(platforms) - set(BINARIES)):
            parser.error(f"unknown platform {', '.join(unknown)}")
    out = build(args.out, args.nodes, platforms)
    sys.stdout.write(f"{out}  {out.stat().st_size / 1024:.0f} kB  {', '.join(platforms)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
