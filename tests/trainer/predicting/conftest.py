"""Recordings of tanks, and an estimator that does without some of them."""

import pytest
import xarray as xr

from trainer.training.fitting import fit


@pytest.fixture
def shard(tanks):
    with xr.open_dataset(tanks / "shards" / "000.nc") as opened:
        return opened.load()


@pytest.fixture
def recording(shard):
    """One tank as a user would have measured it: the level alone, over time."""
    return shard.isel(system=4, drop=True)[["level"]].isel(time=slice(0, 100))


def write(dataset, path):
    dataset.to_netcdf(path)
    return path


@pytest.fixture(scope="module")
def flexible(tanks, tmp_path_factory):
    """An estimator that can do without one output, and with a shorter context."""
    return fit(
        *(tanks, tmp_path_factory.mktemp("flexible") / "run"),
        model="multiscale-transformer",
        channels=["level", "glow"],
        optional=["glow"],
        context_hours=24.0,
        other_contexts=[48.0],
        steps=30,
        options={"width": 16, "layers": 1, "feedforward": 16},
    )
