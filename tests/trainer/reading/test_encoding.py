import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from shared.errors import EstimatorError
from shared.schema import methods_of
from shared.store import Records
from shared.system import load_system
from trainer.reading.encoding import clock_columns, make_encoding, split_channels
from trainer.runs.checkpoint import load_run
from trainer.training.beginning import encoding_of
from trainer.training.fitting import fit

from ..conftest import tank_system

DAY = 86400.0


def records(values: np.ndarray, parameters: np.ndarray) -> Records:
    count = len(values)
    return Records(
        channels=["level"],
        values=values.astype(np.float32),
        parameters=parameters,
        systems=np.arange(count),
        splits=np.zeros(count, np.int8),
        time=1800.0 * np.arange(1, values.shape[2] + 1),
    )


@pytest.fixture
def data():
    rng = np.random.default_rng(0)
    return rng.normal(3.0, 2.0, (5, 1, 40)), rng.uniform(2.0, 4.0, (5, 2))


def test_normalisation_comes_from_training_systems_alone(data):
    values, parameters = data
    training = np.array([0, 2, 3])
    before = make_encoding(tank_system(), records(values, parameters), [], 10, training)
    values[[1, 4]] += 1000.0
    parameters[[1, 4]] *= 7.0
    after = make_encoding(tank_system(), records(values, parameters), [], 10, training)
    assert before == after
    assert before.mean == pytest.approx([values[training].mean()], rel=1e-6)
    assert before.sd == pytest.approx([values[training].std()], rel=1e-6)
    assert before.target_mean == pytest.approx(np.log10(parameters[training]).mean(axis=0))
    assert before.target_sd == pytest.approx(np.log10(parameters[training]).std(axis=0))


def test_a_channel_that_does_not_vary_is_encoded_as_zero(data):
    values, parameters = data
    encoding = make_encoding(tank_system(), records(0 * values + 420.0, parameters), [], 10, np.arange(5))
    windows = encoding.encode(torch.full((2, 10, 1), 420.0), torch.zeros(2, dtype=torch.float64))
    assert (encoding.sd, encoding.constant) == ([1.0], ["level"])
    assert make_encoding(tank_system(), records(values, parameters), [], 10, np.arange(5)).constant == []
    assert torch.equal(windows, torch.zeros(2, 10, 1))


@given(drain=st.floats(2.0, 20.0), fill=st.floats(1.0, 4.0))
def test_targets_and_estimates_are_inverse(drain, fill):
    rng = np.random.default_rng(0)
    encoding = make_encoding(
        tank_system(), records(rng.normal(size=(4, 1, 20)), rng.uniform(1.5, 9.0, (4, 2))), [], 10, np.arange(4)
    )
    parameters = np.array([[drain, fill]])
    assert encoding.estimates(encoding.targets(parameters)) == pytest.approx(parameters, rel=1e-5)


def test_estimates_stay_within_the_ranges(data):
    encoding = make_encoding(tank_system(), records(*data), [], 10, np.arange(5))
    assert encoding.estimates(torch.tensor([[1e3, -1e3]])).tolist() == [[20.0, 1.0]]


def test_clock_columns_of_known_hours():
    # 06:00 on the first Wednesday, then 12:00 and 18:00
    columns = clock_columns(torch.tensor([2 * DAY + DAY / 4], dtype=torch.float64), 3, DAY / 4, DAY)
    np.testing.assert_allclose(columns[0], [[1, 0], [0, -1], [-1, 0]], atol=1e-6)
    week = clock_columns(torch.tensor([7 * DAY * 1000], dtype=torch.float64), 1, DAY, 7 * DAY)
    np.testing.assert_allclose(week[0], [[0, 1]], atol=1e-6)


def test_channels_are_sorted_into_recorded_and_derived():
    assert split_channels(tank_system(), None) == (["level"], [])
    assert split_channels(tank_system(), ["time_of_day", "valve", "glow"]) == (["glow", "valve"], ["time_of_day"])


@pytest.mark.parametrize(
    ("channels", "sentence"),
    [
        (["levle"], "'levle' is not a channel of Tank; found level, glow, valve"),
        (["level", "level"], "'level' is named twice"),
        (["time_of_day"], "none of them is recorded"),
    ],
)
def test_wrong_channels_are_refused(channels, sentence):
    with pytest.raises(EstimatorError, match=sentence):
        split_channels(tank_system(), channels)


def test_a_run_in_whose_training_a_channel_never_varied_is_not_begun_with_where_it_does(tanks, tmp_path):
    """Its standard deviation is of nothing, and the card would go on to say that it stands still."""
    options = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}
    run = fit(tanks, tmp_path / "run", options=options, channels=["level", "valve"], steps=2)
    moving = run.card.encoding.model_copy(update={"constant": []})
    with pytest.raises(EstimatorError, match=r"run: valve never varied in its training; expected a run"):
        encoding_of(run, moving)
    assert encoding_of(run, run.card.encoding).constant == ["valve"]


def test_the_shipped_estimator_knows_its_means_from_its_instants():
    encoding, methods = load_run("MixedAirCO2").card.encoding, methods_of(load_system("MixedAirCO2"))
    assert encoding.methods == [methods[name] for name in encoding.recorded]
    assert [name for name in encoding.recorded if methods[name] == "mean"] == ["QHea", "mOA", "TSet"]
