"""The wheel, not the source tree: what is in it, and that it works where nothing else is installed."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import packages_distributions
from pathlib import Path

import grimp
import pytest
import xarray as xr
from filelock import FileLock
from packaging.utils import canonicalize_name

from datagen import simulate
from shared import __version__
from tests.docs.documented import script
from tests.packaging.wheels import HOLDS, PACKAGE, PROMISES, ROOT, build, index_answers, install, unpacked

pytestmark = pytest.mark.slow

CARRIED = {
    "fmus/MixedAirCO2.fmu",
    "fmus/MixedAirCO2/system.toml",
    "fmus/MixedAirCO2/office.toml",
    "fmus/MixedAirCO2/identifiability.json",
    "fmus/MixedAirCO2/estimator/README.md",
    "fmus/MixedAirCO2/estimator/estimator.json",
    "fmus/MixedAirCO2/estimator/weights.safetensors",
    "fmus/MixedAirCO2/estimator/posterior.json",
    "fmus/MixedAirCO2/estimator/posterior.safetensors",
    "fmus/Room/system.toml",
    *(f"fmus/Room/estimator/{name}" for name in ("estimator.json", "weights.safetensors", "posterior.safetensors")),
    "fmus/truth/MixedAirCO2Truth.fmu",
    "fmus/truth/truth.toml",
    "fmus/modelica/ZeroshotRoom/package.mo",
    *(f"diagnosis/templates/{name}.html.j2" for name in ("gap", "calibration", "forecast", "blind_score")),
    *(f"{package}/py.typed" for package in ("shared", "datagen", "trainer", "diagnosis", "fmus")),
}
"""What a user needs and is no Python module."""
LIMIT_MB = 20
"""Nothing large has come in unnoticed."""


@pytest.fixture(scope="session")
def dist(tmp_path_factory):
    """Source distribution and wheel, built once for all of pytest's processes."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if base.name.startswith("popen-") else base) / "distribution"
    with FileLock(f"{folder}.lock"):
        if not (folder / "built.json").exists():
            if not index_answers():
                pytest.skip("pip reaches no index that has setuptools, so nothing can be built or installed")
            folder.mkdir(exist_ok=True)
            (folder / "built.json").write_text(json.dumps([str(path) for path in build(folder)]))
    return [Path(path) for path in json.loads((folder / "built.json").read_text())]


def test_both_distributions_carry_all_that_a_user_needs_and_nothing_else(dist):
    archive, wheel = dist
    with tarfile.open(archive) as opened:
        whole = [name.partition("/")[2] for name in opened.getnames()]
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
        sizes = sum(one.compress_size for one in opened.infolist())
    assert CARRIED - {*names} == set()
    assert CARRIED - {*whole} == set()
    assert {"constraints.txt", "README.md", "LICENSE", "pyproject.toml"} <= {*whole}
    ours = {"shared", "datagen", "trainer", "diagnosis", "fmus"}
    assert {name.split("/")[0] for name in names} == ours | {f"zeroshot_fmu-{__version__}.dist-info"}
    for name in [*names, *whole]:
        assert not name.startswith(("tests", "docs", "docker", ".")), name
        assert "__pycache__" not in name and not name.endswith((".pyc", ".nbi", ".nbc", ".tmp", ".nc")), name
    assert sizes < LIMIT_MB * 1e6


@pytest.fixture(params=os.environ.get("ZEROSHOT_PYTHONS", sys._base_executable).split(), ids=lambda one: Path(one).name)
def python(request):
    """The interpreter that the wheel is installed for: this one, or those that ``make wheels`` names."""
    found = shutil.which(request.param)
    if found is None or subprocess.run([found, "--version"], capture_output=True).returncode:
        pytest.skip(f"there is no {request.param}")
    return found


ALONE = {
    "shared.remote",
    "datagen.farming.slurm",
    "diagnosis.app.pictures",
    "diagnosis.app.page",
    "diagnosis.app.server",
}
"""Modules that need another extra, and say so."""


def test_an_extra_brings_all_that_its_package_imports():
    ours, homes = ("shared", "datagen", "trainer", "diagnosis"), packages_distributions()
    graph = grimp.build_graph(*ours, include_external_packages=True, cache_dir=None)
    for extra in PROMISES:
        brought = script("making/licences").needed(extra)
        mine = graph.find_descendants(extra or "shared") - ALONE
        tops = {one.partition(".")[0] for each in mine for one in graph.find_modules_directly_imported_by(each)}
        foreign = tops - {*sys.stdlib_module_names, *ours, "fmus"}
        assert foreign, extra
        assert not [one for one in foreign if brought.isdisjoint(map(canonicalize_name, homes.get(one, ())))], extra


def test_the_wheel_has_every_module_and_its_estimator_predicts(dist, tmp_path):
    environment = unpacked(dist[1], tmp_path / "wheel")
    for package in ("shared", "datagen", "trainer", "diagnosis"):
        found, sources = (
            {one.relative_to(root) for one in (root / package).rglob("*.py")} for root in (tmp_path / "wheel", ROOT)
        )
        assert found == sources
    where = environment.out("python", "-c", "import trainer; print(trainer.__file__)", cwd=tmp_path)
    assert where.startswith(str(tmp_path / "wheel"))
    simulate("MixedAirCO2", hours=168.0, seed=3, out=tmp_path / "room.nc")
    predicted(environment, tmp_path)


# what the images hold is the wheel with the extras datagen and trainer (tests/docker/test_images.py)
EXTRAS = [*PROMISES] if "ZEROSHOT_PYTHONS" in os.environ else [""]


@pytest.mark.parametrize("extra", EXTRAS, ids=lambda extra: extra or "bare")
def test_the_wheel_works_where_nothing_else_is(dist, extra, python, tmp_path, default_system):
    environment, promise = install(dist[1], extra, tmp_path / "environment", python), PROMISES[extra]
    found = json.loads(environment.out("python", "-c", HOLDS, *promise.imports, cwd=tmp_path))
    assert promise.present | {PACKAGE} <= {*found["distributions"]}
    assert not promise.absent & {*found["distributions"]}
    assert found["where"].startswith(str(environment.folder))
    assert found["modules"] > 10
    assert found["system"] == default_system.hash()
    {"": bare, "datagen": farm, "trainer": learns, "diagnosis": all_three}[extra](environment, tmp_path)


def lacks(environment, folder, extra, *words):
    """A command whose extra is not installed says so in one sentence."""
    done = environment.run(*words, cwd=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"{words[0]} needs " in done.stderr and f"zeroshot-fmu[{extra}]" in done.stderr
    assert "Traceback" not in done.stderr and done.stderr.count("\n") == 1


def bare(environment, folder):
    assert environment.out("diagnosis", "--version", cwd=folder).strip() == __version__
    lacks(environment, folder, "datagen", "datagen", "run", "MixedAirCO2", "--out", "d", "--systems", "2")
    lacks(environment, folder, "trainer", "trainer", "predict", "MixedAirCO2", "room.nc")
    lacks(environment, folder, "diagnosis", "diagnosis", "residuals", "MixedAirCO2", "room.nc")


def farm(environment, folder):
    words = ["--out", "d", "--systems", "2", "--hours", "48", "--workers", "1"]
    environment.out("datagen", "run", "MixedAirCO2", *words, cwd=folder)
    assert json.loads(environment.out("datagen", "verify", "d", "--json", cwd=folder))["ok"]
    lacks(environment, folder, "trainer", "trainer", "predict", "MixedAirCO2", "room.nc")


def learns(environment, folder):
    simulate("MixedAirCO2", hours=168.0, seed=3, out=folder / "room.nc")
    predicted(environment, folder)
    lacks(environment, folder, "datagen", "datagen", "simulate", "MixedAirCO2", "--out", "other.nc")
    lacks(environment, folder, "diagnosis", "diagnosis", "residuals", "MixedAirCO2", "room.nc")


def predicted(environment, folder):
    said = environment.out("trainer", "predict", "MixedAirCO2", "room.nc", "--json", cwd=folder)
    found = json.loads(said)["predictions"][0]["parameters"]
    assert len(found) == 8 and all(one["low"] < one["value"] < one["high"] for one in found.values()), found


def all_three(environment, folder):
    environment.out("datagen", "simulate", "MixedAirCO2", "--out", "room.nc", "--hours", "168", cwd=folder)
    predicted(environment, folder)
    words = ["residuals", "MixedAirCO2", "room.nc", "--run", "MixedAirCO2", "--json"]
    found = json.loads(environment.out("diagnosis", *words, cwd=folder))["outputs"]
    with xr.open_dataset(folder / "room.nc") as record:
        outputs = {str(name) for name in record.data_vars if record[name].attrs.get("role") == "output"}
    assert found and {*found} <= outputs and all(one["rmse"] > 0 for one in found.values())
