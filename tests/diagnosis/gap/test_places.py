"""A recording without places is refused before anything is fitted."""

import numpy as np
import pytest
import xarray as xr

from diagnosis.gap import diagnosed
from diagnosis.gap.places import labels_of
from shared.errors import RecordingError
from tests.diagnosis.gap.gap_cases import candidates, changed


@pytest.fixture
def refused(house, monkeypatch):
    """``refused(path)``: what is said of a recording; fails where the base model is fitted."""

    def begun(*_):
        raise AssertionError("the base model was fitted")

    monkeypatch.setattr(diagnosed, "begun", begun)

    def call(path):
        with pytest.raises(RecordingError) as told:
            diagnosed.diagnose(house("me"), path, effects=candidates(house("me"))[:1])
        return str(told.value)

    return call


def test_readings_of_the_first_steps_alone(house_recording, refused):
    path = changed(house_recording(hours=48), lambda t, y: np.where(t <= t[2], y, np.nan))
    assert refused(path) == (
        f"{path}: no output that counts was measured after the first 3 steps; expected readings of one throughout"
    )


def test_a_day_of_three_steps(house_recording, refused, tmp_path):
    data = xr.load_dataset(house_recording(hours=24), decode_times=False).isel(time=slice(7, None, 8))
    path = tmp_path / "third.nc"
    data.to_netcdf(path)
    assert refused(path) == f"{path}: has 3 steps of 8 h; expected at least 4"


def test_outputs_with_the_same_description_are_told_apart(house):
    system = house("me")
    (one,) = system.outputs
    outputs = [
        one.model_copy(update={"name": name, "long_name": long})
        for name, long in (("north", "air"), ("south", "air"), ("west", "wall"), ("top", None))
    ]
    assert labels_of(system.model_copy(update={"outputs": outputs})) == ["air (north)", "air (south)", "wall", "top"]
