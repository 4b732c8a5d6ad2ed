/* One instance of the FMU: its values, its phase, and lazy evaluation. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "fmi2_api.h"
#include "model.h"

/* Phases of an instance's life, as bits, so that a function can name those it is allowed in. */
enum {
    PHASE_INSTANTIATED = 1,
    PHASE_INITIALIZATION = 2,
    PHASE_EVENT = 4,
    PHASE_CONTINUOUS = 8,
    PHASE_TERMINATED = 16
};
#define PHASE_BEFORE (PHASE_INSTANTIATED | PHASE_INITIALIZATION)
#define PHASE_RUNNING (PHASE_EVENT | PHASE_CONTINUOUS)
#define PHASE_ANY 31

/* What is still to be done before outputs and derivatives are right. */
enum { FRESH = 0, NEEDS_EVALUATION = 1, NEEDS_START = 2 };

/* Everything that an FMU state holds: no pointers. */
typedef struct {
    double r[N_REAL];
    double time;
    Coef coef;
    Limits limits;
    Modes modes;
    int replay;
    int phase;
    int stale;    /* FRESH, NEEDS_EVALUATION or NEEDS_START */
    int finite;   /* whether the last evaluation gave finite derivatives */
} Data;

typedef struct {
    Data d;
    fmi2CallbackFunctions callbacks;
    int logging;
    char *name;
} Instance;

/* Log a printf-style message and return status. */
fmi2Status instance_log(const Instance *c, fmi2Status status, const char *format, ...);

/* fmi2OK if the instance is in one of the phases, else a logged fmi2Error. */
fmi2Status instance_check(const Instance *c, int phases, const char *function);

/* Leave the calling FMI function, which names its instance c, unless c is in one of the phases. */
#define CHECK(phases)                                                          \
    do {                                                                       \
        if (instance_check(c, (phases), __func__) != fmi2OK) return fmi2Error; \
    } while (0)

/* Bring outputs and derivatives up to date. fmi2Discard (logged) if a derivative is not finite. */
fmi2Status instance_evaluate(Instance *c);

/* Memory from the importer's callbacks if it gave some, zeroed. */
void *instance_allocate(const fmi2CallbackFunctions *callbacks, size_t count, size_t size);
void instance_release(const fmi2CallbackFunctions *callbacks, void *memory);

#endif
