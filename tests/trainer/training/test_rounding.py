"""What a processor makes of bfloat16 is measured: whatever it is, it is a ratio of two times."""

import time
from types import SimpleNamespace

import pytest

from trainer.training import rounding


def test_the_ratio_is_that_of_the_times(monkeypatch):
    clock = [0.0]

    def product(left, right):
        clock[0] += 0.006 if left.dtype.itemsize == 2 else 0.002

    monkeypatch.setattr(rounding, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    monkeypatch.setattr(rounding.torch, "mm", product)
    assert rounding.slowdown() == pytest.approx(3)


def test_it_is_measured_in_no_time():
    began = time.perf_counter()
    assert rounding.slowdown() > 0
    assert time.perf_counter() - began < 5
