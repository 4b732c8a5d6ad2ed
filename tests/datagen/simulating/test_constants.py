"""Uncertain constants: drawn as they are declared, set in the FMU, and told in what is simulated."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from datagen import run, simulate, verify
from datagen.datasets.mending import repair
from datagen.driving.sampling import sample_parameters
from datagen.fmi.fmu import Fmu
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.simulator import Simulator
from shared.errors import DatasetError
from shared.store import read_manifest
from shared.variables import Uncertain
from tests.datagen.faults import run_here

SIZE = {"systems": 4, "hours": 48.0, "seed": 5, "shard_size": 2}
# of fmus/MixedAirCO2/DESIGN.md: 0.019 m of floor layer, J/(m2.K) and m2.K/W
FLOOR_C, FLOOR_R = 0.019 * 1630 * 608, 0.019 / 0.15


@pytest.fixture(scope="module")
def simulator(default_system):
    return Simulator(default_system)


@pytest.fixture(scope="module")
def drawn(default_system, tmp_path_factory):
    folder = tmp_path_factory.mktemp("constants") / "drawn"
    run_here(default_system, folder, uncertain=True, **SIZE)
    return folder


def shards(folder):
    return [xr.load_dataset(path) for path in sorted((folder / "shards").glob("*.nc"))]


def test_values_are_the_fmus_or_those_of_fixed(default_system, simulator):
    floor = constants(default_system, simulator.fmu)[:2]
    assert floor[0].parameters["floor.layer[1].C"] == pytest.approx(FLOOR_C, rel=1e-5)
    assert floor[1].parameters["floor.layer[1].R"] == pytest.approx(FLOOR_R, rel=1e-5)
    other = default_system.model_copy(update={"fixed": {"floor.layer[1].C": 100.0}})
    assert constants(other, simulator.fmu)[0].parameters["floor.layer[1].C"] == 100.0


def test_factors_are_log_normal_as_declared_and_independent(default_system):
    widths = np.linspace(0.05, 0.6, len(default_system.uncertain))
    some = [one.model_copy(update={"relative": w}) for one, w in zip(default_system.uncertain, widths, strict=True)]
    system = default_system.model_copy(update={"uncertain": some})
    z = np.log([sample_factors(system, 3, index) for index in range(2000)]) / widths
    assert min(stats.kstest(column, "norm").pvalue for column in z.T) > 1e-3
    others = np.array([sample_parameters(system, 3, index) for index in range(2000)])
    each = np.corrcoef(np.hstack([z, np.log(others)]).T) - np.eye(z.shape[1] + others.shape[1])
    assert np.abs(each).max() < 5 / np.sqrt(2000)


def test_a_dataset_tells_the_factors_that_its_systems_have(drawn, default_system, simulator):
    """Each system is the one that a simulation with the FMU parameters of its factors makes."""
    assert verify(drawn) == []
    manifest = read_manifest(drawn)
    assert [Uncertain(**one) for one in manifest.settings["uncertain"]] == default_system.uncertain
    known, names = constants(default_system, simulator.fmu), [one.name for one in default_system.uncertain]
    for shard in shards(drawn):
        for one in (shard.isel(system=k) for k in range(shard.sizes["system"])):
            factors = np.array([float(one[name]) for name in names])
            assert np.array_equal(factors, sample_factors(default_system, 5, int(one.system)))
            by_hand = simulate(
                default_system, parameters=values_of(known, factors), hours=48, seed=5, index=int(one.system)
            )
            for output in default_system.output_names:
                assert np.array_equal(by_hand[output], one[output])
        assert {shard[name].attrs["role"] for name in names} == {"constant"}
    card = (drawn / "README.md").read_text()
    assert "uncertain\nconstants of the description were drawn for each system." in card
    assert "| `floor.capacity` | constant | 1 | Heat capacity of the floor's layers, as a multiple of its value" in card
    assert not (drawn / "identifiability.json").exists()


@pytest.mark.usefixtures("in_this_process")
def test_a_drawn_dataset_is_mended_and_resumed_as_it_was(drawn, default_system):
    manifest = read_manifest(drawn)
    victim = drawn / "shards" / manifest.shards[1].file
    victim.unlink()
    wider = [one.model_copy(update={"relative": 0.5}) for one in default_system.uncertain]
    repair(drawn, default_system.path)
    assert verify(drawn) == []
    assert read_manifest(drawn).shards[1].content_hash == manifest.shards[1].content_hash
    with pytest.raises(DatasetError, match=r"settings\.uncertain is .*, this run has not set; .* its own settings"):
        run(default_system, drawn, **SIZE)
    with pytest.raises(DatasetError, match=r"settings\.uncertain is"):
        run(default_system.model_copy(update={"uncertain": wider}), drawn, uncertain=True, **SIZE)


def test_a_constant_that_is_set_is_not_drawn_and_the_others_are_drawn_as_before(default_system):
    """Of the floor one layer is set, and the other has its factor; the ceiling is set as a whole, and has none."""
    drawn = simulate(default_system, hours=24, uncertain=True)
    ceiling = default_system.uncertain[2]
    given = {"floor.layer[1].C": 9e4} | dict.fromkeys(ceiling.parameters, 1e4)
    found = simulate(default_system, parameters=given, hours=24, uncertain=True)
    others = [one.name for one in default_system.uncertain if one.name != ceiling.name]
    assert [name for name, one in found.data_vars.items() if one.attrs.get("role") == "constant"] == others
    for name in (*others, *default_system.parameter_names):
        assert float(found[name]) == float(drawn[name])
    known = constants(default_system, Fmu(default_system.fmu_path))
    factors = np.array([1.0 if one is ceiling else float(drawn[one.name]) for one in default_system.uncertain])
    by_hand = simulate(default_system, parameters=values_of(known, factors) | given, hours=24)
    assert np.array_equal(by_hand["TRoo"], found["TRoo"])
