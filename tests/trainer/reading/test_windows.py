from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.reading.data import load_records
from trainer.reading.encoding import make_encoding
from trainer.reading.noise import Sensors
from trainer.reading.windows import Sampler, WindowSource, context_length, disjoint_windows


@pytest.fixture(scope="module")
def records(tanks):
    return load_records(DatasetFolder(tanks), ["level", "glow"])


@pytest.fixture(scope="module")
def source(tanks, records):
    system = DatasetFolder(tanks).system
    encoding = make_encoding(system, records, [], 470, records.of_split("train"))
    return WindowSource(records, encoding, Sensors(system, records.channels, "none"), torch.Generator())


def test_gathered_windows_are_slices_of_the_records(source, records):
    batch = source.gather(torch.tensor([3, 17]), torch.tensor([0, 10]))
    for window, row, start in zip(batch.windows, (3, 17), (0, 10), strict=True):
        raw = records.values[row, :, start : start + 470].T
        expected = (raw - np.array(source.encoding.mean)) / np.array(source.encoding.sd)
        np.testing.assert_allclose(window, expected, atol=1e-5)
    assert batch.time.tolist() == [1800.0, 11 * 1800.0]
    np.testing.assert_allclose(source.encoding.estimates(batch.targets), records.parameters[[3, 17]], rtol=1e-5)


def test_systems_and_starts_are_drawn_uniformly(source):
    rows = np.array([5, 7, 11, 13])
    which, starts = Sampler(source, rows, seed=3).indices(20_000)
    assert set(which.tolist()) == set(rows.tolist())
    # a record of 480 samples has eleven windows of 470: starts 0 to 10, both ends included
    assert (int(starts.min()), int(starts.max())) == (0, 10)
    table = np.histogram2d(np.searchsorted(rows, which.numpy()), starts.numpy(), bins=(np.arange(5), np.arange(12)))[0]
    assert chisquare(table.flatten()).pvalue > 1e-3


@given(
    systems=st.integers(1, 6),
    samples=st.integers(1, 60),
    length=st.integers(1, 25),
    count=st.integers(1, 30),
    seed=st.integers(0, 99),
)
def test_disjoint_windows_never_overlap(systems, samples, length, count, seed):
    rows = 10 + np.arange(systems)
    where, starts = disjoint_windows(rows, samples, length, count, np.random.default_rng(seed))
    assert len(where) == len(starts) == min(count, systems * (samples // length))
    assert np.isin(where, rows).all()
    used = np.zeros((systems, samples), int)
    for row, start in zip(where - 10, starts, strict=True):
        assert 0 <= start <= samples - length
        used[row, start : start + length] += 1
    assert used.max(initial=0) <= 1


def test_a_context_is_a_whole_number_of_samples(records):
    assert context_length(24, records) == 48
    assert context_length(240, records) == 480
    with pytest.raises(EstimatorError, match=r"context is 240.5 h \(481 samples\); the dataset's records have 480"):
        context_length(240.5, records)
    for hours in (0.7, 0, -3):
        with pytest.raises(EstimatorError, match="expected a whole number of steps of 1800 s"):
            context_length(hours, records)


def test_a_record_has_its_own_beginning(tanks, records):
    """The clock of a window is that of its record, wherever in the year it begins."""
    system = DatasetFolder(tanks).system
    moved = replace(records, starts=86400.0 * np.arange(len(records.systems)))
    encoding = make_encoding(system, moved, ["time_of_day"], 48, moved.of_split("train"))
    source = WindowSource(moved, encoding, Sensors(system, moved.channels, "none"), torch.Generator())
    batch = source.gather(torch.tensor([0, 3]), torch.tensor([0, 10]))
    assert batch.time.tolist() == [1800.0, 3 * 86400 + 11 * 1800.0]
