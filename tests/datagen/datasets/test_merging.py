"""Datasets between teams: merged, verified, accepted by a CF checker, and readable for good."""

import json
import shutil
from pathlib import Path

import pytest

from datagen import info, merge, run, verify
from datagen.datasets import mending
from shared.ceiling import FILE_NAME as CEILING_FILE
from shared.ceiling import Ceiling, Ceilings, read_ceilings, write_ceilings
from shared.errors import DatasetError, SystemDescriptionError
from shared.store import DatasetFolder, read_manifest, write_manifest
from shared.system import load_system
from tests.datagen.cf_checks import cf_faults
from tests.datagen.faults import run_here

pytestmark = pytest.mark.usefixtures("in_this_process")
STORED = Path(__file__).resolve().parents[2] / "data" / "schema-1.0"
RECORDED = [0.286494, 0.274189]
SIZE = {"systems": 4, "shard_size": 2}


@pytest.fixture(scope="module")
def teams(tank, tmp_path_factory):
    """The same system simulated by two teams with different seeds, and by one with other settings."""
    folder = tmp_path_factory.mktemp("teams")
    run_here(tank, folder / "a", seed=1, **SIZE)
    run_here(tank, folder / "b", seed=2, **SIZE)
    run_here(tank, folder / "short", seed=4, hours=12.0, **SIZE)
    return folder


@pytest.mark.slow
def test_merged_systems_keep_seed_split_and_data(teams, tank, tmp_path, monkeypatch):
    merge([teams / "a", teams / "b"], tmp_path / "c")
    a, b, c = (DatasetFolder(folder).load() for folder in (teams / "a", teams / "b", tmp_path / "c"))
    assert len(c.systems) == 8
    for part, seed in ((a, 1), (b, 2)):
        rows = c.seeds == seed
        assert (c.values[rows] == part.values).all()
        assert (c.splits[rows] == part.splits).all()
    assert verify(tmp_path / "c") == []
    found = info(tmp_path / "c")
    assert (found.root_seeds, found.systems_done, found.complete) == ([1, 2], 8, True)
    assert "root seed\n1, 2" in (tmp_path / "c" / "README.md").read_text()
    json.dumps(vars(found))
    lines, scope = (tmp_path / "c" / "README.md").read_text().split("```python\n")[1].split("```")[0], {}
    monkeypatch.chdir(tmp_path / "c")
    exec(lines, scope)  # the card's lines tell all systems apart
    data = scope["data"]
    assert len({*zip(data.root_seed.values, data.system.values, strict=True)}) == data.sizes["system"] == 8
    # and it can be mended, each shard from its own seed
    victim = tmp_path / "c" / "shards" / "seed-2-shard-000001.nc"
    victim.unlink()
    assert mending.repair(tmp_path / "c", tank) == [victim.name]
    assert verify(tmp_path / "c") == []
    with pytest.raises(DatasetError, match="merged from other datasets"):
        run(tank, tmp_path / "c", seed=1, **SIZE)


@pytest.mark.slow
def test_what_does_not_belong_together_is_refused(teams, tmp_path):
    with pytest.raises(DatasetError, match="root seed 1 is also that of"):
        merge([teams / "a", teams / "a"], tmp_path / "c")
    with pytest.raises(DatasetError, match=r"settings is .*only datasets of one system"):
        merge([teams / "a", teams / "short"], tmp_path / "c")
    other = shutil.copytree(teams / "b", tmp_path / "other")
    write_manifest(other, read_manifest(other).model_copy(update={"fmu_sha256": "0" * 64}))
    with pytest.raises(DatasetError, match="fmu_sha256 is 0000"):
        merge([teams / "a", other], tmp_path / "c")
    assert any("fmu_sha256 is" in fault for fault in verify(other))
    with pytest.raises(DatasetError, match="at least two"):
        merge([teams / "a"], tmp_path / "c")
    with pytest.raises(DatasetError, match="already there"):
        merge([teams / "a", teams / "b"], teams / "short")
    spoilt = shutil.copytree(teams / "b", tmp_path / "spoilt")
    (spoilt / "shards" / "shard-000000.nc").write_bytes(b"rubbish")
    with pytest.raises(DatasetError, match=r"shard-000000\.nc: not what its manifest says"):
        merge([teams / "a", spoilt], tmp_path / "c")


def ceilings(team, **values):
    """A file of limits for a dataset: context [h] and the mean."""
    manifest = DatasetFolder(team).manifest
    common = {"step": 60.0, "noise": "none", "channels": ["y"], "r2": {"a": 0.5}, "systems": 1, "seed": 0}
    ones = [
        Ceiling(context_hours=float(hours[1:]), r2_mean=mean, r2_mean_low=None, r2_mean_high=None, **common)
        for hours, mean in values.items()
    ]
    facts = {name: getattr(manifest, name) for name in ("system_name", "system_hash", "fmu_sha256")}
    write_ceilings(team / CEILING_FILE, Ceilings(outputs=["y"], ceilings=ones, **facts))


def test_limits_of_all_parts_are_kept_and_the_first_ones_count(two, tmp_path):
    """Whichever of the parts has them."""
    a, b = two
    ceilings(b, h24=0.5, h48=0.7)
    merge([a, b], tmp_path / "one")
    assert read_ceilings(tmp_path / "one" / CEILING_FILE) == read_ceilings(b / CEILING_FILE)
    ceilings(a, h24=0.6, h12=0.3)
    merge([a, b], tmp_path / "both")
    found = read_ceilings(tmp_path / "both" / CEILING_FILE).ceilings
    assert {one.context_hours: one.r2_mean for one in found} == {24.0: 0.6, 48.0: 0.7, 12.0: 0.3}


def changed(folder, **values):
    """A dataset whose manifest says other things than its shards."""
    write_manifest(folder, read_manifest(folder).model_copy(update=values))
    return verify(folder)


@pytest.mark.slow
def test_a_manifest_that_says_another_thing_than_its_shards_is_at_fault(teams, tmp_path, caplog):
    folder = Path(shutil.copytree(teams / "a", tmp_path / "a"))
    manifest = read_manifest(folder)
    faults = changed(folder, settings={**manifest.settings, "excitation": not manifest.settings["excitation"]})
    assert len(faults) == 2 and all("settings is" in one and "the manifest says" in one for one in faults)
    faults = changed(folder, settings={**manifest.settings, "hours": 7.0})
    assert any("manifest.json: hours is 7.0 in its settings, and in its system" in one for one in faults)
    assert changed(folder, settings=manifest.settings) == []
    with caplog.at_level("WARNING", logger="zeroshot"):
        assert changed(folder, systems=5) == []
    assert "1 of its 5 systems are neither in a shard nor in failures.jsonl" in caplog.text


@pytest.fixture
def two(tmp_path):
    """Two datasets of one system, of two root seeds."""
    folders = [shutil.copytree(STORED, tmp_path / name) for name in ("a", "b")]
    manifest = read_manifest(folders[1])
    write_manifest(folders[1], manifest.model_copy(update={"root_seed": manifest.root_seed + 1}))
    return folders


def test_a_shard_that_its_manifest_does_not_list_bars_a_merge(two, tmp_path):
    manifest = read_manifest(two[0])
    write_manifest(two[0], manifest.model_copy(update={"shards": []}))
    with pytest.raises(DatasetError, match=r"a.shards.shard-000000\.nc: not in the manifest; .*run again"):
        merge(two, tmp_path / "both")


@pytest.mark.slow
def test_a_preset_gives_what_is_not_given(tank, tmp_path):
    manifest = run_here(tank, tmp_path / "ds", preset="short", systems=2)
    assert (manifest.systems, manifest.settings["hours"], manifest.settings["step"]) == (2, 6.0, 1800.0)
    with pytest.raises(SystemDescriptionError, match="no preset 'long'; found short"):
        run(tank, tmp_path / "other", preset="long")


def test_a_dataset_of_the_first_schema_stays_readable():
    dataset = DatasetFolder(STORED)
    assert dataset.manifest.schema_version == "1.0"
    records = dataset.load()
    assert records.systems.tolist() == [0, 1]
    assert records.values.shape == (2, 1, 6)
    assert [round(float(v), 6) for v in records.values[:, 0, -1]] == RECORDED
    assert verify(STORED) == []
    assert load_system(STORED / "system.toml").hash() == dataset.manifest.system_hash


def test_a_cf_checker_accepts_a_shard():
    assert cf_faults(STORED / "shards" / "shard-000000.nc") == set()


@pytest.mark.slow
def test_datasets_of_one_major_schema_can_be_merged_and_others_cannot(teams, tmp_path):
    older = shutil.copytree(teams / "b", tmp_path / "older")
    write_manifest(older, read_manifest(older).model_copy(update={"schema_version": "2.0"}))
    assert len(merge([teams / "a", older], tmp_path / "c").shards) == 4
    write_manifest(older, read_manifest(older).model_copy(update={"schema_version": "1.0"}))
    with pytest.raises(DatasetError, match="schema is 1, "):
        merge([teams / "a", older], tmp_path / "d")
