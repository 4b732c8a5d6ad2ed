"""The base model's fit, and where it begins: an estimator's zero-shot estimate, and the middle of the prior.

From the middle of the prior a fit may end beside the optimum where the controllers are simulated, and what is left
looks like a gap. But an estimate knows no gap, and a recording that has one may fit better from elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis.fitting.failures import FAILURES, reason
from diagnosis.fitting.grams import Colour, estimated_colours
from diagnosis.fitting.lines import Linearised
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import Refit, base_from, line_at, misfit
from diagnosis.recording import HOUR, Recording
from diagnosis.zero_shot import estimate
from shared.errors import EstimatorError, RecordingError, SimulationError, TimeUp
from shared.logs import logger
from shared.shipped import estimator_beside
from shared.system import System

_log = logger(__name__)
QUIET = 1.25
"""Mean square of the standardised residual up to which a fit has nothing to gain from another start."""
PRIOR = "prior"


@dataclass(frozen=True)
class Begun:
    """The base model's ``fit``, where it began (``name``), and the ``line`` on which candidates begin."""

    fit: Refit
    name: str
    line: Linearised

    @property
    def colours(self) -> dict[int, Colour]:
        """How slow the errors of the sensors are that the fit leaves, by output."""
        return estimated_colours(self.fit.grams, self.fit.lin.problem.floor).best

    @property
    def evidence(self) -> float:
        """Log evidence of the fit, with the errors that it leaves."""
        return self.fit.evidence_with(self.colours)

    @property
    def quiet(self) -> bool:
        """Whether the fit leaves little more than the sensors' noise."""
        grams, floor = self.fit.grams, self.fit.lin.problem.floor
        white = {k: (float(floor[k]), 0.0, HOUR) for k in grams.channels}
        return bool(2 * misfit(grams, white) < QUIET * grams.observed.sum())


@dataclass(frozen=True)
class ZeroShot:
    """An estimator's estimate: values by name [unit of the description], and the estimator's folder."""

    values: dict[str, float]
    folder: str


def zero_shot(system: System, recording: Recording, run: Path | str | None) -> ZeroShot | None:
    """What an estimator says of a recording; None where there is no estimator that can read it.

    Parameters
    ----------
    run
        Folder of an estimator; without, the one beside the system description.

    Raises
    ------
    EstimatorError, RecordingError
        If the estimator that was given cannot read the recording.
    """
    folder = run if run is not None else estimator_beside(system.path)
    if folder is None:
        return None
    try:
        return ZeroShot(estimate(folder, recording, system), str(folder))
    except (EstimatorError, RecordingError) as error:
        if run is not None:
            raise
        _log.info("without a zero-shot estimate: %s", error)
        return None


def usual_starts(problem: Problem, estimated: ZeroShot | None) -> list[tuple[str, np.ndarray]]:
    """An estimator's estimate, where there is one, and the middle of the prior: names and unknowns (unknowns,)."""
    first = [(estimated.folder, problem.unknowns(estimated.values))] if estimated is not None else []
    return [*first, (PRIOR, np.zeros(problem.size))]


def begun(problem: Problem, starts: Sequence[tuple[str, np.ndarray]], *, wide: bool = True) -> Begun:
    """The most plausible fit of the base model from several starts; the first that leaves little more than noise.

    Where the time is up after one of them, that is it.

    Parameters
    ----------
    problem
        Before any fit, without effects.
    starts
        What each is called, and its unknowns (unknowns,).
    wide
        Whether nuisances have the tails that a test needs.

    Raises
    ------
    SimulationError
        If simulation or algebra fail at every start.
    TimeUp
        If the time was up before there was a fit.
    """
    best: Begun | None = None
    why: dict[str, str] = {}
    for name, start in starts:
        try:
            one, line = base_from(line_at(problem, start, wide=wide), problem.observed)
            found = Begun(one, name, line)
        except FAILURES as error:
            why[name] = reason(error)
            continue
        except TimeUp:
            if best is None:
                raise
            break
        if best is None or found.evidence > best.evidence:
            best = found
        if best.quiet:
            break
    if best is None:
        said = "; ".join(f"from {name}: {one}" for name, one in why.items())
        raise SimulationError(
            f"{problem.recording.path}: the base model cannot be fitted to it ({said}); expected a start at which it"
            " can be simulated. `diagnosis residuals` with --set tells which parameters can"
        )
    return best
