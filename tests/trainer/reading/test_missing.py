import pytest
import torch

from trainer.reading.missing import GAPS, LONGEST, WITHOUT, Missing


def lost(optional, seed=0, batch=4000, outputs=3):
    values = torch.zeros(batch, 100, 4)
    known = ["a", "b", "c", "valve"]
    return torch.isnan(Missing(known, outputs, optional)(values, torch.Generator().manual_seed(seed)))


def test_optional_channels_are_absent_as_often_as_said():
    whole = lost(["b", "c"]).all(dim=1).double()
    assert not whole[:, 0].any()
    # half lack both; of the other half, one half lacks each by the toss of a coin
    assert (whole[:, 1] * whole[:, 2]).mean().item() == pytest.approx(WITHOUT + 0.25 * 0.25, abs=0.03)
    assert whole[:, 1].mean().item() == pytest.approx(WITHOUT + 0.25 * 0.5, abs=0.03)


def test_gaps_are_stretches_of_outputs_only():
    mask = lost([])
    assert not mask[:, :, 3].any()
    some = mask.any(dim=1)[:, :3].double()
    # a gap may fall between two samples, or begin at the end
    assert GAPS * 0.8 < some.mean().item() <= GAPS + 0.02
    edges = (mask[:, 1:] != mask[:, :-1]).sum(dim=1)
    assert int(edges.max()) <= 2  # one stretch
    assert int(mask.sum(dim=1).max()) <= LONGEST * 100 + 1


def test_readings_that_stay_are_untouched():
    values = torch.rand(50, 20, 2)
    made = Missing(["a", "b"], 2, ["b"])(values, torch.Generator().manual_seed(1))
    kept = ~torch.isnan(made)
    assert torch.equal(made[kept], values[kept])
