"""Helpers for the tests of the default FMU: an instance by names, an integrator with events, scenarios."""

from __future__ import annotations

import ctypes
import itertools
import math
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import (
    FMU2Model,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[2]
FMU = ROOT / "fmus" / "MixedAirCO2.fmu"


class Twin:
    """One instance of the FMU, its variables by name, its log in `messages`."""

    def __init__(self, folder: Path):
        self.description = fmpy.read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.messages: list[str] = []
        self.allocated = 0
        libc = fmpy.calloc, fmpy.free

        def allocate(count, size):
            self.allocated += 1
            return libc[0](count, size)

        def release(memory):
            self.allocated -= 1
            libc[1](memory)

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.messages.append(a[4].decode()))
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(allocate)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(release)
        self.callbacks = callbacks
        identifier = self.description.modelExchange.modelIdentifier
        self.fmu = FMU2Model(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=identifier,
            libraryPath=str(_binary(folder, identifier)),
        )
        self.fmu.instantiate(callbacks=callbacks)
        self.states = [u.variable.derivative.name for u in self.description.derivatives]
        self.n = len(self.states)
        self._buffer = (ctypes.c_double * self.n)()
        self._arrays: dict[tuple[str, ...], tuple] = {}
        self._z = (ctypes.c_double * self.description.numberOfEventIndicators)()

    def vr(self, *names: str) -> list[int]:
        return [self.variables[name].valueReference for name in names]

    def set(self, **values: float) -> None:
        """Set variables; `__` in a keyword stands for a dot."""
        self.set_all({k.replace("__", "."): v for k, v in values.items()})

    def _array(self, names: tuple[str, ...]) -> tuple:
        """Value references and a buffer for these variables, made once."""
        if names not in self._arrays:
            n = len(names)
            self._arrays[names] = (ctypes.c_uint * n)(*self.vr(*names)), n, (ctypes.c_double * n)()
        return self._arrays[names]

    def set_all(self, values: dict[str, float]) -> None:
        if "replay" in values:
            self.fmu.setBoolean([0], [values["replay"]])
            values = {name: value for name, value in values.items() if name != "replay"}
        vr, n, buffer = self._array(tuple(values))
        buffer[:] = list(values.values())
        self.fmu.fmi2SetReal(self.fmu.component, vr, n, buffer)

    def get(self, *names: str) -> np.ndarray:
        vr, n, buffer = self._array(names)
        self.fmu.fmi2GetReal(self.fmu.component, vr, n, buffer)
        return np.array(buffer)

    def start(self, values: dict[str, float] | None = None) -> Twin:
        """Initialise with these parameters and inputs, into continuous-time mode."""
        self.set_all(values or {})
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.event()
        return self

    def event(self) -> None:
        """Enter event mode, settle the modes, return to continuous time."""
        self.fmu.enterEventMode()
        info = self.fmu.newDiscreteStates()
        assert info == (False, False, False, False, False, 0.0)
        self.fmu.enterContinuousTimeMode()

    @property
    def x(self) -> np.ndarray:
        self.fmu.fmi2GetContinuousStates(self.fmu.component, self._buffer, self.n)
        return np.array(self._buffer)

    @x.setter
    def x(self, x: np.ndarray) -> None:
        self._buffer[:] = x
        self.fmu.fmi2SetContinuousStates(self.fmu.component, self._buffer, self.n)

    @property
    def dx(self) -> np.ndarray:
        self.fmu.fmi2GetDerivatives(self.fmu.component, self._buffer, self.n)
        return np.array(self._buffer)

    @property
    def z(self) -> np.ndarray:
        self.fmu.fmi2GetEventIndicators(self.fmu.component, self._z, len(self._z))
        return np.array(self._z)

    def derivative(self, unknown: str, known: str) -> float:
        """Partial derivative of one variable with respect to another."""
        return self.fmu.getDirectionalDerivative(self.vr(unknown), self.vr(known), [1.0])[0]

    def run(
        self,
        t: np.ndarray,
        inputs: Callable[[float], dict[str, float]] | None = None,
        outputs: tuple[str, ...] = (),
        integrals: tuple[str, ...] = (),
        rtol: float = 1e-8,
        hold: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Integrate over t [s] with state events.

        `inputs` is applied at every evaluation, or with `hold` at the start of each interval of t. Returns the
        outputs at t (a row each), the integrals of variables over t, and the number of state events.
        """
        m, n, events = len(integrals), self.n, 0
        atol = np.concatenate([np.array(self._nominals()) * rtol, np.full(m, 1.0)])
        rows = []
        y = np.concatenate([self.x, np.zeros(m)])
        z_at: list = [None, None, None]  # time, state, indicators: solve_ivp asks for one indicator at a time

        def apply(time: float, y: np.ndarray) -> None:
            if inputs and not hold:
                self.set_all(inputs(time))
            self.x = y[:n]

        def rhs(time: float, y: np.ndarray) -> np.ndarray:
            apply(time, y)
            return np.concatenate([self.dx, self.get(*integrals)]) if m else self.dx

        def indicator(k: int) -> Callable:
            def function(time: float, y: np.ndarray) -> float:
                if time != z_at[0] or not np.array_equal(y, z_at[1]):
                    apply(time, y)
                    z_at[:] = time, y.copy(), self.z
                return z_at[2][k]

            function.terminal = True
            return function

        indicators = [indicator(k) for k in range(len(self._z))]
        for a, b in itertools.pairwise(t):
            if inputs and hold:
                self.set_all(inputs(a))
            repeats = 0
            while True:
                apply(a, y)
                self.event()
                z_at[0] = None
                if repeats == 0:
                    rows.append(self.get(*outputs) if outputs else ())
                s = solve_ivp(rhs, (a, b), y, "LSODA", events=indicators, rtol=rtol, atol=atol, t_eval=[b])
                assert s.status >= 0, s.message
                if s.status == 0:
                    y = s.y[:, -1]
                    break
                k = next(i for i, e in enumerate(s.t_events) if len(e))
                assert s.t_events[k][0] > a, "an event repeats at once: chattering"
                a, y = s.t_events[k][0], s.y_events[k][0]
                repeats += 1
            events += repeats
        apply(t[-1], y)
        self.event()
        rows.append(self.get(*outputs) if outputs else ())
        return np.array(rows), y[n:], events

    def _nominals(self) -> list[float]:
        self.fmu.fmi2GetNominalsOfContinuousStates(self.fmu.component, self._buffer, self.n)
        return list(self._buffer)

    def free(self) -> None:
        self.fmu.freeInstance()


def _binary(folder: Path, identifier: str) -> Path:
    from fmus.toolchain import BINARIES, native_platform

    binary = BINARIES[native_platform()]
    return folder / "binaries" / binary.folder / f"{identifier}{binary.targets[0].suffix}"


def unpack(fmu: Path, folder: Path) -> Path:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def shipped() -> Path:
    """The committed FMU."""
    return FMU


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory) -> Path:
    """The committed FMU, unpacked."""
    return unpack(FMU, tmp_path_factory.mktemp("shipped"))


@pytest.fixture(scope="session")
def build_fmu(tmp_path_factory) -> Callable[[int], Path]:
    """Build the FMU natively with walls of so many nodes, by the command; returns the file."""
    pytest.importorskip("ziglang")
    built: dict[int, Path] = {}

    def build(nodes: int) -> Path:
        if nodes not in built:
            out = tmp_path_factory.mktemp("built") / f"nodes{nodes}.fmu"
            words = ["--nodes", str(nodes), "--platforms", "native", "--out", str(out)]
            subprocess.run([sys.executable, "fmus/build.py", *words], cwd=ROOT, check=True, capture_output=True)
            built[nodes] = out
        return built[nodes]

    return build


@pytest.fixture
def twin(unpacked) -> Iterator[Callable[..., Twin]]:
    """Factory of instances, freed at the end of the test."""
    twins: list[Twin] = []
    cwd = os.getcwd()

    def make(folder: Path = unpacked) -> Twin:
        twins.append(Twin(folder))
        return twins[-1]

    yield make
    for t in twins:
        t.free()
        assert t.allocated == 0, "memory of the importer's allocator is not given back"
    os.chdir(cwd)


@pytest.fixture(scope="session")
def unpack_fmu(tmp_path_factory) -> Callable[[Path], Path]:
    return lambda fmu: unpack(fmu, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture(scope="session")
def weather() -> Callable[[np.ndarray], dict[str, np.ndarray]]:
    """A synthetic year: smooth functions of the time [s]."""

    def at(t):
        day = np.asarray(t) / 86400.0
        T = 283.15 - 12.0 * np.cos(2 * np.pi * (day - 15) / 365) - 4.0 * np.cos(2 * np.pi * (day - 0.125))
        sun = 0.5 - np.cos(2 * np.pi * day)
        return {
            "TDryBul": T,
            "TSky": T - 14.0 + 3.0 * np.sin(2 * np.pi * day / 5.3),
            "winSpe": 3.0 + 2.5 * np.sin(2 * np.pi * day / 2.7),
            "HFac": 100.0 * (sun + np.sqrt(sun**2 + 0.01)) * (1.0 + 0.4 * np.sin(2 * np.pi * day / 3.1)),
            "CO2Out": 415.0 + 10.0 * np.sin(2 * np.pi * day),
            "nPer": 6.0 * (1.0 - np.cos(2 * np.pi * day)),
            "TSet": 292.65 - 1.5 * np.cos(2 * np.pi * day),
            "excHea": 300.0 * np.sin(2 * np.pi * day / 0.31),
            "excOut": 0.01 * np.sin(2 * np.pi * day / 0.22),
            "QHea_in": 2000.0 - 1500.0 * np.cos(2 * np.pi * day),
            "mOA_in": 0.1 + 0.05 * np.sin(2 * np.pi * day),
        }

    return at


@pytest.fixture(scope="session")
def winter() -> Callable[[float], dict[str, float]]:
    """A winter's day, constant within an hour, that drives limiters and clamps; to be held over intervals."""

    def at(time):
        hour = int(time // 3600) % 24
        return {
            "TDryBul": 268.0 + 4 * math.sin(hour),
            "nPer": 18.0 if 8 <= hour < 17 else 0.0,
            "TSet": 294.15 if 6 <= hour < 22 else 289.15,
            "excHea": 900.0 * math.sin(2.1 * hour),
            "excOut": 0.08 * math.sin(1.3 * hour),
        }

    return at


@pytest.fixture(scope="session")
def simulate(shipped) -> Callable[..., np.ndarray]:
    """fmpy.simulate_fmu with inputs that are constant within each interval of t [s], for which it is exact."""

    def run(t, inputs, parameters=None, outputs=("TRoo", "CO2", "QHea", "mOA"), rtol=1e-6, fmu=shipped):
        knots = np.repeat(t, 2)[1:]
        signal = np.zeros(len(knots), dtype=[("time", float)] + [(name, float) for name in inputs])
        signal["time"] = knots
        for name, values in inputs.items():
            signal[name] = np.repeat(np.broadcast_to(values, len(t)), 2)[:-1]
        cwd = os.getcwd()
        result = fmpy.simulate_fmu(
            str(fmu),
            stop_time=t[-1],
            output_interval=t[1] - t[0],
            input=signal,
            start_values=parameters or {},
            output=list(outputs),
            relative_tolerance=rtol,
            record_events=False,
        )
        os.chdir(cwd)
        return np.column_stack([result[name] for name in outputs])

    return run
