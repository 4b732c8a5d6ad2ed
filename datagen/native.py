"""What runs while an FMU is integrated: the right-hand side, the root function and the loop over events, compiled.

No Python runs between the start and the end of a simulation. CVODE calls :data:`right_hand_side` and
:data:`event_indicators`, which call the FMU's C functions by address; :func:`drive` walks from jump to jump of the
inputs. Inputs are applied inside the right-hand side, at the time that CVODE asks for: a solver that is shown inputs
frozen over a step integrates another system.

Means over the output step are extra states of the integration: d/dt q = output. They share the solver's steps and are
kept out of its error test.

The callbacks get one array of integers, the plan; the constants below are its places.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic

from datagen.foreign import foreign

# places in the plan
COMPONENT, SET_TIME, SET_REAL, GET_REAL, SET_STATES, GET_STATES = 0, 1, 2, 3, 4, 5
GET_DERIVATIVES, GET_INDICATORS, ENTER_EVENT, NEW_DISCRETE, ENTER_CONTINUOUS, STEP_DONE = 6, 7, 8, 9, 10, 11
N_STATES, N_MEANS, N_INPUTS, N_POINTS, N_KNOTS, N_INDICATORS = 12, 13, 14, 15, 16, 17
VR_INPUTS, VR_POINTS, VR_MEANS, INPUTS = 18, 19, 20, 21
KNOT_TIME, KNOT_LEFT, KNOT_RIGHT = 22, 23, 24
SEGMENT, FIRST, LAST = 25, 26, 27  # segment of the last look-up; segments allowed until the next jump
VECTOR_DATA, CVODE, CV_REINIT, CV_SET_STOP, CV_MEMORY, STATE_VECTOR = 28, 29, 30, 31, 32, 33
STATUS, FAILED_CALL, RHS_CALLS, INDICATOR_CALLS, EVENTS = 34, 35, 36, 37, 38
PLAN_SIZE = 40

# outcomes of drive(); negative values are CVODE's own
DONE, FMU_FAILED, TERMINATED, ENDLESS_EVENT, NOT_FINITE = 0, 1, 2, 3, 4
MAX_EVENT_ITERATIONS = 100
_ROOT_RETURN = 2
_NORMAL = 1

_c_p = foreign("i:p")
_c_pd = foreign("i:pd")
_c_pp = foreign("i:pp")
_c_ppp = foreign("i:ppp")
_c_pppp = foreign("i:pppp")
_c_pipp = foreign("i:pipp")
_c_cvode = foreign("i:pdppi")
_c_reinit = foreign("i:pdp")
_address_of = foreign("p:p")


@intrinsic
def _pointer(typingctx: Any, address: Any) -> Any:
    """The address of doubles as a pointer that ``carray`` takes."""
    pointer = types.CPointer(types.float64)

    def codegen(context: Any, builder: Any, called: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(pointer))

    return pointer(types.int64), codegen


_doubles: Any = _pointer  # numba's stubs do not know that the typing context is not passed


@njit(cache=True, error_model="numpy")
def _check(plan: Any, status: int, function: int) -> bool:
    """Remember a failed call of the FMU; fmi2OK is 0, fmi2Warning 1."""
    if status > 1:
        plan[STATUS] = status
        plan[FAILED_CALL] = function
        return False
    return True


@njit(cache=True, error_model="numpy")
def _apply(plan: Any, t: float) -> bool:
    """Set time and inputs at ``t``, within the segments between two jumps."""
    n = plan[N_INPUTS]
    if not _check(plan, _c_pd(plan[SET_TIME], plan[COMPONENT], t), SET_TIME):
        return False
    if n == 0:
        return True
    time = carray(_doubles(plan[KNOT_TIME]), (plan[N_KNOTS],))
    left = carray(_doubles(plan[KNOT_LEFT]), (plan[N_KNOTS] - 1, n))
    right = carray(_doubles(plan[KNOT_RIGHT]), (plan[N_KNOTS] - 1, n))
    values = carray(_doubles(plan[INPUTS]), (n,))
    k = plan[SEGMENT]
    while k + 1 < plan[LAST] and t >= time[k + 1]:
        k += 1
    while k > plan[FIRST] and t < time[k]:
        k -= 1
    plan[SEGMENT] = k
    share = (t - time[k]) / (time[k + 1] - time[k])
    for i in range(n):
        values[i] = left[k, i] + share * (right[k, i] - left[k, i])
    return _check(plan, _c_pppp(plan[SET_REAL], plan[COMPONENT], plan[VR_INPUTS], n, plan[INPUTS]), SET_REAL)


@njit(cache=True, error_model="numpy")
def _set_states(plan: Any, address: int) -> bool:
    if plan[N_STATES] == 0:
        return True
    return _check(plan, _c_ppp(plan[SET_STATES], plan[COMPONENT], address, plan[N_STATES]), SET_STATES)


@njit(cache=True, error_model="numpy")
def _get_reals(plan: Any, references: int, count: int, address: int) -> bool:
    if count == 0:
        return True
    return _check(plan, _c_pppp(plan[GET_REAL], plan[COMPONENT], references, count, address), GET_REAL)


@njit(cache=True, error_model="numpy")
def _evaluate(t: float, y: int, ydot: int, plan: Any) -> int:
    plan[RHS_CALLS] += 1
    plan[STATUS] = 0
    data = _address_of(plan[VECTOR_DATA], y)
    out = _address_of(plan[VECTOR_DATA], ydot)
    n = plan[N_STATES]
    ok = _apply(plan, t) and _set_states(plan, data)
    if ok and n > 0:
        ok = _check(plan, _c_ppp(plan[GET_DERIVATIVES], plan[COMPONENT], out, n), GET_DERIVATIVES)
    ok = ok and _get_reals(plan, plan[VR_MEANS], plan[N_MEANS], out + 8 * n)
    if n + plan[N_MEANS] == 0 and ok:
        carray(_doubles(out), (1,))[0] = 0.0  # CVODE wants at least one state
    if ok:
        return 0
    return 1 if plan[STATUS] == 2 else -1  # fmi2Discard: CVODE tries a smaller step


@cfunc("int32(float64, intp, intp, CPointer(int64))", cache=True, error_model="numpy")
def right_hand_side(t: float, y: int, ydot: int, data: Any) -> int:
    """CVRhsFn: inputs at ``t``, states, derivatives, and the outputs whose means are wanted."""
    return _evaluate(t, y, ydot, carray(data, (PLAN_SIZE,)))


@cfunc("int32(float64, intp, intp, CPointer(int64))", cache=True, error_model="numpy")
def event_indicators(t: float, y: int, gout: int, data: Any) -> int:
    """CVRootFn: the FMU's event indicators."""
    plan = carray(data, (PLAN_SIZE,))
    plan[INDICATOR_CALLS] += 1
    plan[STATUS] = 0
    ok = _apply(plan, t) and _set_states(plan, _address_of(plan[VECTOR_DATA], y))
    count = plan[N_INDICATORS]
    ok = ok and _check(plan, _c_ppp(plan[GET_INDICATORS], plan[COMPONENT], gout, count), GET_INDICATORS)
    return 0 if ok else -1


@njit(cache=True, error_model="numpy")
def _handle_event(plan: Any, t: float, y: int, next_event: Any) -> int:
    """Event mode at ``t`` with the inputs just after it; the states may jump."""
    component = plan[COMPONENT]
    plan[EVENTS] += 1
    if not _check(plan, _c_p(plan[ENTER_EVENT], component), ENTER_EVENT) or not _apply(plan, t):
        return FMU_FAILED
    info = np.zeros(8, dtype=np.int32)  # fmi2EventInfo: five fmi2Boolean, padding, one double
    changed = False
    for _ in range(MAX_EVENT_ITERATIONS):
        if not _check(plan, _c_pp(plan[NEW_DISCRETE], component, info.ctypes.data), NEW_DISCRETE):
            return FMU_FAILED
        changed = changed or info[3] != 0
        if info[1] != 0:
            return TERMINATED
        if info[0] == 0:
            break
    else:
        return ENDLESS_EVENT
    next_event[0] = info.view(np.float64)[3] if info[4] != 0 else np.inf
    if not _check(plan, _c_p(plan[ENTER_CONTINUOUS], component), ENTER_CONTINUOUS):
        return FMU_FAILED
    ok = True
    if changed and plan[N_STATES] > 0:
        ok = _check(plan, _c_ppp(plan[GET_STATES], component, y, plan[N_STATES]), GET_STATES)
    return DONE if ok else FMU_FAILED


@njit(cache=True, error_model="numpy")
def _record(plan: Any, y: Any, row: int, points: Any, quadratures: Any, states: Any) -> int:
    if not _get_reals(plan, plan[VR_POINTS], plan[N_POINTS], points.ctypes.data + 8 * row * plan[N_POINTS]):
        return FMU_FAILED
    n = plan[N_STATES]
    for i in range(plan[N_MEANS]):
        quadratures[row, i] = y[n + i]
        if not np.isfinite(y[n + i]):
            return NOT_FINITE
    for i in range(plan[N_POINTS]):
        if not np.isfinite(points[row, i]):
            return NOT_FINITE
    if states.shape[0] > 0:
        states[row, :] = y[:n]
    return DONE


@njit(cache=True, error_model="numpy")
def drive(
    plan: Any,
    y: Any,
    stops: Any,
    knot_time: Any,
    output_time: Any,
    points: Any,
    quadratures: Any,
    states: Any,
    next_event: Any,
    reached: Any,
) -> int:
    """Integrate from the first knot to the last, recording at ``output_time``.

    Parameters
    ----------
    plan
        Shape (PLAN_SIZE,), int64; the FMU is in continuous-time mode at the first knot.
    y
        The memory of CVODE's state vector: states, then quadratures.
    stops
        Indices of the knots where inputs jump, with the first and the last knot, int64.
    knot_time, output_time
        [s]; the output times lie within the knots and increase.
    points, quadratures, states
        Filled: (outputs, points), (outputs, means), (outputs, states) or (0, 0).
    next_event, reached
        Shape (1,): the FMU's next time event [s], and on return how far it came [s].

    Returns
    -------
    int
        DONE, another outcome of this module, or a negative code of CVODE.
    """
    row, rows = 0, len(output_time)
    t = knot_time[stops[0]]
    t_return = np.empty(1)
    flags = np.zeros(2, dtype=np.int32)
    y_address = y.ctypes.data
    for s in range(len(stops) - 1):
        end = knot_time[stops[s + 1]]
        plan[FIRST], plan[LAST], plan[SEGMENT] = stops[s], stops[s + 1], stops[s]
        if s > 0:
            outcome = _handle_event(plan, t, y_address, next_event)
            if outcome != DONE:
                return outcome
        restart = True
        while True:
            reached[0] = t
            while row < rows and output_time[row] <= t:
                outcome = _record(plan, y, row, points, quadratures, states)
                if outcome != DONE:
                    return outcome
                row += 1
            if t >= end:
                break
            if restart:
                code = _c_reinit(plan[CV_REINIT], plan[CV_MEMORY], t, plan[STATE_VECTOR])
                if code >= 0:
                    code = _c_pd(plan[CV_SET_STOP], plan[CV_MEMORY], end)
                if code < 0:
                    return code
                restart = False
            target = end
            if row < rows:
                target = min(target, output_time[row])
            target = min(target, next_event[0])
            flag = 0
            if target - t > 1e-12 * max(abs(t), abs(target), 1.0):
                flag = _c_cvode(plan[CVODE], plan[CV_MEMORY], target, plan[STATE_VECTOR], t_return.ctypes.data, _NORMAL)
                if flag < 0:
                    reached[0] = t_return[0]
                    return flag
                t = t_return[0]
            else:
                t = target  # nearer than CVODE can start: nothing moves
            if not (_apply(plan, t) and _set_states(plan, y_address)):
                return FMU_FAILED
            done = _c_pipp(plan[STEP_DONE], plan[COMPONENT], 1, flags.ctypes.data, flags.ctypes.data + 4)
            if not _check(plan, done, STEP_DONE):
                return FMU_FAILED
            if flags[1] != 0:
                return TERMINATED
            if flag == _ROOT_RETURN or flags[0] != 0 or t >= next_event[0]:
                # an output that falls on the event is taken just before it
                while row < rows and output_time[row] <= t:
                    outcome = _record(plan, y, row, points, quadratures, states)
                    if outcome != DONE:
                        return outcome
                    row += 1
                outcome = _handle_event(plan, t, y_address, next_event)
                if outcome != DONE:
                    return outcome
                restart = True
    return DONE
