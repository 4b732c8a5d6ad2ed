/* FMI 2.0 for Model Exchange: life cycle, values, continuous time and events. */
#include "fmi2_api.h"

#include <string.h>

#include "instance.h"

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    Instance *c = component;
    (void)n, (void)categories; /* few messages: categories are not told apart */
    CHECK(PHASE_ANY);
    c->logging = on;
    return fmi2OK;
}

/* ---------------------------------------------------------------- life cycle */

static void set_start_values(Data *d)
{
    memset(d, 0, sizeof *d);
    memcpy(d->r, VARIABLE_STARTS, sizeof d->r);
    d->replay = BOOLEAN_STARTS[B_replay];
    d->phase = PHASE_INSTANTIATED;
    d->stale = NEEDS_START;
    d->finite = 1;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible;
    if (!callbacks || !name) return NULL;
    Instance probe = {.callbacks = *callbacks, .logging = logging, .name = (char *)name};
    if (type != fmi2ModelExchange) {
        instance_log(&probe, fmi2Error, "This FMU is for Model Exchange only.");
        return NULL;
    }
    if (!guid || strcmp(guid, MODEL_GUID) != 0) {
        instance_log(&probe, fmi2Error, "The GUID %s is not that of this binary, %s.", guid ? guid : "(none)", MODEL_GUID);
        return NULL;
    }
    Instance *c = instance_allocate(callbacks, 1, sizeof *c);
    char *own_name = instance_allocate(callbacks, strlen(name) + 1, 1);
    if (!c || !own_name) {
        if (c) instance_release(callbacks, c);
        if (own_name) instance_release(callbacks, own_name);
        instance_log(&probe, fmi2Error, "Out of memory.");
        return NULL;
    }
    *c = probe;
    c->name = strcpy(own_name, name);
    set_start_values(&c->d);
    return c;
}

void fmi2FreeInstance(fmi2Component component)
{
    Instance *c = component;
    if (!c) return;
    const fmi2CallbackFunctions callbacks = c->callbacks;
    instance_release(&callbacks, c->name);
    instance_release(&callbacks, c);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    Instance *c = component;
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    CHECK(PHASE_INSTANTIATED);
    c->d.time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_INSTANTIATED);
    c->d.phase = PHASE_INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_INITIALIZATION);
    c->d.stale = NEEDS_START;
    if (instance_evaluate(c) != fmi2OK) return fmi2Error;
    c->d.phase = PHASE_EVENT;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_RUNNING);
    c->d.phase = PHASE_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    set_start_values(&c->d);
    return fmi2OK;
}

/* ---------------------------------------------------------------- values */

static int is_input(fmi2ValueReference vr)
{
    return vr - V_FIRST_INPUT < N_INPUTS; /* unsigned */
}

static int is_parameter(fmi2ValueReference vr)
{
    return vr - V_FIRST_PARAMETER < N_PARAMETERS; /* unsigned */
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    fmi2Status status = fmi2OK;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= N_REAL) return instance_log(c, fmi2Error, "There is no Real value reference %u.", vr[i]);
        if (!is_input(vr[i]) && !is_parameter(vr[i]) && status == fmi2OK) {
            status = instance_evaluate(c);
            if (status > fmi2Discard) return status;
        }
        value[i] = c->d.r[vr[i]];
    }
    return status;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    Instance *c = component;
    CHECK(PHASE_BEFORE | PHASE_RUNNING);
    const int before = c->d.phase & PHASE_BEFORE;
    for (size_t i = 0; i < n; i++) {
        if (is_input(vr[i]) || (before && is_parameter(vr[i]))) {
            c->d.r[vr[i]] = value[i];
            continue;
        }
        if (vr[i] >= N_REAL) return instance_log(c, fmi2Error, "There is no Real value reference %u.", vr[i]);
        return instance_log(c, fmi2Error,
                            is_parameter(vr[i]) ? "%s is fixed once the instance is initialised."
                                                : "%s is calculated and cannot be set.",
                            VARIABLE_NAMES[vr[i]]);
    }
    if (n > 0) c->d.stale = before ? NEEDS_START : NEEDS_EVALUATION;
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != B_replay) return instance_log(c, fmi2Error, "There is no Boolean value reference %u.", vr[i]);
        value[i] = c->d.replay;
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    Instance *c = component;
    CHECK(PHASE_BEFORE | PHASE_RUNNING);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != B_replay) return instance_log(c, fmi2Error, "There is no Boolean value reference %u.", vr[i]);
        if (!(c->d.phase & PHASE_BEFORE)) {
            return instance_log(c, fmi2Error, "replay is fixed once the instance is initialised.");
        }
        c->d.replay = value[i] != fmi2False;
        c->d.stale = NEEDS_START;
    }
    return fmi2OK;
}

/* There are no Integer and no String variables. */
static fmi2Status none(Instance *c, const char *type, const fmi2ValueReference vr[], size_t n)
{
    CHECK(PHASE_ANY);
    return n == 0 ? fmi2OK : instance_log(c, fmi2Error, "There is no %s value reference %u.", type, vr[0]);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    (void)value;
    return none(c, "Integer", vr, n);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    (void)value;
    return none(c, "Integer", vr, n);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{
    (void)value;
    return none(c, "String", vr, n);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{
    (void)value;
    return none(c, "String", vr, n);
}
