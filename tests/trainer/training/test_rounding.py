"""What a processor makes of bfloat16 is measured: whatever it is, it is a ratio of two times."""

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
