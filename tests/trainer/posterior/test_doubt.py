"""A posterior of which it is told that its intervals are not to be trusted."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from shared.schema import SPLITS, split_of
from trainer.posterior.card import ENOUGH
from trainer.posterior.conditions import Contexts
from trainer.posterior.fitting import _halves
from trainer.posterior.inference import LEVEL
from trainer.posterior.tempering import _temperatures

# truth and samples are of one law: nothing is to be stretched
RIGHT = SimpleNamespace(sample=lambda _, base: base, centre=lambda context: torch.zeros(len(context), 1))


def windows_of(z: torch.Tensor, each: int = 3) -> Contexts:
    """So many windows of systems with truths z (systems,)."""
    truth = z.repeat_interleave(each)[:, None]
    systems = torch.arange(len(z)).repeat_interleave(each)
    return Contexts(torch.zeros(len(truth), 1), truth, torch.zeros(len(truth), dtype=torch.int64), systems)


def test_the_guide_says_how_many_systems_a_dataset_needs_for_nine_that_calibrate():
    """It said 180: of seventeen validation systems nine calibrate, and eight are fitted to."""

    def calibrating(systems):
        rows = np.array([index for index in range(systems) if split_of(1, index) == SPLITS.index("validation")])
        return len(_halves(rows, None, 0)[1])

    least = next(systems for systems in range(100, 300, 10) if calibrating(systems) >= ENOUGH)
    guide = " ".join((Path(__file__).parents[3] / "docs" / "own-fmu.md").read_text(encoding="utf-8").split())
    assert f"For 90 % this takes nine systems, so {least} in all" in guide


@pytest.mark.parametrize("systems", [2, 9])
def test_intervals_of_a_flow_that_is_right_hold_nine_tenths_however_few_calibrate(systems):
    """They held 71 % with two systems, 85 % with five; truths are normal, so that coverage follows from the factor."""
    generator = torch.Generator().manual_seed(1)
    factors = torch.stack(
        [_temperatures(RIGHT, windows_of(torch.randn(systems, generator=generator)), generator)[0] for _ in range(200)]
    )
    assert torch.erf(1.645 * factors / 2**0.5).mean() > LEVEL - 0.02
