/* FMI 2.0 for Model Exchange: continuous time, events and directional derivatives. */
#include <math.h>
#include <string.h>

#include "instance.h"

#define CHECK_LENGTH(n, expected)                                                              \
    do {                                                                                       \
        if ((n) != (expected)) {                                                               \
            return instance_log(c, fmi2Error, "%s: an array of %d values is expected.", __func__, (int)(expected)); \
        }                                                                                      \
    } while (0)

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING);
    c->d.time = time; /* the equations do not contain the time */
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t n)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING);
    CHECK_LENGTH(n, N_STATES);
    memcpy(c->d.r + V_FIRST_STATE, x, N_STATES * sizeof *x);
    c->d.stale = NEEDS_EVALUATION;
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real dx[], size_t n)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING | PHASE_INITIALIZATION | PHASE_TERMINATED);
    CHECK_LENGTH(n, N_STATES);
    const fmi2Status status = instance_evaluate(c);
    memcpy(dx, c->d.r + V_FIRST_DERIVATIVE, N_STATES * sizeof *dx);
    return status;
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real z[], size_t n)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING | PHASE_INITIALIZATION | PHASE_TERMINATED);
    CHECK_LENGTH(n, N_EVENTS);
    const fmi2Status status = instance_evaluate(c);
    model_indicators(&c->d.modes, &c->d.limits, z);
    return status;
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t n)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING | PHASE_INITIALIZATION | PHASE_TERMINATED);
    CHECK_LENGTH(n, N_STATES);
    if (c->d.stale == NEEDS_START) {
        const fmi2Status status = instance_evaluate(c);
        if (status > fmi2Discard) return status;
    }
    memcpy(x, c->d.r + V_FIRST_STATE, N_STATES * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real x[], size_t n)
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    CHECK_LENGTH(n, N_STATES);
    memcpy(x, STATE_NOMINALS, N_STATES * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING);
    c->d.phase = PHASE_EVENT;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_EVENT);
    c->d.phase = PHASE_CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    Instance *c = component;
    CHECK(PHASE_EVENT);
    memset(info, 0, sizeof *info);
    /* limiters first, then the clamps that depend on them: two rounds settle it */
    do {
        if (instance_evaluate(c) != fmi2OK) return fmi2Error;
        c->d.stale = NEEDS_EVALUATION;
    } while (model_update_modes(&c->d.coef, &c->d.modes, &c->d.limits));
    c->d.stale = FRESH;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean no_set_state_prior,
                                       fmi2Boolean *enter_event_mode, fmi2Boolean *terminate)
{
    Instance *c = component;
    (void)no_set_state_prior; /* nothing is kept that an earlier point would need */
    CHECK(PHASE_CONTINUOUS);
    *enter_event_mode = fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

/* ---------------------------------------------------------------- directional derivatives */

/* Size of a difference step that is small against the curvature of the equations and large against
 * rounding; powers of two, so that x +- step is exact in most digits. */
static double difference_step(const double *r, fmi2ValueReference vr)
{
    /* temperatures: DT_SMOOTH is the shortest length on which anything bends */
    if (vr == V_TDryBul || vr == V_TSky || vr == V_TSet) return 0x1p-13;
    if (vr == V_winSpe) return r[vr] < 4.0 * V_SMOOTH ? 0x1p-14 : 0x1p-13 * (V_SMOOTH + r[vr]);
    if (vr >= V_FIRST_STATE && vr < V_FIRST_STATE + N_STATES) {
        return vr == V_air_X ? 0x1p-20 : vr == V_conCO2_xI ? 0x1p-10 : 0x1p-13;
    }
    return 0x1p-10 * (1.0 + fabs(r[vr])); /* everything else enters linearly */
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real d_known[],
                                        fmi2Real d_unknown[])
{
    static const double offset[4] = {1.0, -1.0, 2.0, -2.0};
    static const double weight[4] = {8.0 / 12.0, -8.0 / 12.0, -1.0 / 12.0, 1.0 / 12.0};
    Instance *c = component;
    CHECK(PHASE_RUNNING | PHASE_INITIALIZATION | PHASE_TERMINATED);
    if (instance_evaluate(c) != fmi2OK) return fmi2Error;

    for (size_t i = 0; i < n_unknown; i++) {
        const fmi2ValueReference vr = unknown[i];
        if (vr >= N_REAL) return instance_log(c, fmi2Error, "There is no Real value reference %u.", vr);
        d_unknown[i] = 0.0;
    }
    double r[N_REAL];
    Limits limits;
    memcpy(r, c->d.r, sizeof r);
    for (size_t k = 0; k < n_known; k++) {
        const fmi2ValueReference vr = known[k];
        if (vr - V_FIRST_INPUT >= N_INPUTS && vr - V_FIRST_STATE >= N_STATES) {
            return instance_log(c, fmi2Error, "Derivatives exist with respect to inputs and states only, not to %u.", vr);
        }
        if (d_known[k] == 0.0) continue;
        /* fourth-order central difference, one known at a time: their units differ */
        const double x = r[vr], step = difference_step(r, vr);
        for (int j = 0; j < 4; j++) {
            r[vr] = x + offset[j] * step;
            model_evaluate(&c->d.coef, &c->d.modes, r, &limits);
            for (size_t i = 0; i < n_unknown; i++) {
                d_unknown[i] += weight[j] / step * d_known[k] * r[unknown[i]];
            }
        }
        r[vr] = x;
    }
    return fmi2OK;
}
