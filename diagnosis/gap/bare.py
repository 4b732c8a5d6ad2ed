"""The base model where the fit of an effect lies, on the same straight lines.

The evidence of a fit holds along the straight lines (of the nuisance) that were drawn where it is, and the search for
the optimum may end in another place with an effect than without. Two fits that lie far apart then differ, in replay
where nobody counted the persons by up to a hundred, whatever the effect does: a clock that was off by half a minute had
108 more than the base model, but 0.3 less than the base model on the clock's own lines. So the base model is fitted
where effects led to, too, and an effect has to better the best of its fits.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import Refit, refit


def bare(one: Refit, base: Refit, colours: dict[int, Colour]) -> list[Refit]:
    """The base model on a refit's lines, fitted from where the effects left the parameters and from where it was.

    Parameters
    ----------
    one
        Of the base model with effects.
    base
        Of the base model.
    colours
        By channel, of the evidences.

    Returns
    -------
    list of Refit
        Those that can be simulated.
    """
    problem = one.lin.problem.with_effects(())
    first = len(problem.system.parameters)
    own = np.delete(one.lin.z, range(first, first + len(one.lin.chosen)))
    made = []
    for start in (own, base.lin.z):
        with suppress(*FAILURES):
            lin = linearised(problem, start, one.lin.around, like=one.lin)
            there = refit(Grams(lin, one.grams.observed, one.grams), colours, start, ())
            made.append(replace(there, simulations=there.simulations + lin.simulations))
    return made
