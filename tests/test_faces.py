"""The Python face: what the packages offer, and how results look in a notebook."""

import ast
import importlib

import pytest

import datagen
from shared.errors import DatasetError
from shared.store import DatasetFolder
from tests.conftest import ROOT
from tests.trainer.conftest import make_dataset
from trainer import evaluate, fit, predict

PACKAGES = ("datagen", "trainer", "diagnosis")


@pytest.fixture(scope="module")
def tanks(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("tanks") / "ds", systems=40)


@pytest.fixture(scope="module")
def run(tanks, tmp_path_factory):
    return fit(tanks, tmp_path_factory.mktemp("ridge") / "run", model="ridge", steps=2)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_offered_and_is_what_its_module_calls_so(name):
    package = importlib.import_module(name)
    assert dir(package) == package.__all__ == sorted(package._HOMES)
    for one, home in package._HOMES.items():
        assert getattr(package, one) is getattr(importlib.import_module(home), one)
    assert (ROOT / name / "py.typed").exists()


@pytest.mark.parametrize("name", PACKAGES)
def test_a_type_checker_sees_every_public_name_where_it_lives(name):
    """The imports that only a type checker makes: mypy itself checks that each module has the name."""
    tree = ast.parse((ROOT / name / "__init__.py").read_text())
    (branch,) = [one for one in tree.body if isinstance(one, ast.If)]
    assert ast.unparse(branch.test) == "TYPE_CHECKING"
    seen = {alias.asname: one.module for one in branch.body for alias in one.names}
    assert seen == importlib.import_module(name)._HOMES


def test_a_dataset_is_opened_lazily_and_is_what_lies_in_its_shards(tanks):
    data = datagen.open(tanks)
    records = DatasetFolder(tanks).load(["level"])
    assert data.sizes["system"] == 40 and data["level"].chunks is not None
    assert (data["level"].values == records.values[:, 0]).all()
    assert (data["tank.fill"].values == records.parameters[:, 1]).all()
    assert set(data["split"].values) == {"train", "validation", "test"}
    assert data["level"].attrs["units"] == "m"
    assert data["time"].dtype.kind == "M"
    assert len(repr(data)) < 3000


def test_a_damaged_shard_is_refused_when_it_is_read(tanks, tmp_path):
    own = make_dataset(tmp_path / "own", systems=10)
    data = datagen.open(own)
    path = own / "shards" / "001.nc"
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    assert data["level"][0].values.all()
    with pytest.raises(DatasetError, match=r"001\.nc: damaged or changed"):
        data["level"].load()


def test_a_dataset_in_memory_stands_for_its_folder_and_a_part_of_it_for_nothing(tanks, run, tmp_path):
    data = datagen.open(tanks)
    mine = fit(data, tmp_path / "mine", model="ridge", steps=2)
    assert mine.card.weights_sha256 == run.card.weights_sha256
    assert evaluate(mine, data) == evaluate(mine, tanks)
    with pytest.raises(DatasetError, match="has 10 of its 40 systems; expected all of them"):
        fit(data.isel(system=slice(10)), tmp_path / "part", model="ridge")
    with pytest.raises(DatasetError, match=r"does not say which dataset it is; expected one of `datagen\.open`"):
        fit(data.drop_encoding(), tmp_path / "other", model="ridge")


def test_results_are_short_as_text_and_tables_for_people(tanks, run):
    found, scores = predict(run, tanks / "shards" / "000.nc"), evaluate(run, tanks)
    for one in (run, found, scores, DatasetFolder(tanks).manifest, datagen.info(tanks)):
        assert 10 < len(repr(one)) < 300 and "\n" not in repr(one)
        assert "<table" in one._repr_html_() and len(one._repr_html_()) < 30_000
        assert len(one.to_dataframe())
    table = found.to_dataframe()
    assert table.loc[(3, "tank.fill"), "value"] == found.predictions[3].parameters["tank.fill"].value
    assert scores.to_dataframe().loc[("tank.fill", "unseen"), "r2"] == scores.protocols["unseen"].r2["tank.fill"]
    for one in (found, scores):
        assert one.plot().axes
