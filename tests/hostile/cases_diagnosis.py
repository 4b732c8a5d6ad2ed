"""Readers of ``diagnosis``: recordings, mappings and measurements, calibrations, blind sets, verdicts, truths."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from diagnosis.blind.sealed import open_answers, read_manifest
from diagnosis.blind.truth import load_truth
from diagnosis.blind.verdicts import read_outcome, read_run
from diagnosis.importing.mapping import load_mapping
from diagnosis.importing.reading import read_measurements
from diagnosis.recording import read_recording
from shared.system import load_system
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set
from tests.diagnosis.importing.house_cases import MAPPING, measured
from tests.hostile.damage import damage_bytes, damage_json, damage_text
from tests.hostile.trial import Reader
from tests.trainer.conftest import tank_system

FMUS = Path(__file__).resolve().parents[2] / "fmus"


def measurements(folder: Path) -> None:
    """Read a mapping and what it maps."""
    mapping = load_mapping(folder / "mapping.toml")
    found = read_measurements(folder / "data.csv", mapping)
    for name, one in mapping.variables.items():
        if one.column is not None:
            found.numbers(one.column, f"{mapping.path}: variables.{name}")


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
        found.append(Reader(f"recording, {form}", at, "r.nc", read, damage_bytes, examples=8))
    frame, _ = measured(days=1)
    for file in ("mapping.toml", "data.csv"):
        at = folder / f"import-{file}"
        at.mkdir()
        (at / "mapping.toml").write_text(MAPPING)
        frame.to_csv(at / "data.csv", index=False)
        # a damaged mapping asks for what the measurements do not have
        found.append(Reader(f"import, {file}", at, file, measurements, damage_text, named=False))
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
