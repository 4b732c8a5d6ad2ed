/* A meter that runs, x' = rate, and a contact that closes above its top: decided at events alone, as a relation is. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { m->v[CLOSED] = m->v[X] > m->v[TOP]; }
static int rates(Model *m, double *dx) {
  dx[0] = m->v[RATE];
  return OK;
}
static void indicators(Model *m, double *z) { z[0] = m->v[X] - m->v[TOP]; }
static int event(Model *m) {
  const double closed = m->v[X] > m->v[TOP];
  const int changed = closed != m->v[CLOSED];
  m->v[CLOSED] = closed;
  return changed ? AGAIN : 0;
}
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) { (void)m; return 0; }
