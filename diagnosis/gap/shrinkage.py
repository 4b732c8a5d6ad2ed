"""How far the gap shrinks: fitted on one part of the recording, scored on another, channel by channel.

The gap of a channel is the mean square of its residual beyond what noise alone leaves; the share that the effect
removes is held against placebos: random smooth signatures of the same size and freedom, which mean nothing.
Intervals are those of a moving-block bootstrap (Kuensch 1989) of whole days, or of shorter blocks where few days are
scored: then they say how the share varied within those days, and not what other days would show.

Which part of a recording is fitted, and which is kept to score on: chosen from the inputs alone.

Days are joined to blocks. A quarter of the blocks is kept: those with the most and the least of what varies most from
block to block (the first principal component of the blocks' input means), so that the score is one under other
conditions than the fit's. Outputs take no part in this. The first block is always fitted: it is where what came before
the recording is told.

Base model and chosen effects fitted anew to a part of the recording: the other part says how far the gap shrinks.

Whether there is a gap, and which effect it is, is told by all readings: a week has none to spare. How far it shrinks
is told by readings that took no part in the fit. Whether they mattered to the choice is looked at, too: the candidates
that were refitted are weighed once more by the fitted readings alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import lsq_linear

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import factor
from diagnosis.fitting.grams import AMPLITUDE, Colour, Colours, Grams
from diagnosis.fitting.lines import Linearised
from diagnosis.fitting.refit import Refit, misfit, relinearised, settled
from diagnosis.gap.evidence import Search
from diagnosis.gap.schema import FEWEST, ShrinkageOf
from diagnosis.gap.stages import Stage
from diagnosis.gap.twins import draw_errors
from diagnosis.recording import DAY, HOUR, Recording

PARTS = 8
SHARE = 0.25
"""Share of the blocks that is kept."""


def kept_for_scoring(recording: Recording) -> np.ndarray:
    """Steps that are scored on, shape (steps,); the others are fitted.

    A recording of less than four days keeps its last quarter.
    """
    days = (recording.stop - recording.start) / DAY
    if days < 4:
        return np.asarray(recording.time > recording.start + 0.75 * (recording.stop - recording.start))
    whole = int(days + 1e-9)
    length = int(np.ceil(whole / min(PARTS, whole)))
    count = -(-whole // length)
    # what is more than whole days belongs to the last block: hours alone would be the farthest out of all
    block = np.minimum((recording.time - recording.start - 1e-6) // (length * DAY), count - 1).astype(int)
    found = np.unique(block)
    means = np.array([[values[block == b].mean() for values in recording.inputs.values()] for b in found])
    spread = means.std(axis=0)
    moved = spread > 1e-9 * np.maximum(np.abs(means).max(axis=0, initial=0.0), 1e-300)
    if not moved.any():
        order = np.arange(len(found))
    else:
        apart = (means[:, moved] - means[:, moved].mean(axis=0)) / spread[moved]
        component = np.linalg.svd(apart, full_matrices=False)[0][:, 0]
        # the sign of a component is the processor's choice; where one block is kept, it is the one farthest out
        component *= np.sign(component[np.abs(component).argmax()])
        order = np.argsort(component, kind="stable")
    order = order[order > 0]  # the first block tells what came before the recording
    keep = max(round(SHARE * len(found)), 1)
    ends = [*order[: keep // 2], *order[len(order) - (keep - keep // 2) :]]
    return np.isin(block, found[ends])


LINES = 5
"""The line is drawn so often at most where all readings say that the nuisance was."""
WORTH = 1.0
"""One that makes the misfit less by no more than this is the last."""


@dataclass(frozen=True)
class Apart:
    """Fits to a part: ``before`` without effects, ``after`` with those chosen; ``fitted`` (outputs, steps) of both.

    Both are linearised where all readings say that the nuisance was, at unknowns that have their optimum on ``lines``,
    which are drawn where the fitted readings say that it was. ``agreed``: whether the fitted readings alone put the
    same effects first.
    """

    before: Linearised
    after: Linearised
    lines: tuple[Linearised, Linearised]
    fitted: np.ndarray
    agreed: bool


def fitted_apart(found: Search, fitted: np.ndarray) -> Apart:
    """Fit base model and chosen effects to a part.

    Parameters
    ----------
    found
        A search that chose effects.
    fitted
        Readings that are fitted, shape (outputs, steps). They alone move the unknowns. Who was there at any other time
        is told by all readings, and so is the colour of the noise, as the search has it.

    Raises
    ------
    SimulationError
        If the simulation fails where the fit to all readings is.
    """
    made, known = [], found.made.apart
    for until in (found.stages[:1], found.stages):
        stage = until[-1]
        key = (replace(found, stages=until).path, fitted.tobytes())
        if key not in known:
            known[key] = _fitted(stage, stage.lin, fitted)
        made.append(known[key])
    (before, first), (after, last) = made
    return Apart(before, after, (first, last), fitted, _agreed(found, fitted))


def _fitted(stage: Stage, begin: Linearised, fitted: np.ndarray) -> tuple[Linearised, Linearised]:
    """A fit to a part from some place, where all readings say that the nuisance was, and its own line."""
    one = settled(begin, fitted, stage.colours.best)
    return _lined(one, stage.colours.best, stage.grams.observed), one.lin


def _lined(one: Refit, colours: dict[int, Colour], every: np.ndarray) -> Linearised:
    """A fit linearised where all readings say that the nuisance was.

    Who was there on a day that took no part in the fit is far from where its line was drawn, and one step along it can
    end where the model is nothing like the recording: a gap of kelvins that the effect then "removes". So the line is
    drawn anew until it no longer fits all readings better.
    """
    lin, value = one.lin, np.inf
    for _ in range(LINES):
        try:
            there = relinearised(Grams(lin, every), colours, one.lin.z, every)
        except FAILURES:  # what is likely on the straight line may be nothing that can be run
            break
        before, now = value, misfit(Grams(there, every), colours)
        if now < before:
            lin, value = there, now
        if before - now < WORTH:
            break
    return lin


def _agreed(found: Search, fitted: np.ndarray) -> bool:
    """Whether the fitted readings put first what all readings do, among what was refitted for each of the effects."""
    for stage, refits in zip(found.stages, found.refits, strict=False):
        like = Grams(stage.lin, fitted)
        part = [replace(one, grams=Grams(one.lin, fitted, like)) for one in refits]
        if np.argmax([one.evidence_with(stage.colours.best) for one in part]) != 0:
            return False
    return True


DRAWS = 1000
PLACEBOS = 12
MEMORY = 12 * HOUR
"""Of a placebo's signature [s]."""
FLOOR_DRAWS = 100
BLOCKS = 8
"""Blocks of the bootstrap at least."""
TORN = 1.5
"""A block's readings may be spread over so much more time than their number says: beyond, a fitted day lies between."""
CLEAR = 3.0
"""A gap is a gap from so many standard errors of the noise's own mean square on."""


def shrinkages(
    apart: Apart, first: Stage, colours: Colours, scored: np.ndarray, observed: np.ndarray, *, seed: int = 0
) -> list[ShrinkageOf]:
    """Shares of the gap that the chosen effects remove, of all channels that count; none where no reading is scored.

    Parameters
    ----------
    apart
        Fits to the other part.
    first
        The stage without effects, of all readings: how large the chosen effects' signatures are.
    colours
        Of the noise.
    scored
        Steps that took no part in fitting, shape (steps,).
    observed
        All readings that count, fitted or scored, shape (outputs, steps).
    """
    rng = np.random.default_rng(seed)
    before, after = left_by(apart.before, colours, observed), left_by(apart.after, colours, observed)
    floors, errors = _floor(apart.before, colours, observed & scored, observed, rng)
    shifted = _placebos(apart, first, colours, observed, rng)
    system, found = apart.before.problem.system, []
    for k, output in enumerate(system.outputs):
        rows = observed[k] & scored
        if not observed[k].any():
            continue
        channel = {"channel": output.name, "label": output.long_name or "", "unit": output.unit}
        if not rows.any():  # what it would show is not known, which is no sign that it shows nothing
            found.append(ShrinkageOf(**channel, readings=0))
            continue
        old, new = before[k] ** 2, after[k] ** 2
        gap = float(old[rows].mean() - floors[k])
        some = rows.sum() >= FEWEST and gap > CLEAR * errors[k]
        step = apart.before.problem.recording.step
        shares = _bootstrap(old, new, rows, (floors[k], CLEAR * errors[k]), step, rng) if some else None
        placebo = [float((old - one[k] ** 2)[rows].mean() / gap) for one in shifted] if some else []
        found.append(
            ShrinkageOf(
                **channel,
                readings=int(rows.sum()),
                before=float(np.sqrt(old[rows].mean())),
                after=float(np.sqrt(new[rows].mean())),
                floor=float(np.sqrt(floors[k])),
                share=float((old - new)[rows].mean() / gap) if some else None,
                low=float(np.quantile(shares, 0.05)) if shares is not None else None,
                high=float(np.quantile(shares, 0.95)) if shares is not None else None,
                placebo=float(np.mean(placebo)) if placebo else None,
                placebo_best=float(np.max(placebo)) if placebo else None,
            )
        )
    return found if any(one.readings for one in found) else []


def _bare(lin: Linearised, observed: np.ndarray) -> Grams:
    """Nuisance alone: the unknowns are what the fit made them."""
    empty = np.zeros((*lin.residual.shape, 0))
    return Grams(replace(lin, by_unknown=empty, by_effect=empty, z=np.zeros(0)), observed)


def left_by(lin: Linearised, colours: Colours, observed: np.ndarray) -> np.ndarray:
    """Residual with the most likely nuisance over the whole recording, shape (outputs, steps) [unit of each]."""
    grams = _bare(lin, observed)
    left = grams.without_nuisance(colours.best)
    product = grams.total(colours.best)
    return np.asarray(lin.residual - lin.by_nuisance @ cho_solve((left.root, True), product.score))


def _floor(
    lin: Linearised, colours: Colours, scored: np.ndarray, observed: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Mean square that noise leaves on scored readings, and its standard deviation, both (outputs,)."""
    grams = _bare(lin, observed)
    left = grams.without_nuisance(colours.best)
    series = lin.by_nuisance @ rng.standard_normal((grams.n_nuisance, FLOOR_DRAWS))
    scores = np.zeros((grams.n_nuisance, FLOOR_DRAWS))
    for k in grams.channels:
        series[k] += draw_errors(colours.weights[k], lin.problem.time, FLOOR_DRAWS, rng)
        scores += grams.whitened_columns(k, colours.best[k]).T @ grams.whitened(k, colours.best[k], series[k])
    rest = series - lin.by_nuisance @ left.inner(scores)
    mean, sd = np.zeros(len(series)), np.zeros(len(series))
    for k, rows in enumerate(scored):
        if rows.any():
            squares = (rest[k, rows] ** 2).mean(axis=0)
            mean[k], sd[k] = squares.mean(), squares.std()
    return mean, sd


def _placebos(
    apart: Apart, first: Stage, colours: Colours, observed: np.ndarray, rng: np.random.Generator
) -> list[np.ndarray]:
    """Residuals (outputs, steps) with random signatures of the chosen effects' size, fitted where the effects were.

    Their amplitudes are as free: the prior is that of a fitted amplitude. All else is fitted as it was without them, on
    the same line with the same colours and bounds, so that signatures of no size leave what the base model does.
    """
    lin, line = apart.before, apart.lines[0]
    places = [k for k, one in enumerate(first.lin.effects) if one in apart.after.chosen]
    if not places:
        return []
    sizes = np.sqrt(np.mean(first.lin.by_effect[..., places] ** 2, axis=1))
    like, made = Grams(line, apart.fitted), []
    low, high = (
        np.concatenate([bound / like.spread, np.full(len(places), end)])
        for bound, end in zip(line.problem.bounds, (-np.inf, np.inf), strict=True)
    )
    for _ in range(PLACEBOS):
        drawn = np.empty((*lin.residual.shape, len(places)))
        for k, j in np.ndindex(*sizes.shape):
            colour = (0.0, AMPLITUDE * float(sizes[k, j]), MEMORY)
            drawn[k, :, j] = draw_errors([(colour, 1.0)], lin.problem.time, 1, rng)[:, 0]
        grams = Grams(replace(line, by_effect=drawn), apart.fitted, like)
        left = grams.without_nuisance(first.colours.best)
        root = factor(left.information)
        x = lsq_linear(root.T, solve_triangular(root, left.score, lower=True), (low, high)).x
        way = x[: grams.n_unknown] * grams.spread - line.z
        moved = lin.by_unknown @ way + drawn @ x[grams.n_unknown :]
        made.append(left_by(replace(lin, residual=lin.residual - moved), colours, observed))
    return made


def _bootstrap(
    old: np.ndarray,
    new: np.ndarray,
    rows: np.ndarray,
    floor: tuple[float, float],
    step: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Shares over resampled days or parts of them, shape (draws,); ``floor``: mean square of noise, and the least gap.

    Days without a gap can be drawn alone: what is removed is then held against the least that counts as a gap.
    """
    places = np.flatnonzero(rows)
    length = max(min(round(DAY / step), len(places) // BLOCKS), 1)
    count = -(-len(places) // length)
    first = np.arange(len(places) - length + 1)
    whole = places[first + length - 1] - places[first] < max(TORN * length, 1)
    starts = rng.choice(first[whole] if whole.any() else first, (DRAWS, count))
    drawn = places[(starts[..., None] + np.arange(length)).reshape(DRAWS, -1)[:, : len(places)]]
    a, b = old[drawn].mean(axis=1), new[drawn].mean(axis=1)
    return np.asarray((a - b) / np.maximum(a - floor[0], floor[1]))
