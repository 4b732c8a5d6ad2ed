"""Cross-compilation of the FMU's C sources with the C compiler of PyPI's `ziglang`."""

from __future__ import annotations

import platform
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Target:
    """One compilation: a zig target triple, and what the file is called."""

    triple: str
    suffix: str


@dataclass(frozen=True)
class Binary:
    """One file in the FMU's `binaries`: a folder and the targets in it (several: a fat Mach-O)."""

    folder: str
    targets: tuple[Target, ...]


# FMI 2.0 knows no name for Linux on aarch64, so its folder has the name of FMI 3.0. The oldest glibc that the
# compiler offers, and an early macOS, so that the binaries load on old systems too.
BINARIES = {
    "linux64": Binary("linux64", (Target("x86_64-linux-gnu.2.17", ".so"),)),
    "aarch64-linux": Binary("aarch64-linux", (Target("aarch64-linux-gnu.2.17", ".so"),)),
    "win64": Binary("win64", (Target("x86_64-windows-gnu", ".dll"),)),
    "darwin64": Binary("darwin64", (Target("x86_64-macos.11.0", ".dylib"), Target("aarch64-macos.11.0", ".dylib"))),
}

# No contraction to fused multiply-add: the same numbers on every platform.
_FLAGS = ["-std=c99", "-O2", "-g0", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"]
_WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]

_CPU = {"x86_64": (0x01000007, 3), "aarch64": (0x0100000C, 0)}  # Mach-O cputype, cpusubtype
_FAT_ALIGN = 14  # 2**14: the page size of Apple silicon


def native_platform() -> str:
    """Key in BINARIES of the machine this runs on."""
    if sys.platform.startswith("linux"):
        return "aarch64-linux" if platform.machine().lower() in {"aarch64", "arm64"} else "linux64"
    return "win64" if sys.platform.startswith("win") else "darwin64"


def compile_binary(binary: Binary, sources: dict[str, str], name: str) -> tuple[str, bytes]:
    """Compile C sources (file name to text) and return (path in the FMU, content)."""
    built = [_compile(target, sources, name) for target in binary.targets]
    content = built[0] if len(built) == 1 else _fat_mach_o(binary.targets, built)
    return f"binaries/{binary.folder}/{name}{binary.targets[0].suffix}", content


def _compile(target: Target, sources: dict[str, str], name: str) -> bytes:
    with tempfile.TemporaryDirectory(prefix="fmu-build-") as folder:
        for file, text in sources.items():
            Path(folder, file).write_text(text, encoding="utf-8", newline="\n")
        out = name + target.suffix
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target.triple, *_FLAGS, *_WARNINGS]
        if "windows" not in target.triple:
            command.append("-fPIC")
        if "macos" in target.triple:
            command.append(f"-Wl,-install_name,@rpath/{out}")
        command += ["-s", "-o", out, *sorted(f for f in sources if f.endswith(".c"))]
        if "linux" in target.triple:  # zig's linkers for the others cannot optimise at link time
            command += ["-flto", "-lm"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if run.returncode != 0:
            raise RuntimeError(f"{' '.join(command)} failed:\n{(run.stdout + run.stderr)[:4000]}")
        return Path(folder, out).read_bytes()


def _fat_mach_o(targets: tuple[Target, ...], contents: list[bytes]) -> bytes:
    """Join Mach-O files of several architectures into one (the fat header is big-endian)."""
    align = 1 << _FAT_ALIGN
    header = struct.pack(">II", 0xCAFEBABE, len(contents))
    body = b""
    offset = align
    for target, content in zip(targets, contents, strict=True):
        cpu, subtype = _CPU[target.triple.split("-")[0]]
        header += struct.pack(">IIIII", cpu, subtype, offset, len(content), _FAT_ALIGN)
        padding = -len(content) % align
        body += content + b"\0" * padding
        offset += len(content) + padding
    return header.ljust(align, b"\0") + body
