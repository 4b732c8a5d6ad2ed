/* A house of two resistances and two capacities, as an FMU of FMI 2.0 (Model Exchange) in one file.

     ca TAir' = (TWal - TAir) / ri + (TOut - TAir) * leak + area * HSun + QHea
     cw TWal' = (TAir - TWal) / ri + (TOut - TWal) / rw

   Names, units and start values of the variables stand in modelDescription.xml, in the order of this enum. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { TAIR, TWAL, DTAIR, DTWAL, RW, RI, CW, CA, AREA, LEAK, TOUT, HSUN, QHEA, VARIABLES };
static const double START[VARIABLES] = {
    [TAIR] = 293.15, [TWAL] = 285.15, [RW] = 8e-3, [RI] = 2e-3, [CW] = 2e7, [CA] = 2e6, [AREA] = 2, [TOUT] = 278.15};

typedef struct { double v[VARIABLES]; } House;
typedef struct { int again, end, nominals, states, timed; double next; } EventInfo;

static void rates(House *h) {
  double *v = h->v, inwards = (v[TWAL] - v[TAIR]) / v[RI];
  v[DTAIR] = (inwards + (v[TOUT] - v[TAIR]) * v[LEAK] + v[AREA] * v[HSUN] + v[QHEA]) / v[CA];
  v[DTWAL] = ((v[TOUT] - v[TWAL]) / v[RW] - inwards) / v[CW];
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2Reset(House *h) { memcpy(h->v, START, sizeof START); return 0; }
EXPORT void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const void *callbacks,
                             int visible, int logging) {
  (void)name; (void)kind; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
  House *h = malloc(sizeof(House));
  if (h) fmi2Reset(h);
  return h;
}
EXPORT void fmi2FreeInstance(House *h) { free(h); }
EXPORT int fmi2SetupExperiment(House *h, int toleranced, double tolerance, double start, int stops, double stop) {
  (void)h; (void)toleranced; (void)tolerance; (void)start; (void)stops; (void)stop;
  return 0;
}
EXPORT int fmi2GetReal(House *h, const unsigned *vr, size_t n, double *value) {
  rates(h);
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= VARIABLES) return 3; /* fmi2Error */
    value[i] = h->v[vr[i]];
  }
  return 0;
}
EXPORT int fmi2SetReal(House *h, const unsigned *vr, size_t n, const double *value) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= VARIABLES) return 3;
    h->v[vr[i]] = value[i];
  }
  return 0;
}
EXPORT int fmi2NewDiscreteStates(House *h, EventInfo *info) { (void)h; memset(info, 0, sizeof *info); return 0; }
EXPORT int fmi2CompletedIntegratorStep(House *h, int keeps, int *event, int *end) {
  (void)h; (void)keeps;
  *event = *end = 0;
  return 0;
}
EXPORT int fmi2SetTime(House *h, double time) { (void)h; (void)time; return 0; }
EXPORT int fmi2SetContinuousStates(House *h, const double *x, size_t n) { memcpy(h->v, x, n * sizeof *x); return 0; }
EXPORT int fmi2GetContinuousStates(House *h, double *x, size_t n) { memcpy(x, h->v, n * sizeof *x); return 0; }
EXPORT int fmi2GetDerivatives(House *h, double *dx, size_t n) {
  rates(h);
  memcpy(dx, h->v + DTAIR, n * sizeof *dx);
  return 0;
}
EXPORT int fmi2GetEventIndicators(House *h, double *z, size_t n) { (void)h; (void)z; (void)n; return 0; }
EXPORT int fmi2GetNominalsOfContinuousStates(House *h, double *x, size_t n) {
  (void)h;
  for (size_t i = 0; i < n; i++) x[i] = 300;
  return 0;
}

#define NOTHING_TO_DO(name) EXPORT int fmi2##name(House *h) { (void)h; return 0; }
NOTHING_TO_DO(EnterInitializationMode)
NOTHING_TO_DO(ExitInitializationMode)
NOTHING_TO_DO(EnterEventMode)
NOTHING_TO_DO(EnterContinuousTimeMode)
NOTHING_TO_DO(Terminate)

/* what the standard asks to be there and this house has not: fmi2Error */
#define NOT_OFFERED(name) EXPORT int fmi2##name(void) { return 3; }
NOT_OFFERED(SetDebugLogging) NOT_OFFERED(GetInteger) NOT_OFFERED(GetBoolean) NOT_OFFERED(GetString)
NOT_OFFERED(SetInteger) NOT_OFFERED(SetBoolean) NOT_OFFERED(SetString)
NOT_OFFERED(GetFMUstate) NOT_OFFERED(SetFMUstate) NOT_OFFERED(FreeFMUstate) NOT_OFFERED(SerializedFMUstateSize)
NOT_OFFERED(SerializeFMUstate) NOT_OFFERED(DeSerializeFMUstate) NOT_OFFERED(GetDirectionalDerivative)
