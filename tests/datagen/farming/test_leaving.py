"""What a run leaves beside its shards, however it ends: the dataset's card, and limits that were computed for it."""

import pytest

from datagen import run
from shared.ceiling import read_ceilings, write_ceilings


@pytest.mark.usefixtures("nothing_simulated")
def test_limits_that_were_computed_for_a_dataset_stay(default_system, tmp_path):
    settings = {"systems": 6, "preset": "many-rooms", "quiet": True}
    run(default_system, tmp_path, **settings)
    path = tmp_path / "identifiability.json"
    beside = read_ceilings(default_system.path.parent / "identifiability.json")
    assert read_ceilings(path) == beside
    own = beside.model_copy(deep=True)
    same = own.ceilings[0].model_copy(update={"r2_mean": 0.123, "systems": 30})
    fewer = own.ceilings[1].model_copy(update={"r2_mean": 0.123, "systems": 3})  # older than those beside
    other = own.ceilings[0].model_copy(update={"context_hours": 17.0})
    own.ceilings = [same, fewer, other]
    write_ceilings(path, own)
    run(default_system, tmp_path, **settings)
    found = read_ceilings(path).ceilings
    assert same in found and other in found
    assert [one for one in found if one not in (same, other)] == beside.ceilings[1:]
    before = path.stat()
    run(default_system, tmp_path, **settings)
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    strange = own.model_copy(update={"system_hash": "0" * 64})
    write_ceilings(path, strange)
    run(default_system, tmp_path, **settings)
    assert read_ceilings(path) == strange
