"""What a worker holds its files against, and what it does where they are others."""

import shutil

import pytest

from datagen.driving.weather import weather_path
from datagen.farming.package import package_hash, sees_folder, weather_hashes
from datagen.farming.worker import Job, simulate_shard
from datagen.fmi.fmu import fmu_sha256
from shared.lock import FolderLock


@pytest.fixture
def job(default_system, tmp_path):
    """A job whose weather file may be edited."""
    (file,) = default_system.weather.files
    mine = shutil.copy(weather_path(file, default_system.path.parent), tmp_path / "mine.CSV")
    weather = default_system.weather.model_copy(update={"files": [str(mine)]})
    system = default_system.model_copy(update={"weather": weather}).with_experiment(hours=1.0)
    fmu = fmu_sha256(system.fmu_path)
    return Job(
        system=system.canonical(),
        system_path=str(system.path),
        fmu_sha256=fmu,
        root_seed=1,
        excitation=True,
        folder=str(tmp_path),
        package=package_hash(fmu, weather_hashes(system)),
    )


def edit(tmp_path):
    """Move the place of the weather up by a metre."""
    path = tmp_path / "mine.CSV"
    head, _, rest = path.read_bytes().partition(b"\n")
    place, _, altitude = head.rpartition(b",")
    path.write_bytes(place + b",%d\n" % (float(altitude) + 1) + rest)


def test_a_weather_file_that_changes_while_a_farm_runs_is_told(job, tmp_path):
    first = simulate_shard(job, "shard-000000.nc", [0])
    assert first.entry is not None and not first.lacks_package
    edit(tmp_path)
    second = simulate_shard(job, "shard-000001.nc", [1])
    assert second.lacks_package and second.entry is None and not second.failures


def test_a_folder_is_a_runs_only_while_the_run_has_it(tmp_path):
    with FolderLock(tmp_path) as lock:
        assert sees_folder(str(tmp_path), lock.token)
    assert not sees_folder(str(tmp_path), lock.token)
