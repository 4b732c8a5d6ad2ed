/* The functions of FMI 3.0 over the runtime. */
#include <stdbool.h>
typedef void (*Logger)(void *, int, const char *, const char *);

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
static void say(Model *m, int status, const char *text) {
  char message[200];
  snprintf(message, sizeof message, "%s at t = %g", text, m->time);
  if (m->log) ((Logger)m->log)(m->environment, status, "logStatusError", message);
}
static void say_as(Model *m, const char *name, int status, const char *category, const char *message) {
  (void)name;
  if (m->log) ((Logger)m->log)(m->environment, status, category, message);
}
static void *instantiate(const char *name, const char *token, const char *resources, void *environment, Logger logger) {
  if (strcmp(token, TOKEN)) return NULL;
  return create(name, resources, (void *)logger, environment);
}
EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool log, void *environment, Logger logger) {
  (void)visible; (void)log;
  return instantiate(name, token, resources, environment, logger);
}
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool log, bool events, bool early, const unsigned *vr, size_t n, void *environment, Logger logger, void *update) {
  (void)visible; (void)log; (void)vr; (void)n; (void)update;
  return events || early ? NULL : instantiate(name, token, resources, environment, logger);
}
EXPORT void fmi3FreeInstance(Model *m) { free(m); }
EXPORT int fmi3EnterInitializationMode(Model *m, bool t, double tolerance, double start, bool s, double stop) {
  (void)t; (void)tolerance; (void)s; (void)stop;
  m->time = start;
  return OK;
}
EXPORT int fmi3ExitInitializationMode(Model *m) { begin(m); m->entered = 1; return OK; }
EXPORT int fmi3Terminate(Model *m) { (void)m; return OK; }
EXPORT int fmi3Reset(Model *m) { reset(m); return OK; }
EXPORT int fmi3GetFloat64(Model *m, const unsigned *vr, size_t n, double *value, size_t nv) { return n == nv ? get(m, vr, n, value) : FAILED; }
EXPORT int fmi3SetFloat64(Model *m, const unsigned *vr, size_t n, const double *value, size_t nv) { return n == nv ? set(m, vr, n, value) : FAILED; }
EXPORT int fmi3EnterEventMode(Model *m) { m->entered = 1; return OK; }
EXPORT int fmi3UpdateDiscreteStates(Model *m, bool *needed, bool *terminate, bool *nominals, bool *changed, bool *defined, double *next) {
  int flags = event(m);
  *needed = (flags & AGAIN) != 0;
  *terminate = (flags & TERMINATE) != 0;
  *nominals = false;
  *changed = (flags & CHANGED) != 0;
  *defined = m->next < HUGE_VAL;
  *next = m->next;
  return OK;
}
EXPORT int fmi3EnterContinuousTimeMode(Model *m) { m->entered = 2; return OK; }
EXPORT int fmi3CompletedIntegratorStep(Model *m, bool no, bool *enter, bool *terminate) {
  (void)no;
  int flags = stepped(m);
  *enter = (flags & (AGAIN | CHANGED)) != 0;
  *terminate = (flags & TERMINATE) != 0;
  return OK;
}
EXPORT int fmi3SetTime(Model *m, double time) {
  if (m->entered != 2) return FAILED; /* continuous-time mode only */
  m->time = time;
  return OK;
}
EXPORT int fmi3SetContinuousStates(Model *m, const double *x, size_t n) { (void)n; set_states(m, x); return OK; }
EXPORT int fmi3GetContinuousStates(Model *m, double *x, size_t n) { (void)n; get_states(m, x); return OK; }
EXPORT int fmi3GetContinuousStateDerivatives(Model *m, double *dx, size_t n) { (void)n; return derivatives(m, dx); }
EXPORT int fmi3GetEventIndicators(Model *m, double *z, size_t n) { (void)n; indicators(m, z); return OK; }
EXPORT int fmi3GetNominalsOfContinuousStates(Model *m, double *x, size_t n) {
  (void)m;
  for (size_t i = 0; i < n; i++) x[i] = NOMINAL;
  return OK;
}
EXPORT int fmi3DoStep(Model *m, double time, double size, bool no, bool *events, bool *terminate, bool *early, double *last) {
  int flags;
  (void)no;
  int status = do_step(m, time, size, &flags, last);
  *events = false;
  *terminate = (flags & TERMINATE) != 0;
  *early = status == OK && !*terminate && (flags & AGAIN);
  return status;
}

#define UNSUPPORTED(name) EXPORT int fmi3##name(void) { return FAILED; }
#define UNSUPPORTED_TYPE(name) UNSUPPORTED(Get##name) UNSUPPORTED(Set##name)
UNSUPPORTED_TYPE(Float32) UNSUPPORTED_TYPE(Int8) UNSUPPORTED_TYPE(UInt8) UNSUPPORTED_TYPE(Int16) UNSUPPORTED_TYPE(UInt16)
UNSUPPORTED_TYPE(Int32) UNSUPPORTED_TYPE(UInt32) UNSUPPORTED_TYPE(Int64) UNSUPPORTED_TYPE(UInt64) UNSUPPORTED_TYPE(Boolean)
UNSUPPORTED_TYPE(String) UNSUPPORTED_TYPE(Binary) UNSUPPORTED_TYPE(Clock) UNSUPPORTED_TYPE(FMUState)
UNSUPPORTED_TYPE(IntervalDecimal) UNSUPPORTED_TYPE(IntervalFraction) UNSUPPORTED_TYPE(ShiftDecimal) UNSUPPORTED_TYPE(ShiftFraction)
UNSUPPORTED(SetDebugLogging) UNSUPPORTED(InstantiateScheduledExecution) UNSUPPORTED(GetNumberOfVariableDependencies)
UNSUPPORTED(GetVariableDependencies) UNSUPPORTED(FreeFMUState) UNSUPPORTED(SerializedFMUStateSize)
UNSUPPORTED(SerializeFMUState) UNSUPPORTED(DeserializeFMUState) UNSUPPORTED(GetDirectionalDerivative)
UNSUPPORTED(GetAdjointDerivative) UNSUPPORTED(EnterConfigurationMode) UNSUPPORTED(ExitConfigurationMode)
UNSUPPORTED(EvaluateDiscreteStates) UNSUPPORTED(GetNumberOfEventIndicators) UNSUPPORTED(GetNumberOfContinuousStates)
UNSUPPORTED(EnterStepMode) UNSUPPORTED(GetOutputDerivatives) UNSUPPORTED(ActivateModelPartition)
