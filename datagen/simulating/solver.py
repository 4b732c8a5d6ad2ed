"""CVODE, as fmpy ships it, set up for the compiled callbacks."""

from __future__ import annotations

import ctypes
import os
import tempfile
import threading
from ctypes import byref
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.sundials import cvode as cv
from fmpy.sundials import nvector_serial as nv
from fmpy.sundials import sundials_context as ctx
from fmpy.sundials import sundials_types as st
from fmpy.sundials.libraries import (
    sundials_core,
    sundials_cvode,
    sundials_nvecserial,
)

from datagen.fmi import calls
from datagen.simulating import native, newton
from shared import watchdog
from shared.errors import SimulationError
from shared.logs import logger

_log = logger(__name__)
_ADDRESSES = {
    calls.CVODE: cv.CVode,
    calls.CV_REINIT: cv.CVodeReInit,
    calls.CV_SYSTEM: sundials_cvode.CVodeGetNonlinearSystemData,
    calls.CV_SET_STOP: sundials_cvode.CVodeSetStopTime,
    calls.VECTOR_DATA: sundials_nvecserial.N_VGetArrayPointer_Serial,
}
MAX_STEPS = 100_000
"""Steps allowed between two stops; a solver that needs more has lost its way."""


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Where CVODE's warnings are written, which knows no other place than a file; it goes with the process."""
    made = tempfile.TemporaryDirectory(prefix="zeroshot-cvode-")
    watchdog.clean_at_end(made.cleanup)
    return made


def plain(pointer: Any) -> int:
    """A ctypes pointer or function as an address."""
    return ctypes.cast(pointer, ctypes.c_void_p).value or 0


def _ok(code: int) -> None:
    if code < 0:
        raise SimulationError(f"CVODE refused its set-up (code {code})")


class Cvode:
    """CVODE's memory for one simulation: BDF, with the Newton iteration of :mod:`datagen.simulating.newton`.

    ``state`` is the state vector as an array that shares CVODE's memory; in the ``plan`` of :mod:`datagen.fmi.calls`
    its places are filled. ``initial`` are states and quadratures at the ``start`` [s], ``relative`` and ``absolute``
    the tolerances, the latter of each of them, and ``longest`` is the longest step [s], where the error test might let
    everything pass.
    """

    def __init__(
        self,
        plan: np.ndarray,
        start: float,
        initial: np.ndarray,
        relative: float,
        absolute: np.ndarray,
        longest: float,
    ) -> None:
        size = max(len(initial), 1)
        self._context = st.SUNContext()
        _ok(ctx.SUNContext_Create(st.SUN_COMM_NULL, byref(self._context)))
        sundials_core.SUNContext_ClearErrHandlers(
            ctypes.c_void_p(plain(self._context))
        )  # outcomes are reported, not printed
        log = ctypes.c_void_p()
        _ok(sundials_core.SUNContext_GetLogger(ctypes.c_void_p(plain(self._context)), byref(log)))
        self._warnings = Path(_folder().name, f"{os.getpid()}-{threading.get_ident()}")
        sundials_core.SUNLogger_SetWarningFilename(log, os.fsencode(self._warnings))
        self._y = nv.N_VNew_Serial(size, self._context)
        self.state = np.ctypeslib.as_array(nv.NV_DATA_S(self._y), (size,))
        self.state[:] = 0.0
        self.state[: len(initial)] = initial
        self._tolerances = np.concatenate([[relative], absolute if len(initial) else [1.0]])
        plan[calls.TOLERANCES] = self._tolerances.ctypes.data
        self._memory = cv.CVodeCreate(cv.CV_BDF, self._context)
        self._rhs = cv.CVRhsFn(native.right_hand_side.address)
        self._root = cv.CVRootFn(native.event_indicators.address)
        _ok(cv.CVodeInit(self._memory, self._rhs, start, self._y))
        weights = ctypes.c_void_p(native.error_weights.address)
        _ok(sundials_cvode.CVodeWFtolerances(ctypes.c_void_p(self._memory), weights))
        if plan[calls.N_INDICATORS]:
            _ok(cv.CVodeRootInit(self._memory, int(plan[calls.N_INDICATORS]), self._root))
        self._solver = self._newton(plan, size)
        _ok(sundials_cvode.CVodeSetNonlinearSolver(ctypes.c_void_p(self._memory), ctypes.c_void_p(self._solver)))
        _ok(cv.CVodeSetMaxNumSteps(self._memory, MAX_STEPS))
        _ok(sundials_cvode.CVodeSetMaxStep(ctypes.c_void_p(self._memory), ctypes.c_double(longest)))
        _ok(cv.CVodeSetNoInactiveRootWarn(self._memory))
        _ok(sundials_cvode.CVodeSetUserData(ctypes.c_void_p(self._memory), ctypes.c_void_p(plan.ctypes.data)))
        for place, function in _ADDRESSES.items():
            plan[place] = plain(function)
        plan[calls.CV_MEMORY] = self._memory
        plan[calls.STATE_VECTOR] = plain(self._y)

    def _newton(self, plan: np.ndarray, size: int) -> int:
        """A SUNNonlinearSolver around :mod:`datagen.simulating.newton`; its content is the plan."""
        lengths = newton.sizes(int(plan[calls.N_STATES]), size)
        self._arrays = {place: np.zeros(length, dtype=np.int64) for place, length in lengths.items()}
        for place, array in self._arrays.items():
            plan[place] = array.ctypes.data
        make = sundials_core.SUNNonlinSolNewEmpty
        make.restype = ctypes.c_void_p
        solver: int = make(ctypes.c_void_p(plain(self._context)))
        content_and_operations = (ctypes.c_void_p * 2).from_address(solver)
        content_and_operations[0] = plan.ctypes.data
        operations = (ctypes.c_void_p * 6).from_address(content_and_operations[1] or 0)
        for place, function in ((0, newton.kind), (3, newton.solve), (5, newton.set_function)):
            operations[place] = function.address
        return solver

    def close(self) -> None:
        """Give the memory back."""
        memory = ctypes.c_void_p(self._memory)
        cv.CVodeFree(byref(memory))
        sundials_core.SUNNonlinSolFreeEmpty(ctypes.c_void_p(self._solver))
        nv.N_VDestroy_Serial(self._y)
        sundials_core.SUNContext_Free(byref(self._context))
        if self._warnings.exists() and self._warnings.stat().st_size:
            first, *more = self._warnings.read_text(errors="replace").splitlines()
            _log.debug("CVODE: %s (and %d more such lines)", first.rpartition("] ")[2], len(more))
