#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

fmi2Status instance_log(const Instance *c, fmi2Status status, const char *format, ...)
{
    static const char *const category[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                           "logStatusFatal", "logAll"};
    char text[512], escaped[1024];
    size_t n = 0;
    va_list args;
    if (!c->callbacks.logger || (status < fmi2Discard && !c->logging)) return status;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    /* the finished text goes as the format: importers in other languages often see nothing but the format */
    for (const char *p = text; *p; p++) {
        if (*p == '%') escaped[n++] = '%';
        escaped[n++] = *p;
    }
    escaped[n] = '\0';
    c->callbacks.logger(c->callbacks.componentEnvironment, c->name, status, category[status], escaped);
    return status;
}

fmi2Status instance_check(const Instance *c, int phases, const char *function)
{
    if (!c) return fmi2Error;
    if (c->d.phase & phases) return fmi2OK;
    return instance_log(c, fmi2Error, "%s must not be called in this state of the instance.", function);
}

void *instance_allocate(const fmi2CallbackFunctions *callbacks, size_t count, size_t size)
{
    return callbacks->allocateMemory ? callbacks->allocateMemory(count, size) : calloc(count, size);
}

void instance_release(const fmi2CallbackFunctions *callbacks, void *memory)
{
    if (callbacks->freeMemory) {
        callbacks->freeMemory(memory);
    } else {
        free(memory);
    }
}

/* Coefficients and initial states from the parameters, then modes that agree with them. */
static fmi2Status start(Instance *c)
{
    char message[400];
    Data *d = &c->d;
    if (model_prepare(&d->coef, d->r, d->replay, message, sizeof message)) {
        return instance_log(c, fmi2Error, "%s", message);
    }
    model_start(&d->coef, d->r);
    d->modes = (Modes){MODE_FREE, MODE_FREE, MODE_FREE, MODE_FREE, MODE_FREE};
    do {
        model_evaluate(&d->coef, &d->modes, d->r, &d->limits);
    } while (model_update_modes(&d->coef, &d->modes, &d->limits));
    return fmi2OK;
}

/* First value that is not finite, for the message. */
static const char *culprit(const Data *d)
{
    for (int i = 0; i < N_INPUTS; i++) {
        if (!isfinite(d->r[V_FIRST_INPUT + i])) return VARIABLE_NAMES[V_FIRST_INPUT + i];
    }
    for (int i = 0; i < N_STATES; i++) {
        if (!isfinite(d->r[V_FIRST_STATE + i])) return VARIABLE_NAMES[V_FIRST_STATE + i];
    }
    for (int i = 0; i < N_STATES; i++) {
        if (!isfinite(d->r[V_FIRST_DERIVATIVE + i])) return VARIABLE_NAMES[V_FIRST_DERIVATIVE + i];
    }
    return "a limited quantity";
}

fmi2Status instance_evaluate(Instance *c)
{
    Data *d = &c->d;
    if (d->stale == FRESH && d->finite) return fmi2OK;
    if (d->stale == NEEDS_START) {
        const fmi2Status status = start(c);
        if (status != fmi2OK) return status;
    } else {
        model_evaluate(&d->coef, &d->modes, d->r, &d->limits);
    }
    d->stale = FRESH;

    double zero = 0.0; /* x*0 is 0 for finite x, NaN for others */
    for (int i = 0; i < N_STATES; i++) {
        zero += d->r[V_FIRST_DERIVATIVE + i] * 0.0;
    }
    zero += d->limits.flow_low * 0.0 + d->limits.heat_low * 0.0;
    d->finite = zero == 0.0;
    if (d->finite) return fmi2OK;
    return instance_log(c, fmi2Discard, "At time %g s, %s is not a finite number.", d->time, culprit(d));
}
