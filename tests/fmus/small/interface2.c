/* The functions of FMI 2.0 over the runtime. */
typedef struct { int needed, terminate, nominals, changed, defined; double next; } Info;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger logger; void *(*allocate)(size_t, size_t); void (*release)(void *); void *finished, *environment; } Callbacks;
static void say(Model *m, int status, const char *text) {
  if (m->log) ((Logger)m->log)(m->environment, m->name, status, "logStatusError", "%s at t = %g", text, m->time);
}
static void say_as(Model *m, const char *name, int status, const char *category, const char *message) {
  if (m->log) ((Logger)m->log)(m->environment, name, status, category, message);
}
static int last_flags;
static double last_reached;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const Callbacks *c, int visible, int log) {
  (void)visible; (void)log; (void)kind;
  if (strcmp(guid, TOKEN)) return NULL;
  if (resources && !strncmp(resources, "file://", 7)) resources += 7;
  return create(name, resources, (void *)c->logger, c->environment);
}
EXPORT void fmi2FreeInstance(Model *m) { free(m); }
EXPORT int fmi2SetupExperiment(Model *m, int t, double tolerance, double start, int s, double stop) {
  (void)t; (void)tolerance; (void)s; (void)stop;
  m->time = start;
  return OK;
}
EXPORT int fmi2EnterInitializationMode(Model *m) { (void)m; return OK; }
EXPORT int fmi2ExitInitializationMode(Model *m) { begin(m); m->entered = 1; return OK; }
EXPORT int fmi2Terminate(Model *m) { (void)m; return OK; }
EXPORT int fmi2Reset(Model *m) { reset(m); return OK; }
EXPORT int fmi2GetReal(Model *m, const unsigned *vr, size_t n, double *value) { return get(m, vr, n, value); }
EXPORT int fmi2SetReal(Model *m, const unsigned *vr, size_t n, const double *value) { return set(m, vr, n, value); }
EXPORT int fmi2EnterEventMode(Model *m) { m->entered = 1; return OK; }
EXPORT int fmi2NewDiscreteStates(Model *m, Info *info) {
  int flags = event(m);
  info->needed = flags & AGAIN;
  info->terminate = (flags & TERMINATE) != 0;
  info->nominals = 0;
  info->changed = (flags & CHANGED) != 0;
  info->defined = m->next < HUGE_VAL;
  info->next = m->next;
  return OK;
}
EXPORT int fmi2EnterContinuousTimeMode(Model *m) { m->entered = 2; return OK; }
EXPORT int fmi2CompletedIntegratorStep(Model *m, int no, int *enter, int *terminate) {
  (void)no;
  int flags = stepped(m);
  *enter = (flags & (AGAIN | CHANGED)) != 0;
  *terminate = (flags & TERMINATE) != 0;
  return OK;
}
EXPORT int fmi2SetTime(Model *m, double time) { m->time = time; return OK; }
EXPORT int fmi2SetContinuousStates(Model *m, const double *x, size_t n) { (void)n; set_states(m, x); return OK; }
EXPORT int fmi2GetContinuousStates(Model *m, double *x, size_t n) { (void)n; get_states(m, x); return OK; }
EXPORT int fmi2GetDerivatives(Model *m, double *dx, size_t n) { (void)n; return derivatives(m, dx); }
EXPORT int fmi2GetEventIndicators(Model *m, double *z, size_t n) { (void)n; indicators(m, z); return OK; }
EXPORT int fmi2GetNominalsOfContinuousStates(Model *m, double *x, size_t n) {
  (void)m;
  for (size_t i = 0; i < n; i++) x[i] = NOMINAL;
  return OK;
}
EXPORT int fmi2SetRealInputDerivatives(Model *m, const unsigned *vr, size_t n, const int *order, const double *value) {
  for (size_t i = 0; i < n; i++) {
    if (order[i] != 1) return FAILED;
    m->slope[vr[i]] = value[i];
  }
  return OK;
}
EXPORT int fmi2DoStep(Model *m, double time, double size, int no) {
  (void)no;
  int status = do_step(m, time, size, &last_flags, &last_reached);
  return status == OK && (last_flags & TERMINATE) ? DISCARD : status;
}
EXPORT int fmi2GetRealStatus(Model *m, int kind, double *value) { (void)m; *value = last_reached; return kind == 2 ? OK : FAILED; }
EXPORT int fmi2GetBooleanStatus(Model *m, int kind, int *value) { (void)m; *value = (last_flags & TERMINATE) != 0; return kind == 3 ? OK : FAILED; }

#define UNSUPPORTED(name) EXPORT int fmi2##name(void) { return FAILED; }
UNSUPPORTED(SetDebugLogging) UNSUPPORTED(GetInteger) UNSUPPORTED(GetBoolean) UNSUPPORTED(GetString)
UNSUPPORTED(SetInteger) UNSUPPORTED(SetBoolean) UNSUPPORTED(SetString)
UNSUPPORTED(GetFMUstate) UNSUPPORTED(SetFMUstate) UNSUPPORTED(FreeFMUstate) UNSUPPORTED(SerializedFMUstateSize)
UNSUPPORTED(SerializeFMUstate) UNSUPPORTED(DeSerializeFMUstate) UNSUPPORTED(GetDirectionalDerivative)
UNSUPPORTED(GetRealOutputDerivatives) UNSUPPORTED(CancelStep) UNSUPPORTED(GetStatus)
UNSUPPORTED(GetIntegerStatus) UNSUPPORTED(GetStringStatus)
