/* A ball that falls and bounces: h' = v, v' = -g; at the ground v becomes -e v, and the ball lies still when slow. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; }
static int rates(Model *m, double *dx) {
  dx[0] = m->v[V];
  dx[1] = m->v[LYING] ? 0 : -m->v[G];
  return OK;
}
static void indicators(Model *m, double *z) { z[0] = m->v[LYING] ? 1 : m->v[H] + (m->v[V] < 0 ? 0 : 1e-12); }
static int event(Model *m) {
  if (m->v[LYING] || m->v[H] > 1e-9 || m->v[V] >= 0) return 0;
  m->v[H] = 0;
  m->v[V] *= -m->v[E];
  m->v[BOUNCES] += 1;
  if (m->v[V] < 0.05) m->v[V] = 0, m->v[LYING] = 1;
  return CHANGED;
}
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) { (void)m; return 0; }
