"""Temperatures: how far each parameter's density is stretched so that its intervals cover, measured on other systems.

A flow is a little too sure of itself: it was trained on windows of few systems, which it remembers. For the factor t of
a parameter, the 90 % interval's ends move from the flow's centre c to c + t (end - c). A truth needs the t that brings
it inside; the 90 % quantile of the needed t over systems that the flow was not trained on makes 90 % of them covered.
This is conformal prediction (Romano et al., 2019, Conformalized quantile regression, arXiv:1905.03222) with a factor in
place of a margin, so that the result is a density still.
"""

from __future__ import annotations

import math

import torch

from trainer.posterior.card import ENOUGH
from trainer.posterior.conditions import Contexts
from trainer.posterior.flow import PosteriorFlow
from trainer.posterior.inference import LEVEL

SAMPLES = 256
"""Drawn per window, for the ends of its interval."""
WINDOWS = 2000
"""At most, of each length, with and without an output that is missing as a whole."""
FEWEST = 50
"""Where such a group has fewer windows, or fewer systems than :data:`ENOUGH`, those of its length are used, and where
these are few, all."""


def temper(flow: PosteriorFlow, held_out: Contexts, seed: int) -> None:
    """Set a flow's temperatures from windows of systems that it was not trained on.

    Each window length has two, for windows that lack an output as a whole and for those that do not: one for both would
    be too wide for a sensor's own parameter where the sensor is there.
    """
    flow.eval()
    generator = torch.Generator().manual_seed(seed)
    flow.log_temperature.zero_()
    found = []
    for length in range(len(flow.log_temperature)):
        own = held_out.of_length(length)
        own = own if _many(own, held_out) else held_out
        groups = [own.only(flow.lacking(own.context) == lacking) for lacking in (0, 1)]
        found += [_temperatures(flow, one if _many(one, held_out) else own, generator) for one in groups]
    flow.log_temperature.copy_(torch.stack(found).log().view_as(flow.log_temperature))


def _many(group: Contexts, held_out: Contexts) -> bool:
    """Whether a group has windows and systems enough, or as many systems as there are."""
    systems, all_systems = (len(torch.unique(one.system)) for one in (group, held_out))
    return len(group.z) >= FEWEST and systems >= min(ENOUGH, all_systems)


def _temperatures(flow: PosteriorFlow, windows: Contexts, generator: torch.Generator) -> torch.Tensor:
    """Factors (parameters,) that make nine tenths of some windows covered; of a few systems none narrows."""
    chosen = torch.randperm(len(windows.z), generator=generator)[:WINDOWS]
    needed = _needed(flow, windows.context[chosen], windows.z[chosen], generator)
    # split conformal prediction's margin for few systems; windows of one system do not count twice
    systems = len(torch.unique(windows.system[chosen]))
    share = min(1.0, math.ceil(LEVEL * (systems + 1)) / systems)
    found = needed.sort(dim=0).values[math.ceil(share * len(needed)) - 1]
    # a few systems that lie well inside are no reason to narrow anything
    return found if systems >= ENOUGH else found.clamp_min(1.0)


def _needed(flow: PosteriorFlow, context: torch.Tensor, z: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Factors (windows, parameters) that bring the truth z to the end of its interval."""
    base = torch.randn((len(z), SAMPLES, z.shape[1]), generator=generator)
    with torch.no_grad():
        samples, centre = flow.sample(context, base), flow.centre(context)
    # as `summarise` makes intervals: torch's quantile q lies at 1 + q (n - 1) of n sorted samples, theirs at q (n + 1)
    tail = ((1 - LEVEL) / 2 * (SAMPLES + 1) - 1) / (SAMPLES - 1)
    low, high = torch.quantile(samples, torch.tensor([tail, 1 - tail]), dim=1)
    reach = torch.where(z > centre, high - centre, centre - low)
    return (z - centre).abs().clamp_min(1e-6) / reach.clamp_min(1e-6)
