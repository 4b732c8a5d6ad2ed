"""What is not an FMU's fault: a temporary folder that is full or runs no programs, and how the archive was packed."""

import os
import sys
import zipfile
from types import SimpleNamespace

import pytest

from datagen.fmi import interface
from datagen.fmi.fmu import Fmu, unpack
from shared.errors import FmuError
from tests.small_disk import SAID, small_disk

unix = pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size there")


@unix
def test_a_full_temporary_folder_is_named(small_fmu, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    said = rf"dahlquist.*\.fmu: cannot be unpacked: the temporary folder {tmp_path} cannot be written to: {SAID};"
    fmu = small_fmu("dahlquist")
    with small_disk(2048), pytest.raises(FmuError, match=f"{said} .* set TMPDIR to one"):
        unpack.__wrapped__(fmu, "")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells")
def test_a_temporary_folder_that_runs_no_programs_is_named(small_fmu, tmp_path, monkeypatch):
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(small_fmu("dahlquist")) as whole, zipfile.ZipFile(broken, "w") as other:
        for name in whole.namelist():
            other.writestr(name, b"no library" if name.startswith("binaries") else whole.read(name))
    monkeypatch.setattr(interface.os, "statvfs", lambda _: SimpleNamespace(f_flag=os.ST_NOEXEC))
    with pytest.raises(FmuError, match=r"temporary folder .* is mounted noexec; expected .* set TMPDIR to one"):
        Fmu(broken)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["room/modelDescription.xml"], "but 'room/modelDescription.xml'; .* `cd room && zip -r ../a.fmu .`"),
        (["a/b/modelDescription.xml", "a/b/x"], "`cd a/b && zip -r ../a.fmu .`"),
        (["ModelDescription.xml"], "but 'ModelDescription.xml'; expected it spelt modelDescription.xml"),
        (["export/room.fmu"], "but 'export/room.fmu'; unpack the archive and give the path of that FMU"),
        (["readme.txt"], "; expected an FMU, as a tool exports it"),
    ],
)
def test_how_an_archive_becomes_an_fmu_is_said(tmp_path, names, said):
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
        for name in names:
            archive.writestr(name, "content")
    before = r"a\.fmu: not a readable FMU: it holds no modelDescription\.xml at its top"
    with pytest.raises(FmuError, match=f"{before}.*{said}"):
        Fmu(tmp_path / "a.fmu")
