"""The right-hand side of the integration: the FMU's derivatives and the outputs whose means are wanted."""

from __future__ import annotations

from typing import Any

from numba import carray

from datagen.fmi.calls import (
    COMPONENT,
    EXPIRED,
    GET_DERIVATIVES,
    N_MEANS,
    N_STATES,
    RHS_CALLS,
    SET_STATES,
    STATUS,
    VR_MEANS,
    apply,
    check,
    doubles,
    get_floats,
)
from datagen.fmi.compilation import njit
from datagen.fmi.foreign import foreign

_c_ppp = foreign("i:ppp")


@njit
def set_states(plan: Any, address: int) -> bool:
    """Set the continuous states to the doubles at an address."""
    if plan[N_STATES] == 0:
        return True
    return check(plan, _c_ppp(plan[SET_STATES], plan[COMPONENT], address, plan[N_STATES]), SET_STATES)


@njit
def evaluate(plan: Any, t: float, states: int, out: int) -> int:
    """Derivatives at ``t`` for the states at one address, written to another: 0, 1 (try a smaller step) or -1."""
    plan[RHS_CALLS] += 1
    plan[STATUS] = 0
    if plan[EXPIRED] != 0:
        return -1
    n = plan[N_STATES]
    ok = apply(plan, t) and set_states(plan, states)
    if ok and n > 0:
        ok = check(plan, _c_ppp(plan[GET_DERIVATIVES], plan[COMPONENT], out, n), GET_DERIVATIVES)
    ok = ok and get_floats(plan, plan[VR_MEANS], plan[N_MEANS], out + 8 * n)
    if n + plan[N_MEANS] == 0 and ok:
        carray(doubles(out), (1,))[0] = 0.0  # CVODE wants at least one state
    if ok:
        return 0
    return 1 if plan[STATUS] == 2 else -1  # fmi2Discard: CVODE tries a smaller step
