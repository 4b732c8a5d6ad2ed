"""Whether the parameters are alive.

Some tools evaluate a parameter when they compile the FMU, accept new values for it without a word, and ignore them.
Such a parameter would be "estimated" from nothing, so it is refused.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from datagen.driving.inputs import build_inputs
from datagen.driving.tables import InputTable
from datagen.fmi.guard import guarded
from datagen.simulating.simulator import Simulator
from shared import watchdog
from shared.errors import SimulationError, SystemDescriptionError, ZeroshotError
from shared.logs import logger
from shared.system import System

_log = logger(__name__)

PROBE_HOURS = 96.0
PROBE_SEED = 0
SEASONS = (0.0, 182.0 * 86400.0, 4.0 * 86400.0, 179.0 * 86400.0)
"""When a look may begin [s]: what only shades or cools in summer is not ignored, nor what acts at weekends alone, in
either. Time zero is a Monday."""
LONGEST = 336.0
"""Of the last look, at a record as described [h]."""
HARDLY = 1e-3
"""Of an output's accuracy: a parameter that moves outputs by less is ignored; one that moves them by more is weak."""
PATIENCE = 600.0
"""How long a look in a process apart may take, by default [s]."""


def responses(simulator: Simulator, names: Collection[str] | None = None) -> dict[str, float | SimulationError]:
    """Largest change of any output over each parameter's range, all by default, in units of the output's accuracy.

    Simulates a few winter days from the middle of the ranges, once at each end of each parameter, and where the outputs
    do not move, summer days, weekends, and the beginning of a record as described, too. For an end that cannot be
    simulated the middle stands in; if only one of the three can be, the cause stands in place of the change, and other
    parameters are looked at all the same. Raises SystemDescriptionError, WeatherError if the inputs cannot be made.
    """
    look = _Look(simulator)
    wanted = [p.name for p in simulator.system.parameters if names is None or p.name in names]
    return {name: look.response(name) for name in wanted}


def check_live(simulator: Simulator) -> dict[str, float]:
    """Refuse parameters that do not move any output by more than its accuracy; returns :func:`responses`.

    One that cannot be judged, because the FMU fails at its values, is told, left out of the result and not refused.
    Raises SystemDescriptionError naming the dead parameters; or if the inputs cannot be made; WeatherError if a weather
    file cannot be used.
    """
    return _judged(simulator.system, responses(simulator))


def check_live_apart(system: System, timeout: float | None = None, least: float = 1.0) -> dict[str, float]:
    """:func:`check_live` in a process apart: the FMU may crash or hang at the ends of its ranges.

    Where it does, the parameters are looked at one by one, so that those at fault do not hide what others are. One look
    may take ``timeout`` [s]; if not given, :data:`PATIENCE`, and each simulation what the command allows. ``least`` is
    the change of an output, in units of its accuracy, below which a parameter is refused. Raises
    SystemDescriptionError, FmuError, WeatherError as :func:`check_live`, and if the FMU does not fit the description.
    """
    all_names = tuple(system.parameter_names)
    patience = {"timeout": PATIENCE, "limit": watchdog.limit()} if timeout is None else {"timeout": timeout}
    at_once = guarded(_probe, [(system, all_names)], **patience, tries=1)[0]
    found: dict[str, float | SimulationError] = {}
    if not isinstance(at_once, SimulationError):
        found = _found(at_once)
    elif len(all_names) == 1 or isinstance(guarded(_middle, [system], **patience, tries=1)[0], ZeroshotError):
        found = dict.fromkeys(all_names, at_once)  # the middle of the ranges is no better: one by one neither
    else:
        alone = guarded(_probe, [(system, (name,)) for name in all_names], **patience, tries=1)
        for name, one in zip(all_names, alone, strict=True):
            found |= {name: one} if isinstance(one, SimulationError) else _found(one)
    return _judged(system, found, least)


def _judged(system: System, found: Mapping[str, float | SimulationError], least: float = 1.0) -> dict[str, float]:
    """The changes that are known; tells which are not, and refuses dead parameters."""
    known: dict[str, float] = {}
    for name, change in found.items():
        if isinstance(change, SimulationError):
            _log.warning("%s: could not check that parameter %r is alive: %s", system.path, name, change)
        else:
            known[name] = change
    dead = [name for name, change in known.items() if change < least]
    ignored = [name for name in dead if known[name] < HARDLY]
    still = [repr(one.name) for one in system.inputs if one.source == "measured"]
    hint = f" (with {', '.join(still)}, which a recording would drive, held constant)" if still else ""
    if ignored:
        raise SystemDescriptionError(
            f"{system.path}: {system.fmu_path.name} accepts {', '.join(map(repr, ignored))} and ignores it: "
            f"no output moves between the ends of its range{hint}; expected parameters that are tunable at run time"
        )
    if dead:
        weak = ", ".join(f"{name!r} ({known[name]:.2g} of it)" for name in dead)
        raise SystemDescriptionError(
            f"{system.path}: between the ends of the range no output of {system.fmu_path.name} moves by its accuracy"
            f" for {weak}{hint}; expected a wider range, more outputs, or a value under [fixed]: `datagen"
            " identifiability` prints how well each parameter is identified"
        )
    return known


class _Look:
    """Simulations of a few days, from the middle of the ranges."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator, system = simulator, simulator.system
        experiment = system.experiment
        short, long = (
            experiment.step * max(1, int(min(hours, experiment.hours) * 3600.0 / experiment.step + 1e-6))
            for hours in (PROBE_HOURS, LONGEST)
        )
        self.looks = [*((start, short) for start in SEASONS), (experiment.start[0] * 3600.0, long)]
        self.middle = {p.name: float(p.from_unit(0.5)) for p in system.parameters}
        self.ends = {p.name: (p.max, p.min) for p in system.parameters}
        self.accuracy = np.array([[o.accuracy] for o in system.outputs])
        self._inputs: dict[tuple[float, float], InputTable] = {}

    def response(self, name: str) -> float | SimulationError:
        """The largest change that a parameter makes, or why it cannot be had."""
        largest = 0.0
        for start, span in self.looks:
            change = self._change(name, start, span)
            if isinstance(change, SimulationError):
                return change
            largest = max(largest, change)
            if largest >= 1.0:
                break
        return largest

    def outputs(self, start: float, span: float, values: Mapping[str, float]) -> np.ndarray:
        """Outputs from ``start`` on for ``span`` [s], with some parameters elsewhere than in the middle."""
        stop = start + span
        if (start, stop) not in self._inputs:
            self._inputs[start, stop] = build_inputs(
                self.simulator.system, root_seed=PROBE_SEED, index=0, start=start, stop=stop
            )
        parameters = {**self.middle, **values}
        return self.simulator.run(parameters, self._inputs[start, stop], start=start, stop=stop).outputs

    def _change(self, name: str, start: float, span: float) -> float | SimulationError:
        found: list[np.ndarray] = []
        cause = SimulationError("")
        for value in (*self.ends[name], self.middle[name]):
            try:
                found.append(self.outputs(start, span, {name: value}))
            except SimulationError as error:
                cause = error
            if len(found) == 2:
                return float(np.max(np.abs(found[0] - found[1]) / self.accuracy))
        return cause


def _probe(work: tuple[System, tuple[str, ...]]) -> dict[str, float | SimulationError]:
    system, names = work
    return responses(Simulator(system), names)


def _middle(system: System) -> None:
    """Raises if the middle of the ranges cannot be simulated either."""
    look = _Look(Simulator(system))
    look.outputs(*look.looks[0], {})


def _found(result: dict[str, float | SimulationError] | ZeroshotError) -> dict[str, float | SimulationError]:
    if isinstance(result, ZeroshotError):  # of the description or its FMU, not of a simulation
        raise result
    return result
