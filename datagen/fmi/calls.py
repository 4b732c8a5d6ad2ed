"""Calls of an FMU's C functions from compiled code, and all that differs between FMI 2.0 and FMI 3.0 in them.

The compiled code gets one array of integers, the plan: addresses of functions and arrays, and sizes. The constants
below are its places. Discrete inputs come last among the inputs: they are set in event mode only, as both standards
demand of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, types
from numba.extending import intrinsic

from datagen.fmi.compilation import njit
from datagen.fmi.foreign import foreign

# places in the plan
COMPONENT, SET_TIME, SET_REAL, GET_REAL, SET_STATES, GET_STATES = 0, 1, 2, 3, 4, 5
GET_DERIVATIVES, GET_INDICATORS, ENTER_EVENT, NEW_DISCRETE, ENTER_CONTINUOUS, STEP_DONE = 6, 7, 8, 9, 10, 11
N_STATES, N_MEANS, N_INPUTS, N_POINTS, N_KNOTS, N_INDICATORS = 12, 13, 14, 15, 16, 17
VR_INPUTS, VR_POINTS, VR_MEANS, INPUTS = 18, 19, 20, 21
KNOT_TIME, KNOT_LEFT, KNOT_RIGHT = 22, 23, 24
SEGMENT, FIRST, LAST = 25, 26, 27  # segment of the last look-up; segments allowed until the next jump
VECTOR_DATA, CVODE, CV_REINIT, CV_SET_STOP, CV_MEMORY, STATE_VECTOR = 28, 29, 30, 31, 32, 33
STATUS, FAILED_CALL, RHS_CALLS, INDICATOR_CALLS, EVENTS = 34, 35, 36, 37, 38
FMI, N_CONTINUOUS, EXPIRED, DO_STEP, SET_SLOPES, STEPS = 39, 40, 41, 42, 43, 44  # EXPIRED: set by the watchdog
CV_SYSTEM, SYSTEM, NEWTON_REALS, NEWTON_COUNTS = 45, 46, 47, 48  # what newton.py remembers, by address
JACOBIAN, MATRIX, FACTORS, PATTERN, STRUCTURE, RESIDUAL = 49, 50, 51, 52, 53, 54
TOLERANCES, EACH_STEP = 55, 56  # EACH_STEP: the FMU wants to be told of every step that is completed
PLAN_SIZE = 57

# outcomes of a simulation; negative values are CVODE's own
DONE, FMU_FAILED, TERMINATED, ENDLESS_EVENT, NOT_FINITE, CUT_SHORT, TIMED_OUT = 0, 1, 2, 3, 4, 5, 6
MAX_EVENT_ITERATIONS = 100

NEEDED, TERMINATE, STATES_CHANGED = 0, 1, 3  # flags of an event iteration, see new_discrete

_c_pd = foreign("i:pd")
_c_pp = foreign("i:pp")
_c_pppp = foreign("i:pppp")
_c_ppppp = foreign("i:ppppp")
_c_ppppppp = foreign("i:ppppppp")
_c_pipp = foreign("i:pipp")
_c_pddi = foreign("i:pddi")
_c_pddipppp = foreign("i:pddipppp")


def _pointer_to(kind: Any) -> Any:
    """A numba function that makes an address a pointer to numbers of a kind, as ``carray`` takes it."""
    pointer = types.CPointer(kind)

    def codegen(context: Any, builder: Any, called: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(pointer))

    def convert(typingctx: Any, address: Any) -> Any:
        return pointer(types.int64), codegen

    return intrinsic(convert)


doubles = _pointer_to(types.float64)
integers = _pointer_to(types.int64)
unsigned = _pointer_to(types.uint64)
"""Unsigned numbers index an array at once; a signed one is asked whether it counts from the end."""


@njit
def check(plan: Any, status: int, function: int) -> bool:
    """Remember a failed call of the FMU; OK is 0, Warning 1 in both versions."""
    if status > 1:
        plan[STATUS] = status
        plan[FAILED_CALL] = function
        return False
    return True


@njit
def set_floats(plan: Any, references: int, count: int, address: int) -> bool:
    """Set ``count`` variables to the doubles at an address."""
    if count == 0:
        return True
    if plan[FMI] == 3:
        status = _c_ppppp(plan[SET_REAL], plan[COMPONENT], references, count, address, count)
    else:
        status = _c_pppp(plan[SET_REAL], plan[COMPONENT], references, count, address)
    return check(plan, status, SET_REAL)


@njit
def get_floats(plan: Any, references: int, count: int, address: int) -> bool:
    """Put the values of ``count`` variables at an address."""
    if count == 0:
        return True
    if plan[FMI] == 3:
        status = _c_ppppp(plan[GET_REAL], plan[COMPONENT], references, count, address, count)
    else:
        status = _c_pppp(plan[GET_REAL], plan[COMPONENT], references, count, address)
    return check(plan, status, GET_REAL)


@njit
def set_inputs(plan: Any, t: float, count: int) -> bool:
    """Set the first ``count`` inputs to their values at ``t``, within the segments between two jumps."""
    if count == 0:
        return True
    n = plan[N_INPUTS]
    time = carray(doubles(plan[KNOT_TIME]), (plan[N_KNOTS],))
    left = carray(doubles(plan[KNOT_LEFT]), (plan[N_KNOTS] - 1, n))
    right = carray(doubles(plan[KNOT_RIGHT]), (plan[N_KNOTS] - 1, n))
    values = carray(doubles(plan[INPUTS]), (n,))
    k = plan[SEGMENT]
    while k + 1 < plan[LAST] and t >= time[k + 1]:
        k += 1
    while k > plan[FIRST] and t < time[k]:
        k -= 1
    plan[SEGMENT] = k
    share = (t - time[k]) / (time[k + 1] - time[k])
    for i in range(count):
        values[i] = left[k, i] + share * (right[k, i] - left[k, i])
    return set_floats(plan, plan[VR_INPUTS], count, plan[INPUTS])


@njit
def apply(plan: Any, t: float) -> bool:
    """Set time and the continuous inputs at ``t``: what continuous-time mode allows."""
    if not check(plan, _c_pd(plan[SET_TIME], plan[COMPONENT], t), SET_TIME):
        return False
    return set_inputs(plan, t, plan[N_CONTINUOUS])


@njit
def completed_step(plan: Any, flags: Any) -> bool:
    """Tell the FMU that a step is done; ``flags`` [2] get: event mode wanted, end of the simulation wanted."""
    raw = np.zeros(2, dtype=np.int32)  # an int each for FMI 2.0; FMI 3.0 writes the first byte, which is its low one
    status = _c_pipp(plan[STEP_DONE], plan[COMPONENT], 1, raw.ctypes.data, raw.ctypes.data + 4)
    flags[0], flags[1] = raw[0], raw[1]
    return check(plan, status, STEP_DONE)


@njit
def new_discrete(plan: Any, flags: Any, next_event: Any) -> bool:
    """One iteration of event mode.

    ``flags`` [5] get: another iteration needed, end wanted, nominals changed, states changed, next time event known;
    ``next_event`` [1] gets its time [s] or infinity.
    """
    raw = np.zeros(8, dtype=np.int32)  # fmi2EventInfo: five ints, padding, one double; FMI 3.0: bytes and a double
    address = raw.ctypes.data
    if plan[FMI] == 3:
        status = _c_ppppppp(
            plan[NEW_DISCRETE],
            plan[COMPONENT],
            address,
            address + 1,
            address + 2,
            address + 3,
            address + 4,
            address + 24,
        )
        small = raw.view(np.uint8)
        for i in range(5):
            flags[i] = small[i]
    else:
        status = _c_pp(plan[NEW_DISCRETE], plan[COMPONENT], address)
        for i in range(5):
            flags[i] = raw[i]
    next_event[0] = raw.view(np.float64)[3] if flags[4] != 0 else np.inf
    return check(plan, status, NEW_DISCRETE)


@njit
def do_step(plan: Any, t: float, size: float) -> int:
    """One communication step of Co-Simulation; returns an outcome."""
    plan[STEPS] += 1
    if plan[FMI] != 3:
        status = _c_pddi(plan[DO_STEP], plan[COMPONENT], t, size, 1)
        return DONE if check(plan, status, DO_STEP) else FMU_FAILED
    raw = np.zeros(2, dtype=np.float64)  # three booleans, then the last successful time
    address = raw.ctypes.data
    status = _c_pddipppp(plan[DO_STEP], plan[COMPONENT], t, size, 1, address, address + 1, address + 2, address + 8)
    flags = raw.view(np.uint8)
    if not check(plan, status, DO_STEP):
        return FMU_FAILED
    if flags[1] != 0:
        return TERMINATED
    return CUT_SHORT if flags[2] != 0 else DONE


@njit
def set_slopes(plan: Any, orders: Any, address: int) -> bool:
    """Give FMI 2.0 Co-Simulation the time derivatives of its continuous inputs."""
    status = _c_ppppp(
        plan[SET_SLOPES], plan[COMPONENT], plan[VR_INPUTS], plan[N_CONTINUOUS], orders.ctypes.data, address
    )
    return check(plan, status, SET_SLOPES)
