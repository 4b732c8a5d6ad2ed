"""What a worker holds its files against, and what it does where they are others."""

import shutil
from dataclasses import replace

import pytest

from datagen.driving.weather import weather_path
from datagen.farming import package, worker
from datagen.farming.package import package_files, package_hash, receive, sees_folder, weather_hashes
from datagen.farming.worker import Job, simulate_shard
from datagen.fmi.fmu import fmu_sha256
from shared import store
from shared.errors import FmuError
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


def test_systems_that_were_simulated_before_the_change_was_seen_are_dropped(job, tmp_path, monkeypatch):
    real = worker.attempt

    def attempt(work):
        edit(tmp_path)
        return real(work)

    monkeypatch.setattr(worker, "attempt", attempt)
    found = simulate_shard(job, "shard-000000.nc", [0])
    assert found.lacks_package and found.entry is None


def test_a_worker_whose_own_file_changed_goes_on_with_what_it_was_sent(job, default_system, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    first = simulate_shard(job, "shard-000000.nc", [0])
    receive(job.package, package_files(package.locate(job.system, job.system_path, job.package)))
    edit(tmp_path)
    assert simulate_shard(job, "shard-000000.nc", [0]).entry == first.entry


def test_a_child_without_the_files_says_so(job, tmp_path):
    worker.simulator_for.cache_clear()
    edit(tmp_path)
    with pytest.raises(FmuError, match="a weather file changed"):
        worker.attempt((job, 0))
    worker.simulator_for.cache_clear()


def test_a_folder_is_a_runs_only_while_the_run_has_it(tmp_path):
    with FolderLock(tmp_path) as lock:
        assert sees_folder(str(tmp_path), lock.token)
    assert not sees_folder(str(tmp_path), lock.token)


def test_a_worker_that_outlives_its_run_hands_its_file_back(job, tmp_path, monkeypatch):
    folder = tmp_path / "ds"
    (folder / "shards").mkdir(parents=True)
    with FolderLock(folder) as lock:
        mine = replace(job, folder=str(folder), token=lock.token)
        found = simulate_shard(mine, "shard-000000.nc", [0])
        assert found.data is None and (folder / "shards" / found.entry.file).exists()
        (folder / "shards" / found.entry.file).unlink()

        def write(dataset, path, encoding):
            netcdf(dataset, path, encoding)
            lock.__exit__(None, None, None)  # the run ends while the file is written

        netcdf = store.write_netcdf
        monkeypatch.setattr(store, "write_netcdf", write)
        again = simulate_shard(mine, "shard-000000.nc", [0])
    assert again.data is not None and not list((folder / "shards").iterdir())
