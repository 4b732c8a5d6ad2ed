"""How large and how slow the error of each channel is: the noise of the null, and what a gap adds to it.

The description says how large a sensor's error is, not how it is coloured. A colour that were free in size would
take up the gap itself; so the size stays what the description says (noise, rounding and the model's own accuracy), and
only the colour is estimated: the share of the variance that is slow, and its memory; and beside it a slow error of the
model itself (the floor) of at most the sensor's own. That is done with the amplitudes of all candidates integrated
out, lest a candidate's signature pass for colour (type II maximum likelihood, Rasmussen and Williams 2006, section
5.4.1). Channels take turns.

Recording and twins are judged by one colour for each channel, the posterior's mean. Judged by the most plausible colour
alone, twins that are drawn with another plausible one would seem to hold gaps, and a real gap would have to be larger
than theirs to be seen.

A **discrepancy** is a slow error beyond that size: what is left when no cause is named. Its gain in log evidence
measures a gap of whatever cause.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.noise import HOUR
from diagnosis.gap.grams import Colour, Grams

SHARES = (0.3, 0.5)
MEMORIES = (3 * HOUR, 10 * HOUR)
FLOORS = (0.25, 0.5)
"""Standard deviations of the model's own slow error, in those of the channel's noise: a model that is right in all that
matters is still no more than a model, and no smaller discrepancy than this is called a gap. With 0.7 and 1.0 it took
up gaps that could be seen (docs/blind-check.md)."""
FLOOR_MEMORIES = (10 * HOUR, 40 * HOUR)
SIZES = (1.5, 3.0, 6.0, 12.0)
"""Standard deviations of a discrepancy, in those of the channel's noise."""
DISCREPANCY_MEMORIES = (4 * HOUR, 24 * HOUR)
GRAIN = 0.1
"""To which variances of a mean colour are rounded, in those of the channel's noise."""
WIDE = 2.0
"""Prior standard deviation of the candidates' amplitudes while colours are estimated [scales]."""
_PASSES = 2


@dataclass(frozen=True)
class Colours:
    """``best`` colour by channel, to judge by; ``weights``: posterior of each channel's colours, others at the best."""

    best: dict[int, Colour]
    weights: dict[int, list[tuple[Colour, float]]]
    evidence: float


def estimated_colours(grams: Grams, size: np.ndarray) -> Colours:
    """The colour of each channel's noise of a given size (outputs,) [unit of each], and how sure it is."""
    options: dict[int, list[Colour]] = {}
    for k in grams.channels:
        one = float(size[k])
        slow = [(one * (1 - s) ** 0.5, one * s**0.5, memory) for s in SHARES for memory in MEMORIES]
        floor = [(one, one * f, memory) for f in FLOORS for memory in FLOOR_MEMORIES]
        options[k] = [(one, 0.0, HOUR), *slow, *floor]
    found = _climbed(grams, {k: ones[0] for k, ones in options.items()}, options, WIDE, 0.0)
    return replace(found, best={k: mean_colour(found.weights[k], float(size[k])) for k in grams.channels})


def mean_colour(weights: list[tuple[Colour, float]], size: float) -> Colour:
    """Mean of colours: of the variances of both parts, and of the memory's logarithm by the slow part's variance.

    Rounded, so that what was made with a colour is found again when the candidates are a few fewer.
    """
    share = np.array([one for _, one in weights])
    white, slow, memory = np.array([colour for colour, _ in weights]).T
    both = np.array([share @ white**2, share @ slow**2]) / size**2
    rounded = GRAIN * np.round(both / GRAIN)
    if rounded[1] <= 0:
        return float(size * np.sqrt(max(rounded[0], GRAIN))), 0.0, HOUR
    log = share * slow**2 @ np.log(memory) / (share @ slow**2)
    nearest = min({*MEMORIES, *FLOOR_MEMORIES}, key=lambda one: abs(np.log(one) - log))
    return float(size * np.sqrt(max(rounded[0], GRAIN))), float(size * np.sqrt(rounded[1])), nearest


def discrepancy(grams: Grams, colours: Colours, size: np.ndarray) -> tuple[float, dict[int, Colour]]:
    """Gain in log evidence of slow errors beyond the noise, and the colours with them.

    Every channel pays for the choice among its colours.
    """
    options = {
        k: [colours.best[k]]
        + [(float(size[k]), float(size[k]) * each, memory) for each in SIZES for memory in DISCREPANCY_MEMORIES]
        for k in grams.channels
    }
    cost = float(np.log(len(SIZES) * len(DISCREPANCY_MEMORIES)))
    found = _climbed(grams, colours.best, options, 0.0, cost)
    return found.evidence - grams.evidence(colours.best), found.best


def _climbed(
    grams: Grams, start: dict[int, Colour], options: dict[int, list[Colour]], effects: float, cost: float
) -> Colours:
    """Channel by channel the best of its options; any but the first pays ``cost``."""
    best, weights, value = dict(start), {}, 0.0
    for _ in range(_PASSES):
        before = dict(best)
        for k in grams.channels:
            found = [
                grams.evidence({**best, k: one}, effects) - (cost if one != options[k][0] else 0.0)
                for one in options[k]
            ]
            best[k] = options[k][int(np.argmax(found))]
            share = np.exp(np.array(found) - max(found))
            weights[k] = list(zip(options[k], (share / share.sum()).tolist(), strict=True))
        if best == before:
            break
    value = grams.evidence(best, effects) - cost * sum(best[k] != options[k][0] for k in grams.channels)
    return Colours(best, weights, value)
