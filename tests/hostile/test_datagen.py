"""Readers of ``datagen`` on damaged files, and on FMUs and folders made to do harm."""

import io
import json
import socket
import stat
import tempfile
import zipfile
from unittest import mock

import fmpy
import pytest

from datagen.comparing.recorded import load_recorded
from datagen.datasets.mending import _last_system
from datagen.driving.weather_files import read_hourly
from datagen.fmi.fmu import Fmu, unpack
from datagen.fmi.guard import guarded
from shared.errors import FmuError, RecordingError, WeatherError
from shared.lock import FILE_NAME, FolderLock
from shared.system import parse_system
from tests.datagen.places import sun_worked_out_once  # noqa: F401
from tests.hostile import cases_datagen
from tests.hostile.cases_datagen import SYSTEM, description, repacked
from tests.hostile.properties import property_of

test_damaged = property_of(cases_datagen)


def archive(path, entries, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as out:
        out.writestr("modelDescription.xml", description())
        for name, content in entries:
            out.writestr(name, content)
    return path


def link(name, mode=stat.S_IFLNK):
    one = zipfile.ZipInfo(name)
    one.external_attr = (mode | 0o777) << 16
    return one


def refused(path, sentence):
    """Unpacking ends in this sentence, and leaves nothing anywhere."""
    own = path.parent / "temporary"  # other tests unpack FMUs at the same time
    own.mkdir(exist_ok=True)
    before = sorted(path.parent.rglob("*"))
    with mock.patch.object(tempfile, "tempdir", str(own)), pytest.raises(FmuError, match=sentence):
        unpack.__wrapped__(path, "")
    assert sorted(path.parent.rglob("*")) == before


# ---------------------------------------------------------------- archives


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("../evil.so", "which leaves the FMU's folder"),
        ("/etc/evil.so", "names with / alone, below the FMU's own folder"),
        ("C:/evil.so", "names with / alone"),
        ("binaries\\linux64\\evil.so", "names with / alone"),
        (link("resources/link"), "a link or a device"),
        (link("resources/pipe", stat.S_IFIFO), "a link or a device"),
    ],
)
def test_nothing_is_written_outside_the_folder(tmp_path, name, sentence):
    path = archive(tmp_path / "a.fmu", [(name, "/etc/passwd")])
    refused(path, rf"a\.fmu: holds .*{sentence}")


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_file_that_is_there_twice_is_refused(tmp_path):
    refused(archive(tmp_path / "a.fmu", [("modelDescription.xml", "<a/>")]), "twice")


def test_a_bomb_is_refused_before_it_goes_off(tmp_path):
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as out:
        out.writestr("modelDescription.xml", description())
        block = bytes(1 << 20)
        with out.open("resources/zeros", "w", force_zip64=True) as file:
            for _ in range(32):
                file.write(block)
    data = bytearray(path.read_bytes())
    at = data.rfind(b"PK\x01\x02")  # of the entry in the directory: what it says of its size
    assert data[at + 46 : at + 46 + 15] == b"resources/zeros"
    data[at + 24 : at + 28] = (0xF0000000).to_bytes(4, "little")
    path.write_bytes(data)
    refused(path, r"a\.fmu: unpacks to 3840 MiB; expected an FMU, of at most 2048 MiB")


def test_a_file_that_is_larger_than_it_says_is_not_unpacked(tmp_path):
    path = archive(tmp_path / "a.fmu", [("resources/zeros", bytes(1 << 22))])
    data = bytearray(path.read_bytes())
    at = data.rfind(b"PK\x01\x02")
    data[at + 24 : at + 28] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    refused(path, "not a readable FMU: Bad CRC-32|is larger than declared")


def test_more_files_than_any_fmu_has_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.fmi.unpacking.MOST_FILES", 5)
    refused(
        archive(tmp_path / "a.fmu", [(f"r/{k}", "") for k in range(5)]), "holds 6 files; expected an FMU, of at most 5"
    )


def test_an_encrypted_file_is_refused(tmp_path):
    path = archive(tmp_path / "a.fmu", [("r/a", "a" * 100)])
    data = bytearray(path.read_bytes())
    data[data.rfind(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    refused(path, "which is encrypted")


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06" + bytes(18), b"MZ" + bytes(100)])
def test_what_is_no_archive_is_a_sentence(tmp_path, content):
    (tmp_path / "a.fmu").write_bytes(content)
    refused(tmp_path / "a.fmu", r"a\.fmu: not a readable FMU")


# ---------------------------------------------------------------- model descriptions

LAUGHS = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 12))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f'<!DOCTYPE a [<!ENTITY l0 "ha">{LAUGHS}]><a>&l11;</a>', "has a document type or entities"),
        ('<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a>&x;</a>', "has a document type or entities"),
        ("<a>" * 100_000, "nests more than 50 elements"),
        ("<a", "not a readable FMU: modelDescription.xml"),
        ("<a/>", "not a readable FMU"),
        ('<?xml version="1.0" encoding="no-such"?><a/>', "not a readable FMU: modelDescription.xml"),
    ],
)
def test_hostile_xml_is_a_sentence(tmp_path, text, sentence):
    (tmp_path / "a.fmu").write_bytes(repacked(text.encode()))
    refused(tmp_path / "a.fmu", sentence)


def test_a_description_beyond_its_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.fmi.unpacking.MOST_DESCRIPTION", 1000)
    (tmp_path / "a.fmu").write_bytes(repacked(description()))
    refused(tmp_path / "a.fmu", "is no file of at most 0 MiB")


@pytest.mark.parametrize("identifier", ["../../../tmp/evil", "/tmp/evil", "", "a:b"])
def test_no_library_outside_the_fmu_is_named(tmp_path, identifier):
    changed = description().replace(b'modelIdentifier="MixedAirCO2"', f'modelIdentifier="{identifier}"'.encode())
    assert changed != description()
    (tmp_path / "a.fmu").write_bytes(repacked(changed))
    refused(tmp_path / "a.fmu", "modelIdentifier is .*; expected the name of the FMU's binary")


# ---------------------------------------------------------------- binaries


@pytest.mark.parametrize("content", [b"no library", b"\x7fELF" + bytes(60)])
def test_a_binary_that_is_none_is_a_sentence(tmp_path, content):
    name = f"binaries/{fmpy.platform}/MixedAirCO2{fmpy.sharedLibraryExtension}"
    (tmp_path / "a.fmu").write_bytes(repacked(description(), ((name, content),)))
    with pytest.raises(FmuError, match=rf"a\.fmu: no usable binary for {fmpy.platform_tuple}"):
        Fmu(tmp_path / "a.fmu")


# ---------------------------------------------------------------- datasets


def test_a_repair_runs_no_system_that_came_with_the_dataset(tmp_path):
    with FolderLock(tmp_path, "/home/somebody/room/system.toml"):
        pass
    assert _last_system(tmp_path) == "/home/somebody/room/system.toml"
    raw = json.loads((tmp_path / FILE_NAME).read_text())
    for change in (
        {"host": f"not-{socket.gethostname()}"},
        {"system": str(tmp_path / "evil" / "system.toml")},
        {"system": "evil/system.toml"},
        {"system": f"{tmp_path}/../{tmp_path.name}/evil/system.toml"},
        {"system": 3},
    ):
        (tmp_path / FILE_NAME).write_text(json.dumps(raw | change))
        assert _last_system(tmp_path) is None


# ---------------------------------------------------------------- weather and recorded trajectories


def test_weather_without_end_is_refused(tmp_path):
    for name in ("w.csv", "w.epw", "w.mos"):
        with open(tmp_path / name, "wb") as file:
            file.truncate(1 << 40)
        with pytest.raises(WeatherError, match=rf"{name}: has 1048576 MiB"):
            read_hourly(tmp_path / name)
        (tmp_path / name).unlink()
        (tmp_path / name).symlink_to("/dev/zero")
        with pytest.raises(WeatherError, match=rf"{name}: cannot be read: it is a device"):
            read_hourly(tmp_path / name)


def test_a_packed_table_is_unpacked_to_its_limit_only(tmp_path, monkeypatch):
    import gzip

    monkeypatch.setattr("datagen.comparing.recorded.MOST_CSV", 1 << 16)
    (tmp_path / "mapping.toml").write_text(cases_datagen.MAPPING.replace("rooms.csv", "rooms.csv.gz"))
    out = io.BytesIO()
    with gzip.open(out, "w") as file:
        file.write(b"room,loss\n" + bytes(1 << 20))
    (tmp_path / "rooms.csv.gz").write_bytes(out.getvalue())
    system = parse_system(SYSTEM, tmp_path / "shed.toml")
    with pytest.raises(RecordingError, match=r"rooms\.csv\.gz: unpacks to more than 0 MiB"):
        load_recorded(tmp_path / "mapping.toml", system)
    (tmp_path / "rooms.csv.gz").write_bytes(out.getvalue()[:40])
    with pytest.raises(RecordingError, match=r"rooms\.csv\.gz: not a readable gzip file"):
        load_recorded(tmp_path / "mapping.toml", system)


def test_a_guarded_child_is_not_taken_over_by_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "datagen").mkdir()
    (tmp_path / "datagen" / "__init__.py").write_text(f"open({str(tmp_path / 'taken')!r}, 'w')")
    (tmp_path / "datagen" / "guard.py").write_text("")
    monkeypatch.chdir(tmp_path)
    assert guarded(abs, [-3], timeout=60) == [3]
    assert not (tmp_path / "taken").exists()
