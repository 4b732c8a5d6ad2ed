"""Random streams and the parameters' draw."""

from types import SimpleNamespace

import numpy as np
import pytest

from datagen.driving.sampling import record_start, sample_parameters, stream
from shared.system import System, parse_system
from shared.variables import Parameter

TEXT = """
schema_version = 1
name = "two"
fmu = "two.fmu"
[estimator]
channels = ["T"]
[[parameters]]
name = "a"
unit = "m"
min = 2.0
max = 4.0
[[parameters]]
name = "b"
unit = "W"
min = 1.0
max = 10000.0
scale = "log"
[[outputs]]
name = "T"
unit = "K"
accuracy = 0.01
"""


@pytest.fixture
def system(tmp_path) -> System:
    return parse_system(TEXT, tmp_path / "system.toml")


def test_uniform_in_each_scale(system):
    drawn = np.array([sample_parameters(system, 11, k) for k in range(4000)])
    assert drawn.shape == (4000, 2)
    u = np.stack([(drawn[:, 0] - 2) / 2, np.log10(drawn[:, 1]) / 4], axis=1)
    assert u.min() >= 0
    assert u.max() <= 1
    np.testing.assert_allclose(u.mean(axis=0), 0.5, atol=0.02)  # standard error 0.0046
    np.testing.assert_allclose(u.var(axis=0), 1 / 12, atol=0.005)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.06
    assert abs(np.corrcoef(u[:-1, 0], u[1:, 0])[0, 1]) < 0.06


def test_a_draw_depends_on_seed_and_index_alone(system):
    one = sample_parameters(system, 5, 2)
    np.testing.assert_array_equal(one, sample_parameters(system, 5, 2))
    assert not np.array_equal(one, sample_parameters(system, 5, 3))
    assert not np.array_equal(one, sample_parameters(system, 6, 2))
    other = system.model_copy(update={"parameters": [*system.parameters, Parameter(name="c", unit="1", min=1, max=2)]})
    np.testing.assert_array_equal(one, sample_parameters(other, 5, 2)[:2])


def test_streams_are_stable_over_processes_and_versions():
    # literals: datasets must still be reproducible after a change here
    assert stream(0, 0, "parameters").integers(10**6, size=3).tolist() == [193247, 763454, 513814]


@pytest.mark.parametrize(("span", "days"), [((0.0, 48.0), {0, 1, 2}), ((0.0, 47.0), {0, 1})])
def test_a_record_begins_at_any_midnight_of_the_span_the_last_one_too(span, days):
    system = SimpleNamespace(experiment=SimpleNamespace(start=span))
    starts = [record_start(system, 3, index) for index in range(200)]
    assert set(starts) == {86400.0 * day for day in days}
