"""Readers of ``diagnosis``: recordings, mappings and measurements, calibrations, blind sets, verdicts, truths."""

import re
import shutil
import tempfile
from pathlib import Path
from random import Random

import numpy as np
import xarray as xr

from diagnosis.blind.sealed import open_answers, read_manifest
from diagnosis.blind.truth import load_truth
from diagnosis.blind.verdicts import read_outcome, read_run
from diagnosis.measurements.importer import import_recording
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from shared.netcdf import read_netcdf
from shared.system import load_system
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, measured
from tests.hostile.damage import damage_bytes, damage_json, damage_text
from tests.hostile.trial import Reader
from tests.trainer.conftest import tank_system

FMUS = Path(__file__).resolve().parents[2] / "fmus"


def imported(folder: Path) -> None:
    """Import what a mapping maps, to a recording and its picture; both are whole, or there is none."""
    with tempfile.TemporaryDirectory() as place:
        try:
            import_recording(folder / "mapping.toml", folder / "data.csv", out=Path(place, "r.nc"))
            read_netcdf(Path(place, "r.nc"), RecordingError, "a recording")
            assert Path(place, "r.png").read_bytes()[:4] == b"\x89PNG"
        except RecordingError:
            assert not list(Path(place).iterdir()), "a refused import has written something"
            raise


SETTINGS = {
    "variables.": (
        *("scale = {}", "offset = {}", "shift = {}", "interval = {}", "max_gap = {}", "stuck_after = {}", "fill = {}"),
        *('fill = "interpolate"\nfill_up_to = {}', "valid = [-1.0, {}]", "valid = [{}, 1e9]", 'reading = "hold"'),
        *('reading = "mean"', 'reading = "point"', 'stamp = "start"', 'compare = {{ column = "sun", unit = "1" }}'),
    ),
    "grid": ("step = {}", "coverage = {}", "step = {}\ncoverage = 1.0"),
    "place": ("altitude = {}",),
    "defaults": ('reading = "hold"', 'reading = "mean"', 'stamp = "start"'),
}
"""Lines that a mapping may have in a table whose name begins so."""
NUMBERS = (0, 1e-300, 1e-9, 0.01, 0.5, 1.0, 7.0, 60.0, 600.0, 1800.0, 5e3, 86400.0, 1e6, 1e12, 1e37, 1e300)


def damage_settings(data: bytes, random: Random) -> bytes:
    """A mapping that can be read, with settings that nobody would choose; now and then it is damaged as any text is."""
    text = data.decode()
    for _ in range(random.choice((1, 1, 2, 3))):
        kind = random.choice(("variables.", "variables.", "variables.", "weather.", *SETTINGS))
        line = random.choice(SETTINGS["variables." if kind == "weather." else kind])
        line = line.format(random.choice(NUMBERS) * random.choice((1, 1, 1, -1)))
        heads = re.findall(rf"^\[{re.escape(kind)}.*\]$", text, re.MULTILINE) or [f"[{kind}]"]
        head = random.choice(heads)
        field = line.partition(" ")[0]
        before, _, after = text.partition(head)
        mine, mark, others = after.partition("\n[")
        mine = re.sub(rf"^{field} = .*\n?", "", mine, flags=re.MULTILINE)
        text = f"{before}{head}\n{line}\n{mine.strip()}\n{mark}{others}" if after else f"{text}\n{head}\n{line}\n"
    return damage_text(text.encode(), random) if random.randrange(8) == 0 else text.encode()


def damage_columns(data: bytes, random: Random) -> bytes:
    """Readings of a column, for a while, are all something else, or some of them are."""
    rows = [line.split(",") for line in data.decode().splitlines()]
    for _ in range(random.choice((1, 1, 2, 3))):
        column = random.randrange(len(rows[0]))
        first = random.randrange(1, len(rows))
        last = random.choice((len(rows), min(first + random.randrange(1, 60), len(rows))))
        share = random.choice((1.0, 1.0, 0.5, 0.1))
        value = random.choice(("", "nan", "x", *(f"{sign}{one:g}" for one in NUMBERS for sign in ("", "-"))))
        for row in rows[first:last]:
            if random.random() < share:
                row[column] = value
    return "\n".join(map(",".join, rows)).encode()


def _reseal(folder: Path) -> None:
    """Publish the hash of the answers as they are now."""
    import json

    from shared.store import sha256_of

    path = folder / "set" / "manifest.json"
    raw = json.loads(path.read_text())
    raw["answers_sha256"] = sha256_of(folder / "set.answers.json")
    path.write_text(json.dumps(raw))


def readers(folder: Path) -> list[Reader]:
    """All of them, each on files of its own below ``folder``."""
    system, room = tank_system(), load_system(FMUS / "MixedAirCO2")
    found = []
    for form in ("NETCDF4", "NETCDF3_64BIT"):
        at = folder / form
        at.mkdir(parents=True)
        time = ("time", 1800.0 * np.arange(1, 97), {"units": "seconds since 2001-01-01 00:00:00"})
        series = {
            name: ("time", np.ones(96), {"units": unit})
            for name, unit in (("level", "m"), ("glow", "lx"), ("valve", "1"))
        }
        xr.Dataset(series, {"time": time}).to_netcdf(at / "r.nc", format=form)
        read = lambda at: read_recording(at / "r.nc", system)  # noqa: E731
        found.append(Reader(f"recording, {form}", at, "r.nc", read, damage_bytes, examples=3))
    frame, _ = measured(days=2, minutes=30)
    for name, file, damage, examples in (
        ("mapping", "mapping.toml", damage_text, 1),
        ("a mapping's settings", "mapping.toml", damage_settings, 2),
        ("data", "data.csv", damage_text, 1),
        ("columns of the data", "data.csv", damage_columns, 2),
    ):
        at = folder / f"import-{name}".replace(" ", "-")
        at.mkdir()
        (at / "mapping.toml").write_text(MAPPING)
        (at / "house.toml").write_text(HOUSE)
        frame.to_csv(at / "data.csv", index=False)
        # a damaged mapping asks for what the measurements do not have
        found.append(Reader(f"import, {name}", at, file, imported, damage, examples=examples, named=False))
    cases = [Case("library", ("a",), sizes=(1.0,), room=2.0), Case("none", truth="no_gap", room=0.1)]
    for file, seal in (("set/manifest.json", None), ("set.answers.json", _reseal)):
        at = folder / f"blind-{Path(file).name}"
        at.mkdir()
        write_set(at / "set", cases)
        read = lambda at: open_answers(at / "set", at / "set.answers.json")  # noqa: E731
        found.append(Reader(f"blind, {Path(file).name}", at, file, read, damage_json, seal, named=False))
    at = folder / "verdicts"
    at.mkdir()
    write_results(at / "results", write_set(at / "set", cases)[0], cases)
    file = read_manifest(at / "set")["recordings"][0]["file"]
    results = at / "results"
    outcome = next(iter(sorted((results / "verdicts").iterdir())))
    found.append(Reader("blind run.json", results, "run.json", read_run, damage_json))
    found.append(
        Reader("blind verdict", results, f"verdicts/{outcome.name}", lambda at: read_outcome(at, file), damage_json)
    )
    at = folder / "truth"
    at.mkdir()
    shutil.copyfile(FMUS / "truth" / "truth.toml", at / "truth.toml")
    found.append(Reader("truth", at, "truth.toml", lambda at: load_truth(at / "truth.toml", room), damage_text))
    return found
