"""Other versions of what decides the numbers: told and noted in a dataset, refused of a worker."""

import pytest

from datagen import info, run, verify
from datagen.farming.cluster import _check_versions
from datagen.farming.versions import all_here, deciding_here
from shared.errors import ClusterError, DatasetError
from shared.store import read_manifest, write_manifest
from tests.datagen.faults import hashes, run_here

pytestmark = pytest.mark.usefixtures("in_this_process")
SIZE = {"shard_size": 2, "workers": 1}
OLDER = all_here() | {"pvlib": "0.0.1", "dask": "1.0"}
OURS = f"pvlib {all_here()['pvlib']}"


@pytest.fixture
def told(caplog):
    """Warnings of ours so far."""
    return lambda: [one.getMessage() for one in caplog.records if one.name.startswith("zeroshot.")]


@pytest.fixture
def older(tank, tmp_path):
    """A dataset of tanks, as if another pvlib and another Dask had made it."""
    folder = tmp_path / "older"
    run_here(tank, folder, systems=2, seed=1, **SIZE)
    write_manifest(folder, read_manifest(folder).model_copy(update={"versions": OLDER}))
    return folder


@pytest.mark.slow
def test_a_dataset_that_is_extended_by_other_versions_names_all(tank, older, told):
    before = hashes(older)
    run(tank, older, quiet=True, systems=2, seed=1, **SIZE)
    assert read_manifest(older).all_versions() == [OLDER] and not told()  # nothing was simulated
    run(tank, older, quiet=True, systems=4, seed=1, extend=True, **SIZE)
    (sentence,) = told()
    assert sentence.startswith(f"{older}: made with pvlib 0.0.1, this run with {OURS}; their systems agree within")
    assert read_manifest(older).all_versions() == [OLDER, all_here()]
    assert info(older).other_versions == [all_here()]
    card = (older / "README.md").read_text()
    assert "Several versions made it" in card and "pvlib 0.0.1" in card and OURS in card
    assert before.items() <= hashes(older).items()
    assert verify(older) == []
    run(tank, older, quiet=True, systems=6, seed=1, extend=True, **SIZE)
    assert read_manifest(older).all_versions() == [OLDER, all_here()] and told() == [sentence]  # known already


def test_another_major_schema_is_not_extended(tank, older):
    write_manifest(older, read_manifest(older).model_copy(update={"schema_version": "1.0"}))
    with pytest.raises(DatasetError, match=r"schema_version is 1\.0, this run has 2\.\d+; a dataset can only be"):
        run(tank, older, quiet=True, systems=4, seed=1, extend=True, **SIZE)


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
