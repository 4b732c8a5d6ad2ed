"""Unpacking an FMU: its archive and its model description are held to what an FMU can be before anything uses them.

Nothing is written outside the folder, no links, no more than :data:`MOST` bytes; no document type is read, so that no
entity expands and no other file or address is looked up. The binaries inside are another matter: running one is running
a program.
"""

from __future__ import annotations

import shutil
import stat
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from xml.parsers import expat

from shared.errors import FmuError
from shared.places import OF_A_DISK, no_temporary_place
from shared.reading import MIB, shown, why

DESCRIPTION = "modelDescription.xml"
_READ = (DESCRIPTION, "sources/buildDescription.xml")
"""What fmpy reads of an FMU."""
MOST = 2048 * MIB
"""Bytes of all files of an FMU."""
MOST_FILES = 100_000
MOST_DESCRIPTION = 256 * MIB
DEEPEST = 50
"""Elements within each other; FMI nests eight."""
_CHUNK = MIB


def unpack_archive(path: Path, folder: Path) -> None:
    """Unpack an FMU into an empty folder; nothing of one that is refused stays there.

    Raises FmuError if it is no archive, damaged or encrypted, or one of its files would be a link, lie elsewhere or be
    too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _check_members(path, members)
            for member in members:
                _write(path, archive, member, folder)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, FmuError) or not isinstance(error, Exception):
            raise
        if isinstance(error, OSError) and error.errno in OF_A_DISK:
            raise FmuError(f"{path}: cannot be unpacked: {no_temporary_place(error, folder.parent)}") from None
        # zipfile and zlib raise whatever they meet in a damaged archive
        raise FmuError(f"{path}: not a readable FMU: {why(error)}") from None


def _check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    if len(members) > MOST_FILES:
        raise FmuError(f"{path}: holds {len(members)} files; expected an FMU, of at most {MOST_FILES}")
    declared = sum(member.file_size for member in members)
    if declared > MOST:
        raise FmuError(f"{path}: unpacks to {declared / MIB:.0f} MiB; expected an FMU, of at most {MOST / MIB:.0f} MiB")
    seen: set[str] = set()
    for member in members:
        name, kind = member.filename, stat.S_IFMT(member.external_attr >> 16)
        parts = PurePosixPath(name).parts
        if "\\" in member.orig_filename or ":" in name or "\0" in member.orig_filename or name.startswith("/"):
            raise FmuError(f"{path}: holds {shown(name)}; expected names with / alone, below the FMU's own folder")
        if ".." in parts or not parts:
            raise FmuError(f"{path}: holds {shown(name)}, which leaves the FMU's folder; expected none that does")
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise FmuError(f"{path}: holds {shown(name)}, a link or a device; expected files and folders")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FmuError(f"{path}: holds {shown(name)}, compressed in a way that FMI does not have; expected deflate")
        if member.flag_bits & 1:
            raise FmuError(f"{path}: holds {shown(name)}, which is encrypted; expected an FMU that can be read")
        if not member.is_dir() and str(PurePosixPath(name)) in seen:
            raise FmuError(f"{path}: holds {shown(name)} twice; expected each file once")
        seen.add(str(PurePosixPath(name)))
    if DESCRIPTION not in seen:
        raise FmuError(f"{path}: not a readable FMU: it holds no {DESCRIPTION} at its top{_instead(path, seen)}")


def _instead(path: Path, names: set[str]) -> str:
    """What an archive has in place of a model description at its top, and how it becomes an FMU."""
    for name in sorted(names, key=lambda one: (one.count("/"), one)):
        folder, _, file = name.rpartition("/")
        if folder and file == DESCRIPTION:
            return (
                f", but {shown(name)}; expected the content of that folder alone: unpack it, then"
                f" `cd {folder} && zip -r ../{path.name} .`"
            )
        if file.lower() == DESCRIPTION.lower():
            return f", but {shown(name)}; expected it spelt {DESCRIPTION}, and at the top"
        if file.lower().endswith(".fmu"):
            return f", but {shown(name)}; unpack the archive and give the path of that FMU"
    return "; expected an FMU, as a tool exports it"


def _write(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    target = folder / PurePosixPath(member.filename)
    if member.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    left = member.file_size
    with archive.open(member) as packed, open(target, "xb") as file:
        while chunk := packed.read(_CHUNK):
            left -= len(chunk)
            if left < 0:
                raise FmuError(f"{path}: {shown(member.filename)} is larger than declared; expected an FMU")
            file.write(chunk)


def check_descriptions(path: Path, folder: Path) -> None:
    """Refuse a model description, or a description of how to build it, that a reader could choke on.

    Raises FmuError if it is no XML, has a document type, or is too large or nested too deep.
    """
    for name in _READ:
        if (folder / name).exists() or name == DESCRIPTION:
            _check_xml(path, folder, name)


def _check_xml(path: Path, folder: Path, name: str) -> None:
    file = folder / name
    if not file.is_file() or file.stat().st_size > MOST_DESCRIPTION:
        raise FmuError(f"{path}: {name} is no file of at most {MOST_DESCRIPTION / MIB:.0f} MiB")
    parser = expat.ParserCreate()
    depth = 0

    def refuse(*_: Any) -> NoReturn:
        raise FmuError(f"{path}: {name} has a document type or entities; expected none, as FMI has none")

    def start(*_: Any) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise FmuError(f"{path}: {name} nests more than {DEEPEST} elements; expected a model description")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        with open(file, "rb") as content:
            parser.ParseFile(content)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise FmuError(f"{path}: not a readable FMU: {name}: {why(error)}") from None


def check_identifier(path: Path, identifier: Any) -> None:
    """Refuse a model identifier that is no plain name: a library outside the FMU would be loaded by it.

    Raises FmuError if it is so.
    """
    plain = isinstance(identifier, str) and identifier.isprintable() and not set(identifier) & set('/\\:*?"<>|')
    if not plain or identifier.strip(". ") != identifier or not identifier:
        raise FmuError(f"{path}: modelIdentifier is {shown(identifier)}; expected the name of the FMU's binary")
