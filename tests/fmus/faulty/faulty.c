/* A tank that empties, FMI 2.0 Model Exchange, whose code misbehaves on request:
 *
 *     der(level) = inflow - k * level,   out = level
 *
 * Above `above`, k makes it do what `fault` says: 0 nothing, 1 segmentation fault, 2 endless loop, 3 exit(7),
 * 4 unbounded memory, 5 the Python interpreter's lock held for HELD seconds, once a process, 6 the first where k is a tenth
 * larger still and else the second. `leak` bytes are lost by every initialisation, whatever k. The fault comes at time zero or
 * later, within the derivatives, so while an integrator is at work. Written for the tests.
 */
#ifndef _WIN32
#define _GNU_SOURCE
#include <dlfcn.h>
#include <unistd.h>
#endif
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef void *Component;
typedef unsigned int Reference;
typedef int Status;
enum { OK = 0, ERROR = 3 };

typedef struct {
    int new_discrete, terminate, nominals, values, next_defined;
    double next;
} EventInfo;

enum { K, ABOVE, FAULT, LEAK, INFLOW, LEVEL, DER_LEVEL, OUT, COUNT };

typedef struct {
    double v[COUNT];
    double time;
} Tank;

static volatile char *lost;

static void idle(void) {
#ifndef _WIN32
    usleep(50000);
#endif
}

#define HELD 2
static void hold(void) {
#ifndef _WIN32
    static int done;
    int (*ensure)(void) = (int (*)(void))dlsym(RTLD_DEFAULT, "PyGILState_Ensure");
    void (*release)(int) = (void (*)(int))dlsym(RTLD_DEFAULT, "PyGILState_Release");
    if (done++ || !ensure || !release) return;
    int state = ensure();
    sleep(HELD);
    release(state);
#endif
}

static void misbehave(const Tank *t) {
    if (t->v[K] <= t->v[ABOVE] || t->time < 0) return;
    int fault = (int)t->v[FAULT];
    if (fault == 6) fault = t->v[K] > 1.1 * t->v[ABOVE] ? 1 : 2;
    switch (fault) {
    case 1: raise(SIGSEGV); break;
    case 2: for (volatile int forever = 1; forever;) idle(); break;
    case 3: exit(7);
    case 4:
        for (;;) {
            char *more = malloc(1 << 24);
            if (more) memset(more, 1, 1 << 24);
            lost = more;
        }
    case 5: hold(); break;
    default: break;
    }
}

static void defaults(Tank *t) {
    memset(t, 0, sizeof *t);
    t->v[K] = 1e-4;
    t->v[ABOVE] = 1e9;
    t->v[LEVEL] = 1.0;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return OK;
}
EXPORT Component fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                                 const void *callbacks, int visible, int logging) {
    (void)name; (void)type; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    Tank *t = malloc(sizeof *t);
    if (t) defaults(t);
    return t;
}
EXPORT void fmi2FreeInstance(Component c) { free(c); }
EXPORT Status fmi2SetupExperiment(Component c, int td, double tolerance, double start, int sd, double stop) {
    (void)td; (void)tolerance; (void)sd; (void)stop;
    ((Tank *)c)->time = start;
    return OK;
}
EXPORT Status fmi2EnterInitializationMode(Component c) {
    size_t bytes = (size_t)((Tank *)c)->v[LEAK];
    if (bytes) {
        char *more = malloc(bytes);
        if (!more) return ERROR;
        memset(more, 1, bytes);
        lost = more;
    }
    return OK;
}
EXPORT Status fmi2ExitInitializationMode(Component c) { (void)c; return OK; }
EXPORT Status fmi2Terminate(Component c) { (void)c; return OK; }
EXPORT Status fmi2Reset(Component c) { defaults(c); return OK; }
EXPORT Status fmi2GetReal(Component c, const Reference vr[], size_t n, double value[]) {
    Tank *t = c;
    t->v[DER_LEVEL] = t->v[INFLOW] - t->v[K] * t->v[LEVEL];
    t->v[OUT] = t->v[LEVEL];
    for (size_t i = 0; i < n; i++) value[i] = t->v[vr[i]];
    return OK;
}
EXPORT Status fmi2SetReal(Component c, const Reference vr[], size_t n, const double value[]) {
    for (size_t i = 0; i < n; i++) ((Tank *)c)->v[vr[i]] = value[i];
    return OK;
}
#define NONE(Name, Type) \
    EXPORT Status Name(Component c, const Reference vr[], size_t n, Type value[]) { \
        (void)c; (void)vr; (void)value; \
        return n ? ERROR : OK; \
    }
NONE(fmi2GetInteger, int)
NONE(fmi2GetBoolean, int)
NONE(fmi2GetString, const char *)
NONE(fmi2SetInteger, const int)
NONE(fmi2SetBoolean, const int)
NONE(fmi2SetString, const char *const)
EXPORT Status fmi2GetFMUstate(Component c, void **s) { (void)c; (void)s; return ERROR; }
EXPORT Status fmi2SetFMUstate(Component c, void *s) { (void)c; (void)s; return ERROR; }
EXPORT Status fmi2FreeFMUstate(Component c, void **s) { (void)c; (void)s; return ERROR; }
EXPORT Status fmi2SerializedFMUstateSize(Component c, void *s, size_t *n) { (void)c; (void)s; (void)n; return ERROR; }
EXPORT Status fmi2SerializeFMUstate(Component c, void *s, char b[], size_t n) { (void)c; (void)s; (void)b; (void)n; return ERROR; }
EXPORT Status fmi2DeSerializeFMUstate(Component c, const char b[], size_t n, void **s) { (void)c; (void)s; (void)b; (void)n; return ERROR; }
EXPORT Status fmi2GetDirectionalDerivative(Component c, const Reference u[], size_t nu, const Reference k[], size_t nk,
                                           const double dk[], double du[]) {
    (void)c; (void)u; (void)nu; (void)k; (void)nk; (void)dk; (void)du;
    return ERROR;
}
EXPORT Status fmi2EnterEventMode(Component c) { (void)c; return OK; }
EXPORT Status fmi2NewDiscreteStates(Component c, EventInfo *info) {
    (void)c;
    memset(info, 0, sizeof *info);
    return OK;
}
EXPORT Status fmi2EnterContinuousTimeMode(Component c) { (void)c; return OK; }
EXPORT Status fmi2CompletedIntegratorStep(Component c, int keep, int *event, int *terminate) {
    (void)c; (void)keep;
    *event = *terminate = 0;
    return OK;
}
EXPORT Status fmi2SetTime(Component c, double time) { ((Tank *)c)->time = time; return OK; }
EXPORT Status fmi2SetContinuousStates(Component c, const double x[], size_t n) {
    if (n) ((Tank *)c)->v[LEVEL] = x[0];
    return OK;
}
EXPORT Status fmi2GetDerivatives(Component c, double dx[], size_t n) {
    const Tank *t = c;
    misbehave(t);
    if (n) dx[0] = t->v[INFLOW] - t->v[K] * t->v[LEVEL];
    return OK;
}
EXPORT Status fmi2GetEventIndicators(Component c, double z[], size_t n) { (void)c; (void)z; (void)n; return OK; }
EXPORT Status fmi2GetContinuousStates(Component c, double x[], size_t n) {
    if (n) x[0] = ((Tank *)c)->v[LEVEL];
    return OK;
}
EXPORT Status fmi2GetNominalsOfContinuousStates(Component c, double x[], size_t n) {
    (void)c;
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return OK;
}
