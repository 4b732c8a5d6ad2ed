/* Van der Pol's oscillator: x' = y, y' = mu (1 - x^2) y - x. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; }
static int rates(Model *m, double *dx) {
  dx[0] = m->v[Y];
  dx[1] = m->v[MU] * (1 - m->v[X] * m->v[X]) * m->v[Y] - m->v[X];
  return OK;
}
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) { (void)m; return 0; }
