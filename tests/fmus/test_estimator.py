"""The estimator that comes with the default system: it belongs to it, loads from its name, and estimates."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from shared.ceiling import read_ceilings
from shared.shipped import shipped_systems
from shared.system import load_system
from trainer.checkpoint import load_run
from trainer.prediction import predict

NAME = "MixedAirCO2"
HOME = shipped_systems()[NAME]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A room of a root seed that no part of the estimator has seen."""
    path = tmp_path_factory.mktemp("room") / "room.nc"
    simulate(NAME, seed=4711, hours=336, out=path)
    return path


def test_it_belongs_to_the_system_and_its_fmu():
    card, system = load_run(NAME).card, load_system(NAME)
    assert card.system_hash == system.hash()
    assert card.fmu_sha256 == hashlib.sha256(system.fmu_path.read_bytes()).hexdigest()
    assert card.encoding.parameters == system.parameter_names


def test_the_ceilings_beside_it_are_of_the_same_system():
    ceilings, system = read_ceilings(HOME / "identifiability.json"), load_system(NAME)
    assert ceilings.system_hash == system.hash()
    assert ceilings.fmu_sha256 == hashlib.sha256(system.fmu_path.read_bytes()).hexdigest()


def test_it_estimates_an_unseen_room(room):
    found = predict(NAME, room)
    assert found.context_hours == 168.0  # the longest of its contexts that two weeks have
    truth, usual = xr.load_dataset(room), load_run(NAME).card.validation_rmse
    errors = {
        name: (one.value - float(truth[name])) / usual[name] for name, one in found.predictions[0].parameters.items()
    }
    # rmse is over noisy and incomplete recordings too, so a clean and complete one does better
    assert np.sqrt(np.mean(np.square(list(errors.values())))) < 1.5, errors


def test_it_does_without_the_optional_sensors(room, tmp_path):
    card = load_run(NAME).card
    poor = tmp_path / "poor.nc"
    xr.load_dataset(room, decode_times=False).drop_vars(card.encoding.optional).to_netcdf(poor)
    found = predict(NAME, poor)
    assert found.absent == card.encoding.optional
    assert found.predictions[0].parameters


def test_what_it_has_seen_is_written_down():
    card = load_run(NAME).card
    assert set(card.training_systems.root_seeds) == {2026}
    assert not set(card.training_systems.indices) & set(card.validation_systems.indices)
    assert len(Path(HOME / "estimator" / "estimator.json").read_bytes()) < 200_000
