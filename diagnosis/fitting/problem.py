"""A recording as a problem of estimation: unknowns with standard normal priors, and the simulation between.

The unknowns ``z`` are the description's parameters, each by the probit of its place in its range (so that bounds hold
and the uniform prior in the parameter's scale is N(0, 1) exactly), an amplitude for each effect in units of its scale
(zero is the base model), a factor for each uncertain constant, and last the level of an unknown occupancy. Persons that
were not counted and what came before the recording are nuisances, by which the simulation is linearised: see
:mod:`diagnosis.fitting.nuisance`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from typing import Literal, TypeVar

import numpy as np

from datagen.driving.sampling import fmu_values
from datagen.simulating.constants import constants
from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Effect
from diagnosis.effects.library import outputs_of
from diagnosis.fitting.failures import FAILURES, reason
from diagnosis.fitting.inputs import crowd, drive, nuisance_of
from diagnosis.fitting.linear import Linearisation, Marginal, lasting, responses
from diagnosis.fitting.noise import NoiseModel, errors_under, undeclared
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.runs import Runs, Unknowns
from diagnosis.fitting.simulations import InProcess, Outcome, Run, Runner, Simulations
from diagnosis.recording import HOUR, Recording, check_warm_up
from diagnosis.usual import WARM_UP as WARM_UP_HOURS
from shared.errors import RecordingError, SimulationError, ZeroshotError

WARM_UP = WARM_UP_HOURS * HOUR
"""[s]"""
STEP = 0.1
"""Half-width of a difference in an unknown, in prior standard deviations."""
TOLERANCE = 1e-6
"""Of the integrator at most: differences of simulations are small."""
Made = TypeVar("Made")
Known = Literal["constants", "history"]


class Problem:
    """What is known, what is unknown, and how the one follows from the other; see the module.

    Parameters
    ----------
    noise
        A preset of the description, standard deviations (outputs,) [unit of each], or a noise model.
    occupancy
        ``unknown``, ``measured``, or None: measured where the recording has it.
    replay
        The recorded actuators replace the model's control loops; what was replayed is no evidence.
    warm_up
        The recording's first day is repeated so long before it [s]; without it the FMU's start values would count as
        known, and what they get wrong as a gap.
    known
        What is no unknown: ``constants`` that the description calls uncertain have their values, and for the
        ``history`` of the recording its first day stands in exactly.
    runner
        Where simulations run; in this process by default. All copies of a problem share its :class:`Simulations`.

    Raises
    ------
    RecordingError
        If the recording lacks an input, or has nothing to fit, or the warm-up is shorter than one of its steps.
    """

    def __init__(
        self,
        simulator: Simulator,
        recording: Recording,
        *,
        noise: str | np.ndarray | NoiseModel = "sensor",
        occupancy: str | None = None,
        replay: bool = False,
        warm_up: float = WARM_UP,
        known: Collection[Known] = (),
        runner: Runner | Simulations | None = None,
    ) -> None:
        check_warm_up(recording, warm_up)
        self.simulator, self.recording, self.replay = simulator, recording, replay
        self.system = system = simulator.system
        self.effects: tuple[Effect, ...] = ()
        self.constants = constants(system, simulator.fmu) if "constants" not in known else ()
        self.runner = runner if isinstance(runner, Simulations) else Simulations(runner or InProcess(simulator))
        self.occupancy = crowd(system, recording, occupancy)
        self.undeclared = undeclared(system, noise, recording.outputs) if isinstance(noise, str) else {}
        if isinstance(noise, str):
            noise = errors_under(system, noise)
        self.noise = noise if isinstance(noise, NoiseModel) else NoiseModel.white_only(noise)
        self.floor = self.noise.white
        meters = dict(zip(system.output_names, self.floor.tolist(), strict=True))
        self.drive = drive(system, recording, warm_up=warm_up, replay=replay, noise=meters, occupancy=self.occupancy)
        self.nuisance, stand_ins = nuisance_of(system, recording, self.drive, occupancy=self.occupancy)
        if "history" in known:
            self.nuisance = self.nuisance.only(self.nuisance.recorded)
        tolerance = min(TOLERANCE, system.experiment.tolerance)
        starts = {name: float(simulator.fmu.variables[name].start) for one in system.given for name in one.parameters}
        facts = fmu_values(system, recording.given, starts)
        self._runs = Runs(self.drive, stand_ins, recording, facts, replay=replay, tolerance=tolerance)
        self.observed = np.isfinite(recording.outputs)
        for name in self.drive.replayed:
            if name in system.output_names:
                self.observed[system.output_names.index(name)] = False
        if not self.observed.any():
            raise RecordingError(f"{recording.path}: no output was measured that is not replayed; nothing to fit")
        self.measured = recording.outputs

    @property
    def unknown(self) -> Unknowns:
        """The unknowns and the values that they stand for."""
        return Unknowns(self.system, self.effects, self.constants, self.nuisance.levels)

    @property
    def simulations(self) -> int:
        """How many simulations all copies of this problem have asked for so far."""
        return self.runner.asked

    @property
    def names(self) -> list[str]:
        """Names of the unknowns: parameters, effects, uncertain constants, levels of the nuisance."""
        return self.unknown.names

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.unknown.size

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the unknowns, each (unknowns,)."""
        return self.unknown.bounds

    def values(self, z: np.ndarray) -> np.ndarray:
        """Parameters, amplitudes, factors of constants, and levels, shape (..., unknowns) [unit of each]."""
        return self.unknown.values(z)

    def unknowns(self, values: Mapping[str, float]) -> np.ndarray:
        """The unknowns of given values by name; zero (middle of the prior, no effect) for others, shape (unknowns,)."""
        return self.unknown.of(values)

    @property
    def time(self) -> np.ndarray:
        """Ends of the steps, shape (steps,) [s]."""
        return self.recording.time

    def with_effects(self, effects: Sequence[Effect]) -> Problem:
        """The same problem with other effects."""
        return self._copy(effects=tuple(effects))

    def with_measured(self, outputs: np.ndarray) -> Problem:
        """The same problem with other measurements (outputs, steps) [unit of each]: for twins."""
        return self._copy(measured=outputs, observed=self.observed & np.isfinite(outputs))

    def with_observed(self, observed: np.ndarray) -> Problem:
        """The same problem where only some readings count, shape (outputs, steps): for held-out parts."""
        return self._copy(observed=self.observed & observed)

    def with_noise(self, noise: NoiseModel) -> Problem:
        """The same problem with another noise."""
        return self._copy(noise=noise)

    def with_nuisance(self, nuisance: Nuisance) -> Problem:
        """The same problem with another nuisance."""
        return self._copy(nuisance=nuisance)

    def simulate(self, z: np.ndarray, heights: np.ndarray | None = None) -> np.ndarray:
        """Outputs (outputs, steps) [unit of each]; nuisance heights (pulses,) are their prior means if not given.

        Raises
        ------
        SimulationError
            If the simulation did not reach its end.
        """
        return self.simulate_all([(z, self.nuisance.mean if heights is None else heights)])[0]

    def simulate_all(self, cases: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
        """Outputs of several cases (z, nuisance heights), side by side where the runner can.

        Raises
        ------
        SimulationError
            If one did not reach its end.
        """
        made = []
        for outcome in self.simulate_each(cases):
            if isinstance(outcome, SimulationError):
                raise outcome
            made.append(outcome)
        return made

    def simulate_each(self, cases: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Outcome]:
        """As :meth:`simulate_all`, with an error in the place of each that failed or is nothing a sensor could show."""
        unknown = self.unknown

        def asked(z: np.ndarray, heights: np.ndarray) -> Run | SimulationError:
            return _tried(lambda: self._runs.run(unknown, self.nuisance, np.asarray(z, dtype=float), heights))

        def shown(z: np.ndarray, outcome: Outcome) -> Outcome:
            return outcome if isinstance(outcome, SimulationError) else _tried(lambda: self._shown(z, outcome))

        runs = [asked(z, heights) for z, heights in cases]
        rest = iter(self.runner.map([one for one in runs if isinstance(one, Run)]))
        made = [next(rest) if isinstance(one, Run) else one for one in runs]
        return [shown(z, one) for (z, _), one in zip(cases, made, strict=True)]

    def _shown(self, z: np.ndarray, outputs: np.ndarray) -> np.ndarray:
        """What the sensors show of outputs (outputs, steps) [unit of each].

        Raises
        ------
        SimulationError
            If that is no number, or so large that beside it a reading's noise has no digit left.
        """
        for effect, amplitude in zip(self.effects, self.unknown.amplitudes(z), strict=True):
            outputs = outputs_of(effect, amplitude, outputs, self.time)
        most = np.where(self.floor > 0, self.floor / np.finfo(float).eps, np.inf)[:, None]
        wrong = np.argwhere(~(np.abs(outputs) < most))  # a comparison with NaN is false
        if len(wrong):
            k, step = wrong[0]
            raise SimulationError(
                f"{self.system.output_names[k]!r} is {outputs[k, step]:.3g} at t = {self.time[step]:g} s; expected"
                f" numbers below {most[k, 0]:.1g}"
            )
        return outputs

    def residuals(self, z: np.ndarray, around: Linearisation | None = None) -> np.ndarray:
        """Measured minus simulated, standardised, a row for each observed reading.

        With a linearisation, its nuisance is integrated out: the residual is taken at the nuisance's prior mean and its
        covariance made the identity.
        """
        if around is None:
            return self.standardised(self.measured - self.simulate(z))
        outputs = self.simulate(z, around.heights) + around.response @ (self.nuisance.mean - around.heights)
        return around.marginal.root(self.standardised(self.measured - outputs))

    def linearise(self, z: np.ndarray, nuisance: np.ndarray | None = None) -> Linearisation:
        """Linearise by the nuisance around ``z`` and a nuisance (standard normal; prior mean by default)."""
        z = np.asarray(z, dtype=float)
        nuisance = np.zeros(self.nuisance.factor.shape[1]) if nuisance is None else nuisance
        heights = self.nuisance.heights(nuisance)
        base = self.simulate(z, heights)

        def simulate(pulses: list[np.ndarray]) -> list[np.ndarray]:
            return self.simulate_all([(z, heights + one) for one in pulses])

        felt = lasting(self.nuisance, simulate, base, self.time, self.observed, self.floor)
        response = responses(self.nuisance.shortened(felt), simulate, base, self.time)
        return Linearisation(z, nuisance, heights, base, response, self.marginal(response), felt)

    def marginal(self, response: np.ndarray) -> Marginal:
        """What integrates the nuisance out, for a response (outputs, steps, pulses)."""
        nuisance = self.nuisance
        return Marginal(lambda: self.standardised(nuisance.by_unknown(response, self.observed.any(axis=1))))

    def likely_nuisance(self, z: np.ndarray, around: Linearisation) -> np.ndarray:
        """Posterior mean of the nuisance given ``z``, standard normal before, shape (nuisance unknowns,)."""
        outputs = self.simulate(z, around.heights) + around.response @ (self.nuisance.mean - around.heights)
        return around.marginal.unknowns(self.standardised(self.measured - outputs))

    def standardised(self, values: np.ndarray) -> np.ndarray:
        """Whitened rows of observed readings of (outputs, steps[, n]) [unit of each], shape (readings[, n])."""
        return self.noise.whiten(values, self.observed, self.time)

    def _copy(self, **changed: object) -> Problem:
        other = copy(self)
        vars(other).update(changed)
        return other


def _tried(make: Callable[[], Made]) -> Made | SimulationError:
    """What is made, or why it cannot be: an effect of a package's own may fail at some amplitudes."""
    try:
        return make()
    except SimulationError as error:
        return error
    except (ZeroshotError, *FAILURES) as error:
        return SimulationError(reason(error))
