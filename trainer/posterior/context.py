"""What a flow is told of a window: the estimator's answer and embedding, how long it is, and what is missing of it."""

from __future__ import annotations

import math

import numpy as np
import torch

from trainer.posterior.prior import Prior
from trainer.runs.checkpoint import CHUNK, Run

NEAREST = 0.005
"""Answers are kept this far inside their range, as a share of it: the probit of an end is infinite."""


def context_of(run: Run, prior: Prior, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
    """Contexts (windows, context), float32: answer, the same unclipped, embedding, facts, log length, missing shares.

    ``windows`` are encoded, (windows, length, columns), missing readings not a number; ``time`` are their first time
    stamps, float64 (windows,) [s since time zero].
    """
    encoding = run.card.encoding
    parts = []
    was_training = run.model.training
    run.model.eval()
    try:
        with torch.no_grad():
            for some, stamps in zip(windows.split(CHUNK), time.split(CHUNK), strict=True):
                answers, embedding = run.model.answer_and_embed(some, stamps)
                answers = run.model.with_known(answers, some)
                z = prior.to_normal(encoding.estimates(answers), NEAREST)
                static = some[:, 0, some.shape[2] - run.model.static :]
                missing = torch.isnan(some[:, :, : encoding.outputs]).float().mean(dim=1)
                length = torch.full((len(some), 1), math.log(some.shape[1] / encoding.length))
                parts.append(torch.cat([as_float(z), answers, embedding, static, length, missing], dim=1))
    finally:
        run.model.train(was_training)
    return torch.cat(parts)


def as_float(values: np.ndarray) -> torch.Tensor:
    """An array as a float32 tensor."""
    return torch.from_numpy(np.asarray(values, dtype=np.float32))
