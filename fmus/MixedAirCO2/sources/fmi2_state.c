/* FMI 2.0: saving, restoring and serialising the complete state of an instance. */
#include <string.h>

#include "instance.h"

/* A serialised state carries the GUID, so that bytes of another build are refused. */
typedef struct {
    char guid[48];
    Data data;
} Serialized;

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    if (!*state) *state = instance_allocate(&c->callbacks, 1, sizeof(Data));
    if (!*state) return instance_log(c, fmi2Error, "Out of memory.");
    memcpy(*state, &c->d, sizeof(Data));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    if (!state) return instance_log(c, fmi2Error, "There is no FMU state to set.");
    memcpy(&c->d, state, sizeof(Data));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    Instance *c = component;
    CHECK(PHASE_ANY);
    if (state && *state) {
        instance_release(&c->callbacks, *state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    Instance *c = component;
    (void)state;
    CHECK(PHASE_ANY);
    *size = sizeof(Serialized);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    Instance *c = component;
    Serialized s;
    CHECK(PHASE_ANY);
    if (!state || size < sizeof s) return instance_log(c, fmi2Error, "The buffer is too small for an FMU state.");
    memset(&s, 0, sizeof s);
    strncpy(s.guid, MODEL_GUID, sizeof s.guid - 1);
    memcpy(&s.data, state, sizeof s.data);
    memcpy(bytes, &s, sizeof s);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    Instance *c = component;
    Serialized s;
    CHECK(PHASE_ANY);
    if (size != sizeof s) return instance_log(c, fmi2Error, "These bytes are not an FMU state: wrong size.");
    memcpy(&s, bytes, sizeof s);
    if (strncmp(s.guid, MODEL_GUID, sizeof s.guid) != 0) {
        return instance_log(c, fmi2Error, "These bytes are not an FMU state of this build.");
    }
    if (!*state) *state = instance_allocate(&c->callbacks, 1, sizeof(Data));
    if (!*state) return instance_log(c, fmi2Error, "Out of memory.");
    memcpy(*state, &s.data, sizeof s.data);
    return fmi2OK;
}
