"""Readers of ``datagen``: FMUs, weather files, failures, locks, recorded trajectories."""

import io
import json
import shutil
import zipfile
from pathlib import Path
from random import Random

from datagen.comparing.recorded import load_recorded, series_of
from datagen.driving.weather_files import read_hourly
from datagen.driving.weather_sun import check_still, check_sun
from datagen.farming.failures import Failures
from datagen.fmi.fmu import unpack
from shared.lock import read_holder
from shared.system import parse_system
from tests.datagen.driving.test_weather_files import write_epw, write_mos, write_pvgis, write_sam, write_tmy3, year
from tests.hostile.damage import damage_bytes, damage_text
from tests.hostile.trial import Reader

FMU = Path(__file__).resolve().parents[2] / "fmus" / "MixedAirCO2.fmu"
WEATHER = (("tmy3", "w.csv"), ("epw", "w.epw"), ("mos", "w.mos"), ("nsrdb", "w.csv"), ("pvgis", "w.csv"))
LINE = {"system": 3, "root_seed": 1, "parameters": {"a": 1.0}, "cause": "did not end"}
SYSTEM = """
schema_version = 1
name = "Shed"
fmu = "none.fmu"
estimator = { channels = ["warmth"] }
parameters = [{ name = "UA", unit = "W/K", min = 1.0, max = 9.0 }]
outputs = [{ name = "warmth", unit = "K", accuracy = 0.1 }]
inputs = [
  { name = "outdoors", unit = "K", source = "measured", column = "outdoors" },
  { name = "sunshine", unit = "W/m2", source = "weather", column = "poa_global" },
]
weather = { files = ["pvlib:723170TYA.CSV"] }
"""
MAPPING = """
[recorded]
cases = "rooms.csv"
name = "room"
series = "room{name}.csv"
time = "t"
discard_hours = 1.0
[recorded.parameters]
UA = "loss"
[recorded.inputs]
outdoors = { column = "out", add = 273.15 }
sunshine = { column = "sun" }
[recorded.outputs]
warmth = { column = "T", add = 273.15 }
"""


def unpacked(path: Path) -> None:
    """Unpack an FMU and throw it away again."""
    folder, _ = unpack.__wrapped__(path, "")
    shutil.rmtree(folder)


def repacked(description: bytes, extra: tuple[tuple[str, bytes], ...] = ()) -> bytes:
    """An FMU with this model description."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("modelDescription.xml", description), *extra):
            archive.writestr(name, content)
    return out.getvalue()


def description() -> bytes:
    """The default FMU's."""
    with zipfile.ZipFile(FMU) as archive:
        return archive.read("modelDescription.xml")


def damage_description(data: bytes, random: Random) -> bytes:
    """An archive that is whole around a description that is not."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return repacked(damage_text(archive.read("modelDescription.xml"), random))


def recorded(folder: Path) -> None:
    """What ``datagen compare`` reads."""
    system = parse_system(SYSTEM, folder / "shed.toml")
    spec, cases = load_recorded(folder / "mapping.toml", system)
    series_of(spec, cases[0], system)


def checked_weather(path: Path) -> None:
    """A weather file, read and checked."""
    record = read_hourly(path)
    check_sun(path, record)
    check_still(path, record)


def readers(folder: Path) -> list[Reader]:
    """All of them, each on files of its own below ``folder``."""
    for name in ("fmu", "xml", "failures", "lock", "tmy3", "epw", "mos", "nsrdb", "pvgis"):
        (folder / name).mkdir(parents=True)
    (folder / "fmu" / "a.fmu").write_bytes(repacked(description(), (("resources/a.bin", bytes(range(256)) * 20),)))
    (folder / "xml" / "a.fmu").write_bytes(repacked(description()))
    (folder / "failures" / "failures.jsonl").write_text(f"{json.dumps(LINE)}\n" * 3)
    (folder / "lock" / ".lock").write_text(json.dumps({"pid": 1, "host": "h", "token": "t", "system": "s"}))
    made = year()
    write_tmy3(folder / "tmy3" / "w.csv", made)
    write_epw(folder / "epw" / "w.epw", made)
    write_mos(folder / "mos" / "w.mos", made)
    write_sam(folder / "nsrdb" / "w.csv", made)
    write_pvgis(folder / "pvgis" / "w.csv", made)
    found = [
        Reader("FMU archive", folder / "fmu", "a.fmu", lambda at: unpacked(at / "a.fmu"), damage_bytes, examples=4),
        Reader(
            *("FMU description", folder / "xml", "a.fmu"),
            *(lambda at: unpacked(at / "a.fmu"), damage_description),
            examples=4,
        ),
        Reader("failures", folder / "failures", "failures.jsonl", lambda at: list(Failures.read(at)), damage_text),
        Reader("lock", folder / "lock", ".lock", read_holder, damage_text),
    ]
    for form, file in WEATHER:
        read = lambda at, file=file: checked_weather(at / file)  # noqa: E731
        found.append(Reader(f"weather, {form}", folder / form, file, read, damage_text, examples=1, own_words=True))
    for file in ("mapping.toml", "rooms.csv", "room1.csv"):
        at = folder / f"recorded-{file}"
        at.mkdir()
        (at / "mapping.toml").write_text(MAPPING)
        (at / "rooms.csv").write_text("room,loss\n1,4.5\n2,5.5\n")
        rows = "\n".join(f"{3600 * k},{20 + k % 5},{k % 7},{k % 3}" for k in range(48))
        (at / "room1.csv").write_text(f"t,T,out,sun\n{rows}\n")
        # a damaged mapping or case names other files
        found.append(Reader(f"recorded, {file}", at, file, recorded, damage_text, named=file == "room1.csv"))
    return found
