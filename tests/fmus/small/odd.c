/* What foreign FMUs do: no units, a nominal value of zero, no simulation before its time 0, an offset of either sign.

   x' = -k x from 1; y = x + offset. */
#define NOMINAL 0.0
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; }
static int rates(Model *m, double *dx) {
  dx[0] = -m->v[K] * m->v[X];
  if (m->time < 0) say(m, FAILED, "time is negative");
  return m->time < 0 ? FAILED : OK;
}
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { m->v[Y] = m->v[X] + m->v[OFFSET]; }
static int stepped(Model *m) { (void)m; return 0; }
