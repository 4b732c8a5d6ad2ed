"""What runs while an FMU is integrated: the right-hand side, the root function and the loop over events, compiled.

No Python runs between the start and the end of a simulation. CVODE calls :data:`right_hand_side` and
:data:`event_indicators`, which call the FMU's C functions by address; :func:`drive` walks from jump to jump of the
inputs. Inputs are applied inside the right-hand side, at the time that CVODE asks for: a solver that is shown inputs
frozen over a step integrates another system. No step crosses a knot of the inputs: it would smooth a bend over.

Means over the output step are extra states of the integration: d/dt q = output. They share the solver's steps and its
error test, where the outputs' accuracy is their tolerance.

The callbacks get one array of integers, the plan; :mod:`datagen.fmi.calls` names its places.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray

from datagen.fmi.calls import (
    COMPONENT,
    CUT_SHORT,
    CV_MEMORY,
    CV_REINIT,
    CV_SET_STOP,
    CVODE,
    DONE,
    EACH_STEP,
    ENDLESS_EVENT,
    ENTER_CONTINUOUS,
    ENTER_EVENT,
    EVENTS,
    EXPIRED,
    FIRST,
    FMU_FAILED,
    GET_INDICATORS,
    GET_STATES,
    INDICATOR_CALLS,
    LAST,
    MAX_EVENT_ITERATIONS,
    N_INDICATORS,
    N_INPUTS,
    N_MEANS,
    N_POINTS,
    N_STATES,
    NEEDED,
    NOT_FINITE,
    PLAN_SIZE,
    SEGMENT,
    STATE_VECTOR,
    STATES_CHANGED,
    STATUS,
    TERMINATE,
    TERMINATED,
    TIMED_OUT,
    TOLERANCES,
    VECTOR_DATA,
    VR_POINTS,
    apply,
    check,
    completed_step,
    doubles,
    get_floats,
    new_discrete,
    set_inputs,
)
from datagen.fmi.compilation import cfunc, njit
from datagen.fmi.foreign import foreign
from datagen.simulating.evaluation import evaluate, set_states

BELOW_ZERO = -1e-300
"""An indicator that is 0 counts as this: to FMI its two domains are z > 0 and z <= 0, while CVODE reports 0 itself,
where the FMU sees no change yet, and then takes no notice when it becomes positive."""
MAX_EVENTS_AT_ONCE = 1000
_ROOT_RETURN = 2
_NORMAL, _ONE_STEP = 1, 2

_c_p = foreign("i:p")
_c_pd = foreign("i:pd")
_c_ppp = foreign("i:ppp")
_c_cvode = foreign("i:pdppi")
_c_reinit = foreign("i:pdp")
_address_of = foreign("p:p")


@cfunc("int32(float64, intp, intp, CPointer(int64))")
def right_hand_side(t: float, y: int, ydot: int, data: Any) -> int:
    """CVRhsFn: inputs at ``t``, states, derivatives, and the outputs whose means are wanted."""
    plan = carray(data, (PLAN_SIZE,))
    return evaluate(plan, t, _address_of(plan[VECTOR_DATA], y), _address_of(plan[VECTOR_DATA], ydot))


@cfunc("int32(intp, intp, CPointer(int64))")
def error_weights(y: int, weights: int, data: Any) -> int:
    """CVEwtFn: tolerances of the states are relative and absolute, of quadratures, which only grow, absolute.

    Without states quadratures are all that is integrated, and count as states.
    """
    plan = carray(data, (PLAN_SIZE,))
    n = plan[N_STATES]
    size = max(n + plan[N_MEANS], 1)
    tolerances = carray(doubles(plan[TOLERANCES]), (1 + size,))
    relative, absolute = tolerances[0], tolerances[1:]
    values = carray(doubles(_address_of(plan[VECTOR_DATA], y)), (size,))
    out = carray(doubles(_address_of(plan[VECTOR_DATA], weights)), (size,))
    for i in range(size):
        out[i] = 1.0 / (absolute[i] + (relative * abs(values[i]) if i < n or n == 0 else 0.0))
    return 0


@cfunc("int32(float64, intp, intp, CPointer(int64))")
def event_indicators(t: float, y: int, gout: int, data: Any) -> int:
    """CVRootFn: the FMU's event indicators."""
    plan = carray(data, (PLAN_SIZE,))
    plan[INDICATOR_CALLS] += 1
    plan[STATUS] = 0
    ok = apply(plan, t) and set_states(plan, _address_of(plan[VECTOR_DATA], y))
    count = plan[N_INDICATORS]
    if not (ok and check(plan, _c_ppp(plan[GET_INDICATORS], plan[COMPONENT], gout, count), GET_INDICATORS)):
        return -1
    found = carray(doubles(gout), (count,))
    for i in range(count):
        if found[i] == 0.0:
            found[i] = BELOW_ZERO
    return 0


@njit
def _handle_event(plan: Any, t: float, y: int, next_event: Any) -> int:
    """Event mode at ``t`` with the inputs just after it; the states may jump."""
    component = plan[COMPONENT]
    plan[EVENTS] += 1
    if not check(plan, _c_p(plan[ENTER_EVENT], component), ENTER_EVENT) or not set_inputs(plan, t, plan[N_INPUTS]):
        return FMU_FAILED
    flags = np.zeros(5, dtype=np.int32)
    changed = False
    for _ in range(MAX_EVENT_ITERATIONS):
        if not new_discrete(plan, flags, next_event):
            return FMU_FAILED
        changed = changed or flags[STATES_CHANGED] != 0
        if flags[TERMINATE] != 0:
            return TERMINATED
        if flags[NEEDED] == 0:
            break
    else:
        return ENDLESS_EVENT
    if not check(plan, _c_p(plan[ENTER_CONTINUOUS], component), ENTER_CONTINUOUS):
        return FMU_FAILED
    ok = True
    if changed and plan[N_STATES] > 0:
        ok = check(plan, _c_ppp(plan[GET_STATES], component, y, plan[N_STATES]), GET_STATES)
    return DONE if ok else FMU_FAILED


@njit
def _record(plan: Any, y: Any, row: int, points: Any, quadratures: Any, states: Any) -> int:
    if not get_floats(plan, plan[VR_POINTS], plan[N_POINTS], points.ctypes.data + 8 * row * plan[N_POINTS]):
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


@njit(nogil=True)
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
        DONE, another outcome of :mod:`datagen.fmi.calls`, or a negative code of CVODE.
    """
    row, rows = 0, len(output_time)
    t = knot_time[stops[0]]
    last_event, crowd = t, 0  # events that follow each other without time passing
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
        restart, knot, bound = True, stops[s] + 1, t
        while True:
            reached[0] = t
            if plan[EXPIRED] != 0:
                return TIMED_OUT
            while row < rows and output_time[row] <= t:
                outcome = _record(plan, y, row, points, quadratures, states)
                if outcome != DONE:
                    return outcome
                row += 1
            if t >= end:
                break
            if restart:
                code = _c_reinit(plan[CV_REINIT], plan[CV_MEMORY], t, plan[STATE_VECTOR])
                if code < 0:
                    return code
            if restart or t >= bound:
                # no step goes past a time event, where the equations may change, or past a knot, where inputs bend:
                # it would smooth the bend over
                while knot_time[knot] <= t:
                    knot += 1
                bound = min(knot_time[knot], next_event[0]) if next_event[0] > t else knot_time[knot]
                code = _c_pd(plan[CV_SET_STOP], plan[CV_MEMORY], bound)
                if code < 0:
                    return code
                restart = False
            target = bound
            if row < rows:
                target = min(target, output_time[row])
            target = max(min(target, next_event[0]), t)
            flag = 0
            if target - t > 1e-12 * max(abs(t), abs(target), 1.0):
                task = _NORMAL
                if plan[EACH_STEP] != 0:
                    task = _ONE_STEP  # which ends at an output only if it must
                    code = _c_pd(plan[CV_SET_STOP], plan[CV_MEMORY], target)
                    if code < 0:
                        return code
                flag = _c_cvode(plan[CVODE], plan[CV_MEMORY], target, plan[STATE_VECTOR], t_return.ctypes.data, task)
                if flag < 0:
                    reached[0] = t_return[0]
                    return flag
                t = t_return[0]
            else:
                t = target  # nearer than CVODE can start: nothing moves
            if not (apply(plan, t) and set_states(plan, y_address)):
                return FMU_FAILED
            if not completed_step(plan, flags):
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
                if row == rows:
                    return DONE
                crowd = crowd + 1 if t - last_event <= 1e-9 * max(abs(t), 1.0) else 0
                last_event = t
                if crowd > MAX_EVENTS_AT_ONCE:
                    return ENDLESS_EVENT
                outcome = _handle_event(plan, t, y_address, next_event)
                if outcome != DONE:
                    return outcome
                restart = True
    return DONE if row == rows else CUT_SHORT
