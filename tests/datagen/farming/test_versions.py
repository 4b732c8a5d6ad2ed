"""Other versions of what decides the numbers: told and noted in a dataset, refused of a worker."""

import shutil

import pytest

from datagen import info, run, verify
from datagen.farming.cluster import _check_versions
from datagen.farming.versions import all_here, deciding_here
from shared.errors import ClusterError, DatasetError
from shared.store import read_manifest, write_manifest
from tests.datagen.faults import faulty, hashes, stay_in_this_process

SIZE = {"shard_size": 2, "workers": 1, "quiet": True}
OLDER = all_here() | {"pvlib": "0.0.1", "dask": "1.0"}
OURS = f"pvlib {all_here()['pvlib']}"


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    stay_in_this_process(monkeypatch)


@pytest.fixture(scope="module")
def tanks(tmp_path_factory):
    """Two datasets of tanks, with different seeds."""
    folder = tmp_path_factory.mktemp("versions")
    faulty.build(folder)
    with pytest.MonkeyPatch.context() as patch:
        stay_in_this_process(patch)
        for seed in (1, 2):
            run(faulty.describe(folder), folder / f"seed-{seed}", systems=2, seed=seed, **SIZE)
    return folder


@pytest.fixture
def told(caplog):
    """Warnings of ours so far."""
    return lambda: [one.getMessage() for one in caplog.records if one.name.startswith("zeroshot.")]


@pytest.fixture
def older(tanks, tmp_path):
    """One of them, as if another pvlib and another Dask had made it."""
    folder = shutil.copytree(tanks / "seed-1", tmp_path / "older")
    write_manifest(folder, read_manifest(folder).model_copy(update={"versions": OLDER}))
    return folder


@pytest.mark.slow
def test_a_dataset_that_is_extended_by_other_versions_names_all(tanks, older, told):
    before = hashes(older)
    run(tanks / "system.toml", older, systems=2, seed=1, **SIZE)
    assert read_manifest(older).all_versions() == [OLDER] and not told()  # nothing was simulated
    run(tanks / "system.toml", older, systems=4, seed=1, extend=True, **SIZE)
    (sentence,) = told()
    assert sentence.startswith(f"{older}: made with pvlib 0.0.1, this run with {OURS}; their systems agree within")
    assert read_manifest(older).all_versions() == [OLDER, all_here()]
    assert info(older).other_versions == [all_here()]
    card = (older / "README.md").read_text()
    assert "Several versions made it" in card and "pvlib 0.0.1" in card and OURS in card
    assert before.items() <= hashes(older).items()
    assert verify(older) == []
    run(tanks / "system.toml", older, systems=6, seed=1, extend=True, **SIZE)
    assert read_manifest(older).all_versions() == [OLDER, all_here()] and told() == [sentence]  # known already


def test_another_major_schema_is_not_extended(tanks, older):
    write_manifest(older, read_manifest(older).model_copy(update={"schema_version": "1.0"}))
    with pytest.raises(DatasetError, match=r"schema_version is 1\.0, this run has 2\.\d+; a dataset can only be"):
        run(tanks / "system.toml", older, systems=4, seed=1, extend=True, **SIZE)


class _Client:
    """Tells the versions of a scheduler and one worker, as Dask's client does."""

    def __init__(self, found, scheduler=None):
        self.found, self.scheduler = found, scheduler or deciding_here()

    def get_versions(self, packages):
        worker, scheduler = ({name: one.get(name) for name in packages} for one in (self.found, self.scheduler))
        return {"scheduler": {"packages": scheduler}, "workers": {"tcp://far:1": {"packages": worker}}}


def test_a_worker_with_other_versions_is_refused():
    _check_versions(_Client(deciding_here()))
    with pytest.raises(ClusterError, match=rf"tcp://far:1 has pvlib 0\.0\.1, this run {OURS}; expected the same"):
        _check_versions(_Client(OLDER))
    with pytest.raises(ClusterError, match=r"has no numba, this run numba "):
        _check_versions(_Client(deciding_here() | {"numba": None}))
    with pytest.raises(ClusterError, match=r"the scheduler has no zeroshot-fmu, this run .*; expected the same there"):
        _check_versions(_Client(deciding_here(), {"numpy": "2.0"}))
