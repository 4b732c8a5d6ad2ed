"""The farm: the same data whoever computes them, resumed where it stopped, and every fault named."""

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from datagen import info, run, simulate, verify
from datagen.datasets.mending import repair
from datagen.driving.sampling import is_calm, sample_parameters
from diagnosis.recording import read_recording
from shared.ceiling import read_ceilings, write_ceilings
from shared.errors import DatasetError
from shared.logs import Reporting, reported
from shared.store import DatasetFolder
from tests.datagen.cf_checks import cf_faults
from tests.datagen.faults import hashes, run_here

SIZE = {"systems": 6, "hours": 96.0, "seed": 5, "shard_size": 2}


@pytest.fixture(scope="module")
def made(default_system, tmp_path_factory):
    folder = tmp_path_factory.mktemp("farm") / "made"
    run_here(default_system, folder, **SIZE)
    return folder


def carried_out(folder, monkeypatch):
    """What the lines of a dataset's card define."""
    code, scope = (folder / "README.md").read_text().split("```python\n")[1].split("```")[0], {}
    monkeypatch.chdir(folder)
    exec(code, scope)
    return scope


def test_the_dataset_is_what_was_asked_for(made, default_system):
    records = DatasetFolder(made).load()
    assert records.values.shape == (6, 2, 96)
    assert np.isfinite(records.values).all()
    for row, index in enumerate(records.systems):
        np.testing.assert_array_equal(records.parameters[row], sample_parameters(default_system, 5, int(index)))
    found = info(made)
    assert (found.systems_done, found.complete, found.root_seed) == (6, True, 5)
    assert verify(made) == []
    assert "Read it with plain xarray" in (made / "README.md").read_text()
    assert (made / "failures.jsonl").read_text() == ""


def test_the_cards_lines_read_the_dataset(made, monkeypatch):
    scope = carried_out(made, monkeypatch)
    assert scope["data"].sizes == {"system": 6, "time": 96, "bnds": 2}
    assert scope["train"].sizes["system"] == int((scope["data"]["split"] == 0).sum())


def test_no_reader_takes_elapsed_time_for_dates(default_system, tmp_path, monkeypatch):
    """In a dataset whose records begin on days of their own."""
    roaming = tmp_path / "roaming"
    run_here(default_system, roaming, preset="many-rooms", hours=24.0, systems=3, seed=5, shard_size=3)
    shard = xr.load_dataset(roaming / "shards" / "shard-000000.nc")
    assert shard["time"].dtype.kind == "f"
    anywhere = default_system.with_experiment(start=(0.0, 8760.0))
    alone = simulate(anywhere, hours=24.0, seed=5, index=2, out=tmp_path / "alone.nc")
    dates = xr.decode_cf(alone)["time"].values
    assert dates[0] != np.datetime64("2001-01-01T01")
    np.testing.assert_array_equal(alone["time_bnds"].values[:, 1], alone["time"].values)
    np.testing.assert_array_equal(alone["time_bnds"].values[:, 0], alone["time"].values - 3600.0)
    assert shard["start"].sel(system=2).values + np.timedelta64(1, "h") == dates[0]
    found = carried_out(roaming, monkeypatch)["date"]
    np.testing.assert_array_equal(found.sel(system=2).values, dates)
    # what the checker has left to say goes by names: of the FMU's variables, and of a time that is not a date
    faults = cf_faults(roaming / "shards" / "shard-000000.nc")
    known = ("should begin with a letter and be composed of", "Coordinate variable 'time' should have standard_name")
    assert {one for one in faults if not any(part in one for part in known)} == set()
    # one system of it is read as the recording that it is
    raw = xr.load_dataset(roaming / "shards" / "shard-000000.nc", decode_times=False)
    raw.sel(system=2).to_netcdf(tmp_path / "one.nc")
    one, same = (read_recording(tmp_path / name, default_system) for name in ("one.nc", "alone.nc"))
    np.testing.assert_array_equal(one.time, same.time)
    assert one.zero == same.zero


def test_a_single_simulation_is_the_farms_and_a_shorter_one_its_beginning(made, default_system):
    record = simulate(default_system, hours=96.0, seed=5, index=3)
    row = DatasetFolder(made).load().values[3]
    np.testing.assert_array_equal(record["TRoo"].values, row[0])
    np.testing.assert_array_equal(record["CO2"].values, row[1])
    short = simulate(default_system, hours=48.0, seed=5, index=1)["TRoo"].values
    np.testing.assert_allclose(short, DatasetFolder(made).load().values[1, 0, :48], atol=5e-3)


@pytest.mark.parametrize(
    ("change", "field"),
    [({"seed": 6}, "root_seed"), ({"hours": 48.0}, r"settings\.hours"), ({"systems": 7}, "systems")],
)
def test_other_settings_are_refused(made, default_system, change, field):
    before = (made / "manifest.json").read_bytes()
    with pytest.raises(DatasetError, match=rf"{field} is \S+, this run has \S+; .*own settings"):
        run(default_system, made, **{**SIZE, **change})
    assert (made / "manifest.json").read_bytes() == before


def test_a_folder_with_other_things_is_left_alone(default_system, tmp_path):
    (tmp_path / "thesis.txt").write_text("two years of work")
    with pytest.raises(DatasetError, match="not empty"):
        run(default_system, tmp_path, **SIZE)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_log_in_the_folder_does_not_bar_it(tank, tmp_path):
    """The command opens it first, and had then refused the folder for it."""
    with reported(Reporting(log=tmp_path / "log.jsonl"), Console()):
        run_here(tank, tmp_path, systems=2)
    assert verify(tmp_path) == []
    assert (tmp_path / "log.jsonl").stat().st_size > 0
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "log.jsonl").write_text("of something else")
    with pytest.raises(DatasetError, match="not empty"), reported(Reporting(log=tmp_path / "log.jsonl"), Console()):
        run_here(tank, tmp_path / "other", systems=2)


def test_a_share_of_the_systems_is_calm_and_stays_so_when_it_is_mended(made, default_system, tmp_path, in_this_process):
    run_here(default_system, tmp_path / "some", calm=0.5, **SIZE)
    run_here(default_system, tmp_path / "all", excitation=False, **SIZE)
    names = [one.name for one in default_system.inputs if one.source == "excitation"]
    some, none, every = (DatasetFolder(folder) for folder in (tmp_path / "some", tmp_path / "all", made))
    loaded = [one.load([*names, *default_system.output_names]) for one in (some, none, every)]
    calm = [is_calm(5, int(index), 0.5) for index in loaded[0].systems]
    assert 0 < sum(calm) < len(calm)
    for row, still in enumerate(calm):
        assert (not loaded[0].values[row, : len(names)].any()) == still
        assert np.array_equal(loaded[0].values[row], loaded[1 if still else 2].values[row])
    assert some.manifest.settings["calm"] == 0.5
    assert "calm" not in every.manifest.settings
    assert (
        "A share of\n0.5 of the systems, drawn by chance, had no excitation"
        in (tmp_path / "some/README.md").read_text()
    )
    assert not (tmp_path / "some" / "identifiability.json").exists()
    before = hashes(tmp_path / "some")
    damaged = tmp_path / "some" / "shards" / some.manifest.shards[1].file  # has calm systems
    damaged.write_bytes(damaged.read_bytes()[:-100])
    repair(tmp_path / "some", default_system.path)
    assert hashes(tmp_path / "some") == before


def test_a_share_that_is_none_is_refused(default_system, tmp_path):
    for share, excitation in ((-0.1, True), (1.0, True), (float("nan"), True), (0.5, False)):
        with pytest.raises(DatasetError, match="expected a share from 0 to less than 1 of the systems"):
            run(default_system, tmp_path / "ds", calm=share, excitation=excitation, **SIZE)
    assert not (tmp_path / "ds").exists()


@pytest.mark.parametrize(
    ("size", "season"),
    [
        ({"hours": 336.0}, "hours 0 to 336 of the year"),
        ({"preset": "paper-week"}, "hours 0 to 168 of the year"),
        ({"preset": "many-rooms"}, None),
    ],
)
@pytest.mark.usefixtures("nothing_simulated")
def test_ceilings_of_another_season_are_not_put_beside_data(default_system, tmp_path, caplog, size, season):
    caplog.set_level("INFO", "zeroshot")
    run(default_system, tmp_path, systems=6, quiet=True, **size)
    assert (tmp_path / "identifiability.json").exists() == (season is None)
    assert (f"not copied: it is of the whole year; this dataset is of {season}" in caplog.text) == (season is not None)


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
