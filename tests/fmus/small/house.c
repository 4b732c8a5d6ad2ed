/* A house of two resistances and one capacity: from the air to the wall's mass, and from there to the outside.

   c T' = (To - T) / ro + a S + q N + P; the meter in the room shows T + ri (q N + P). */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; }
static double gains(Model *m) { return m->v[Q] * m->v[N] + m->v[P]; }
static int rates(Model *m, double *dx) {
  dx[0] = ((m->v[TO] - m->v[T]) / m->v[RO] + m->v[A] * m->v[S] + gains(m)) / (3600 * m->v[C]);
  return OK;
}
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { m->v[Y] = m->v[T] + m->v[RI] * gains(m); }
static int stepped(Model *m) { (void)m; return 0; }
