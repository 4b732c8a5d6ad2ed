"""A posterior ready to use: samples, densities and summaries of the parameters behind windows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from shared.errors import EstimatorError
from trainer.memory import memory_for
from trainer.posterior.card import PosteriorCard
from trainer.posterior.context import as_float, context_of
from trainer.posterior.flow import PosteriorFlow
from trainer.posterior.prior import Prior
from trainer.reading.facts import known_parameters
from trainer.runs.checkpoint import Run
from trainer.seeds import check_seed

LEVEL = 0.9
"""Of the intervals."""
FEWEST = round(2 / (1 - LEVEL))
"""Samples that such an interval takes at least: 20, of which one is expected beyond each of its ends. With fewer, the
outermost samples alone say where it ends and its width is their accident; of a single sample it has none."""


class Summary(NamedTuple):
    """What samples (windows, n, parameters) say.

    All are (windows, parameters) [own units] but ``correlation``, (windows, parameters, parameters). ``low`` and
    ``high`` are the ends of the central interval of LEVEL.
    """

    median: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    low: np.ndarray
    high: np.ndarray
    correlation: np.ndarray


class Posterior:
    """The distribution of the parameters given a window."""

    def __init__(self, run: Run, card: PosteriorCard, flow: PosteriorFlow, prior: Prior) -> None:
        self.run, self.card, self.prior = run, card, prior
        self.flow = flow.eval()

    def sample(
        self, values: np.ndarray, time: np.ndarray, n: int, *, seed: int = 0, facts: np.ndarray | None = None
    ) -> np.ndarray:
        """Samples (windows, n, parameters) [own units], float64; equal seeds give equal samples.

        ``values``, ``time`` and ``facts`` are as for :meth:`trainer.runs.checkpoint.Run.estimate`. Samples of a known
        parameter have its value; those of the others are conditioned on it. Raises EstimatorError if the windows have a
        length that the posterior was not fitted to, ``n`` is not positive, or ``seed`` is negative.
        """
        return self.sample_encoded(*self.run.encoded(values, time, facts), n, seed=seed)

    def sample_encoded(self, windows: torch.Tensor, time: torch.Tensor, n: int, *, seed: int = 0) -> np.ndarray:
        """As :meth:`sample`, of encoded windows (windows, length, columns)."""
        if n < 1:
            raise EstimatorError(f"samples: is {n}; expected at least 1 sample")
        check_seed(seed)
        length = self._which_length(windows)
        context = context_of(self.run, self.prior, windows, time)
        # numpy's stream is filled window by window: the samples of one do not depend on how many follow it
        size = (len(context), n, self.flow.parameters_count)
        with memory_for(f"{n} samples of each of {len(context)} windows"), torch.no_grad():
            base = np.random.default_rng(seed).standard_normal(size, np.float32)
            samples = self.prior.from_normal(self.flow.sample(context, torch.from_numpy(base), length).numpy())
        if not self.run.model.known:
            return samples
        known, values = known_parameters(windows, self.run.model.static, self.run.model.known)
        exact = self.run.card.encoding.estimates(values)
        return np.where(known.numpy()[:, None], exact[:, None], samples)

    def log_prob(self, values: np.ndarray, time: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Log density [nat, per own units] at parameters, (windows,) or (windows, n).

        It is minus infinity outside the ranges. ``values`` and ``time`` are as for :meth:`sample`; ``parameters`` are
        (windows, parameters) or (windows, n, parameters) [own units].
        """
        return self.log_prob_encoded(*self.run.encoded(values, time), parameters)

    def log_prob_encoded(self, windows: torch.Tensor, time: torch.Tensor, parameters: np.ndarray) -> np.ndarray:
        """As :meth:`log_prob`, of encoded windows (windows, length, columns)."""
        length = self._which_length(windows)
        context = context_of(self.run, self.prior, windows, time)
        points = parameters if parameters.ndim == 3 else parameters[:, None]
        flat = points.reshape(-1, points.shape[-1])
        with torch.no_grad():
            density = self.flow.log_prob(context, as_float(self.prior.to_normal(points)), length)
        inside = self.prior.inside(flat)
        safe = np.where(inside[:, None], flat, self.prior.low)
        found = np.where(inside, density.double().numpy().ravel() + self.prior.log_jacobian(safe), -np.inf)
        return found.reshape(parameters.shape[:-1])

    def _which_length(self, windows: torch.Tensor) -> int:
        if windows.shape[1] not in self.card.lengths:
            found = ", ".join(map(str, self.card.lengths))
            raise EstimatorError(f"windows have {windows.shape[1]} samples; the posterior was fitted to {found}")
        return self.card.lengths.index(windows.shape[1])


def check_samples(n: int) -> None:
    """Refuse fewer samples of a posterior than FEWEST, which its interval takes: an EstimatorError."""
    if n < FEWEST:
        raise EstimatorError(
            f"samples: is {n}; expected at least {FEWEST}, so that one lies beyond each end of the"
            f" {100 * LEVEL:g} % interval"
        )


def summarise(samples: np.ndarray) -> Summary:
    """Median, mean, standard deviation, 90 % interval and correlations of samples (windows, n, parameters).

    The k-th of n sorted samples has a share of k / (n + 1) below it on average (Hyndman and Fan, 1996, Sample quantiles
    in statistical packages, definition 6), so that the interval holds 90 % whatever n is; between numpy's default
    quantiles lie 0.9 (n - 1) / (n + 1) only, 81 % with 20 samples.
    """
    tail = (1 - LEVEL) / 2
    low, median, high = np.quantile(samples, [tail, 0.5, 1 - tail], axis=1, method="weibull")
    mean, sd = samples.mean(axis=1), samples.std(axis=1)
    scaled = (samples - mean[:, None]) / np.where(sd > 0, sd, 1)[:, None]
    correlation = np.einsum("wni,wnj->wij", scaled, scaled) / samples.shape[1]
    return Summary(median, mean, sd, low, high, correlation)
