"""The shipped file: description, binaries, and that it is what the sources give."""

import hashlib
import struct
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus.render import render_header, render_model_description, render_tables
from fmus.tables import load_table, source_hash
from fmus.toolchain import native_platform


@pytest.fixture(scope="module")
def files(shipped):
    with zipfile.ZipFile(shipped) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def description(shipped):
    return fmpy.read_model_description(str(shipped))


def test_fmpy_finds_no_problem(shipped):
    assert validate_fmu(str(shipped)) == []


def test_every_variable_has_unit_and_description(description):
    assert len(description.modelVariables) > 100
    for v in description.modelVariables:
        assert v.description, v.name
        assert v.type == "Boolean" or v.unit, v.name


def test_effects_start_at_zero(description):
    effects = [v for v in description.modelVariables if v.name.startswith("effect.")]
    assert len(effects) >= 6
    assert {v.name for v in effects if float(v.start) != 0.0} == {"effect.adjacent.T"}


def test_binaries_of_five_platforms(files):
    linux, arm = files["binaries/linux64/MixedAirCO2.so"], files["binaries/aarch64-linux/MixedAirCO2.so"]
    for content, machine in ((linux, 0x3E), (arm, 0xB7)):
        assert content[:6] == b"\x7fELF\x02\x01"
        assert struct.unpack_from("<H", content, 18)[0] == machine
    windows = files["binaries/win64/MixedAirCO2.dll"]
    (pe,) = struct.unpack_from("<I", windows, 0x3C)
    assert windows[:2] == b"MZ"
    assert windows[pe : pe + 4] == b"PE\0\0"
    assert struct.unpack_from("<H", windows, pe + 4)[0] == 0x8664
    for content in (linux, arm, windows, files["binaries/darwin64/MixedAirCO2.dylib"]):
        assert b"fmi2GetDirectionalDerivative" in content


def test_mach_o_holds_both_architectures_and_a_valid_signature(files):
    fat = files["binaries/darwin64/MixedAirCO2.dylib"]
    magic, count = struct.unpack_from(">II", fat)
    assert (magic, count) == (0xCAFEBABE, 2)
    slices = [struct.unpack_from(">IIIII", fat, 8 + 20 * i) for i in range(count)]
    assert [s[0] for s in slices] == [0x01000007, 0x0100000C]
    for cpu, _, offset, size, align in slices:
        assert offset % (1 << align) == 0
        thin = fat[offset : offset + size]
        assert struct.unpack_from("<II", thin) == (0xFEEDFACF, cpu)
    _check_code_signature(thin)  # Apple silicon loads signed code only


def _check_code_signature(thin):
    """Hashes of all pages in the ad-hoc signature agree with the file."""
    n_commands = struct.unpack_from("<I", thin, 16)[0]
    position, signature = 32, None
    for _ in range(n_commands):
        command, size = struct.unpack_from("<II", thin, position)
        if command == 0x1D:  # LC_CODE_SIGNATURE
            signature = struct.unpack_from("<II", thin, position + 8)
        position += size
    assert signature is not None
    blob = thin[signature[0] : signature[0] + signature[1]]
    magic, _, n_blobs = struct.unpack_from(">III", blob)
    assert magic == 0xFADE0CC0
    index = dict(struct.unpack_from(">II", blob, 12 + 8 * i) for i in range(n_blobs))
    directory = blob[index[0] :]
    assert struct.unpack_from(">I", directory)[0] == 0xFADE0C02
    hash_offset, _, _, n_slots, limit = struct.unpack_from(">IIIII", directory, 16)
    hash_size, hash_type, _, page_bits = struct.unpack_from(">BBBB", directory, 36)
    assert (hash_size, hash_type, limit) == (32, 2, signature[0])
    page = 1 << page_bits
    assert n_slots == -(-limit // page)
    for i in range(n_slots):
        expected = directory[hash_offset + 32 * i : hash_offset + 32 * (i + 1)]
        assert hashlib.sha256(thin[i * page : min((i + 1) * page, limit)]).digest() == expected


def test_shipped_file_belongs_to_these_sources(files, description):
    table = load_table()
    assert files["resources/source.sha256"].decode().strip() == source_hash(), "run python fmus/build.py"
    assert description.guid == table.guid
    assert files["modelDescription.xml"].decode() == render_model_description(table)
    assert files["sources/variables.h"].decode() == render_header(table)
    assert files["sources/variables.c"].decode() == render_tables(table)


def test_no_path_of_the_build_in_the_binaries(files):
    for name, content in files.items():
        if name.startswith("binaries/"):
            for trace in (b"fmu-build-", b"/tmp", b"/home", b"/root"):
                assert trace not in content, (name, trace)


def test_rebuilt_fmu_gives_the_shipped_trajectory(shipped, files, build_fmu, simulate, weather):
    rebuilt = build_fmu(3)
    with zipfile.ZipFile(rebuilt) as archive:
        assert archive.read("modelDescription.xml") == files["modelDescription.xml"]
        assert sum(name.startswith("binaries/") for name in archive.namelist()) == 1
    t = np.arange(0.0, 7 * 86400.0 + 1, 3600.0)
    inputs = weather(t)
    a, b = simulate(t, inputs, fmu=shipped), simulate(t, inputs, fmu=rebuilt)
    assert np.ptp(a[:, 0]) > 2.0  # the week has something to say
    np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-9)


def test_build_is_reproducible(build_fmu, tmp_path):
    from fmus.build import build

    again = build(tmp_path / "again.fmu", platforms=[native_platform()])
    assert again.read_bytes() == build_fmu(3).read_bytes()
