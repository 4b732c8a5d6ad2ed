"""The small FMUs of ``tests/fmus/small`` and systems around them, and the tank of ``tests/fmus/faulty``."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from datagen.driving.weather import weather_path
from datagen.driving.weather_files import read_hourly
from shared.system import parse_system
from tests.datagen.faults import faulty, stay_in_this_process
from tests.datagen.places import GREENSBORO, sun_worked_out_once  # noqa: F401

_BUILDER = Path(__file__).resolve().parents[1] / "fmus" / "small" / "builder.py"
_BLANK = 'schema_version = 1\nname = "{name}"\nfmu = "{fmu}"\n[estimator]\nchannels = ["{channel}"]\n'


def _load_builder():
    spec = importlib.util.spec_from_file_location("small_fmus_builder", _BUILDER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def small_fmu(tmp_path_factory):
    """``small_fmu(name, fmi, kinds, ...)``: the path of a small FMU, built once in a session."""
    builder, folder, made = _load_builder(), tmp_path_factory.mktemp("small-fmus"), {}

    def make(name, fmi=2, kinds=("me",), **options):
        key = (name, fmi, kinds, *sorted(options.items()))
        if key not in made:
            made[key] = builder.build(name, fmi, kinds, folder, **options)
        return made[key]

    return make


@pytest.fixture(scope="session")
def small_system(small_fmu):
    """``small_system(name, fmi, kinds, ...)``: a system description around a small FMU.

    ``outputs`` maps names to methods, ``inputs`` to interpolations, ``parameters`` is a tuple of names.
    """

    def make(name, fmi=2, kinds=("me",), *, outputs, parameters, inputs=(), fixed=(), step=0.125, hours=1.0, **options):
        fmu = small_fmu(name, fmi, kinds, **options)
        text = _BLANK.format(name=name, fmu=fmu.as_posix(), channel=next(iter(dict(outputs))).split("=")[-1])
        text += f"[experiment]\nstep = {step}\nhours = {hours}\ntolerance = 1e-9\n"
        text += "[fixed]\n" + "".join(f"{k} = {v}\n" for k, v in dict(fixed).items())
        for one in parameters:
            text += f'[[parameters]]\nname = "{one}"\nunit = "1"\nmin = 0.5\nmax = 2.0\n'
        for one, interpolation in dict(inputs).items():
            text += f'[[inputs]]\nname = "{one}"\nunit = "1"\nsource = "measured"\ncolumn = "{one}"\n'
            text += f'interpolation = "{interpolation}"\n'
        for one, method in dict(outputs).items():
            unit = {"h": "m", "v": "m/s"}.get(one, "1")
            text += f'[[outputs]]\nname = "{one}"\nunit = "{unit}"\nmethod = "{method}"\naccuracy = 1e-6\n'
        return parse_system(text, fmu.parent / f"{name}.toml")

    return make


@pytest.fixture(scope="session")
def file_rows():
    """A weather file's own columns at their stamps, the ends of its hours: times [s], irradiances, and its place."""
    record = read_hourly(weather_path(GREENSBORO, Path()))
    place = {name: getattr(record, name) for name in ("latitude", "longitude", "altitude", "utc_offset")}
    return 3600.0 * np.arange(1, 8761), [record.columns[name] for name in ("dni", "dhi", "ghi")], place


@pytest.fixture(scope="session")
def tank(tmp_path_factory):
    """Description of a tank that empties, beside its FMU, which :func:`faulty.describe` can let misbehave."""
    folder = tmp_path_factory.mktemp("tank")
    faulty.build(folder)
    return faulty.describe(folder)


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs and repairs simulate here, one system after another, and try no FMU beforehand."""
    stay_in_this_process(monkeypatch)


@pytest.fixture
def taken_to_be_alive(monkeypatch):
    """No FMU is tried in a process apart before a run."""
    monkeypatch.setattr("datagen.farming.farm.check_live_apart", lambda *_: None)


@pytest.fixture
def nothing_simulated(monkeypatch, taken_to_be_alive):
    """Runs find that no system is missing."""
    monkeypatch.setattr("datagen.farming.farm.missing", lambda *_, **__: iter(()))
