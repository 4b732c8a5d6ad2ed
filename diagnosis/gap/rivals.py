"""The base model and candidates as rivals: fitted on one line, and which of them is the more plausible.

Rivals begin and are treated alike, because an evidence holds where it was worked out: two models that were fitted
from different starts differ by where the search ended as well as by what they are. And a line at the base model's fit
says nothing of a cause that has bent the parameters there: plug loads of twice their usual size look like warm outdoor
air. So

1. on one line, drawn where the base model's fit began or, where that is far off, where it came near, each candidate is
   refitted with the parameters (:func:`from_one_start`). It begins with the amplitude that promises most there, of a
   grid over its prior: what it does need not grow with its amplitude (a timetable that is moved by two hours meets
   another hour of the day). That ranks forty candidates for ten simulations each;
2. the foremost and the base model are refitted on one line that is drawn where the best of them is
   (:func:`on_the_best_line`); what moves an input in time is simulated there with amplitudes from all over its range.

Fitted each to its own rest, nuisance and all, one and the same model differs by tens in log evidence between two
starts where nobody counted the persons or meters drive the model: by more than most candidates differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.effects import Effect, moved_in_time
from diagnosis.fitting.failures import FAILURES, reason
from diagnosis.fitting.grams import AMPLITUDE, Colour, Grams, projected
from diagnosis.fitting.lines import Linearised, linearised
from diagnosis.fitting.refit import Refit, inner, misfit, refit, relinearised, step_from
from shared.errors import SimulationError

GRID = (-4.0, -2.0, -0.5, 0.5, 2.0, 4.0)
"""Amplitudes that are tried at first [scales]: out to twice the prior's standard deviation, and well within it."""
FINE = np.linspace(-8.0, 8.0, 17)
"""Of an effect that moves an input in time: every step of the readings has a trough of its own."""


@dataclass(frozen=True)
class Rivals:
    """Refits on one line by the nuisance.

    ``base`` without an effect, ``refits`` of the candidates, the best first; ``failed``: candidates that could not be
    refitted, and why.
    """

    base: Refit
    refits: tuple[Refit, ...]
    failed: dict[str, str] = field(default_factory=dict)


def from_one_start(
    line: Linearised, effects: Sequence[Effect], observed: np.ndarray, colours: dict[int, Colour]
) -> Rivals:
    """Refit the base model and all candidates from one start, on one line by the nuisance.

    Parameters
    ----------
    line
        At the start, without effects.
    observed
        Readings that count, shape (outputs, steps).
    colours
        Of the noise, by channel.

    Raises
    ------
    SimulationError
        If the base model cannot be simulated there.
    """
    start = line.z
    amplitudes, secants, failed = begun(line, effects, observed, colours)
    grams = Grams(replace(line, by_effect=secants, effects=tuple(effects)), observed)
    base = refit(grams, colours, start, (), redrawn=False)
    first, made = len(line.problem.system.parameters), []
    for effect, amplitude in zip(effects, amplitudes.tolist(), strict=True):
        if effect.name in failed:
            continue
        try:
            made.append(refit(grams, colours, np.insert(start, first, amplitude), [effect], redrawn=False))
        except FAILURES as error:
            failed[effect.name] = reason(error)
    return Rivals(base, tuple(sorted(made, key=lambda one: -one.evidence)), failed)


def begun(
    lin: Linearised, effects: Sequence[Effect], observed: np.ndarray, colours: dict[int, Colour]
) -> tuple[np.ndarray, np.ndarray, dict[str, str]]:
    """Of a grid the amplitude (effects,) [scales] of each candidate that promises most on one line.

    Returns
    -------
    tuple of numpy.ndarray
        Amplitudes; what a scale of each does to the outputs there, shape (outputs, steps, effects); and which could not
        be simulated with any amplitude, and why.
    """
    library, first = lin.problem.with_effects(effects), len(lin.problem.system.parameters)
    cases, places = [], []
    for k, effect in enumerate(effects):
        low, high = effect.lower / effect.scale, effect.upper / effect.scale
        grid = FINE if moved_in_time(effect) else GRID
        for amplitude in sorted({float(np.clip(one, low, high)) for one in grid} - {0.0}):
            one = np.zeros(len(effects))
            one[k] = amplitude
            cases.append((np.concatenate([lin.z[:first], one, lin.z[first:]]), lin.around.heights))
            places.append((k, amplitude))
    outcomes = library.simulate_each(cases)
    kept, failed = [], {}
    for (k, amplitude), outputs in zip(places, outcomes, strict=True):
        if isinstance(outputs, SimulationError):
            failed[effects[k].name] = str(outputs)
        else:
            kept.append((k, amplitude, outputs - lin.outputs))
    failed = {name: why for name, why in failed.items() if name not in {effects[k].name for k, *_ in kept}}
    best, secants = np.zeros(len(effects)), np.zeros((*lin.outputs.shape, len(effects)))
    if not kept:
        return best, secants, failed
    grams = Grams(replace(lin, by_effect=np.stack([moved for *_, moved in kept], axis=-1)), observed)
    left = projected(grams.total(colours), grams.inner.size)
    amplitudes = np.array([amplitude for _, amplitude, _ in kept])
    worth = left.score - 0.5 * (np.diag(left.information) + (amplitudes / AMPLITUDE) ** 2)
    for place in np.argsort(worth, kind="stable"):
        k, amplitude, moved = kept[place]
        best[k], secants[..., k] = amplitude, moved / amplitude
    return best, secants, failed


def on_the_best_line(rivals: Rivals, base: np.ndarray, observed: np.ndarray, colours: dict[int, Colour]) -> Rivals:
    """The same refitted on one line that is drawn where the best candidate is.

    Parameters
    ----------
    rivals
        With one candidate at least.
    base
        Where the base model's own fit is, shape (unknowns,): a further start for it, besides where it was led.
    observed, colours
        As of :func:`from_one_start`.

    Raises
    ------
    SimulationError
        If the line cannot be drawn, or the base model not be simulated on it.
    """
    best = rivals.refits[0]
    shared = relinearised(best.grams, colours, best.lin.z, observed)

    def there(z: np.ndarray, effects: Sequence[Effect]) -> Refit:
        lin = linearised(shared.problem.with_effects(effects), z, shared.around, like=shared)
        return refit(Grams(lin, observed), colours, z, ())

    plain: list[Refit] = []
    for z in (rivals.base.lin.z, base):
        with suppress(*FAILURES):
            plain.append(there(z, ()))
    if not plain:
        raise SimulationError("the base model cannot be simulated where the best candidate is")
    made, failed = [], {}
    for one in rivals.refits:
        try:
            made.append(in_the_deepest_trough(there(one.lin.z, one.lin.chosen), colours))
        except FAILURES as error:
            failed[one.names[0]] = reason(error)
    made.sort(key=lambda one: -one.evidence)
    return Rivals(max(plain, key=lambda one: one.evidence), tuple(made), failed)


def in_the_deepest_trough(one: Refit, colours: dict[int, Colour]) -> Refit:
    """A refit of one effect, or one that began with another amplitude and is more plausible.

    Only effects that move an input in time are asked: steps along straight lines end in the nearest trough.
    """
    problem, place = one.lin.problem, len(one.lin.problem.system.parameters)
    if not moved_in_time(one.lin.chosen[0]):
        return one
    # the effect's own derivative belongs to where it is, and promises what it does not keep elsewhere
    others = one.lin.by_unknown.copy()
    others[..., place] = 0.0
    promised, start = misfit(one.grams, colours), None
    for amplitude in np.unique(np.clip(FINE, *(bound[place] for bound in inner(problem)))):
        z = one.lin.z.copy()
        z[place] = amplitude
        try:
            there = linearised(problem, z, one.lin.around, (), others, one.lin)
        except FAILURES:
            continue
        grams = Grams(there, one.grams.observed, one.grams)
        value = misfit(grams, colours) - step_from(there, grams, colours)[1]
        if value < promised:
            promised, start = value, z
    if start is None:
        return one
    with suppress(*FAILURES):
        begins = linearised(problem, start, one.lin.around, like=one.lin)
        other = refit(Grams(begins, one.grams.observed, one.grams), colours, start, ())
        return max(one, other, key=lambda each: each.evidence)
    return one
