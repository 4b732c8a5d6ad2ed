/* Counts up at each whole multiple of the period; asks to end when it has reached its top. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { m->next = m->time + m->v[PERIOD]; }
static int rates(Model *m, double *dx) { (void)m; (void)dx; return OK; }
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) {
  if (m->time < m->next - 1e-12 * fabs(m->next)) return 0;
  m->v[COUNT] += 1;
  m->next += m->v[PERIOD];
  return m->v[COUNT] >= m->v[TOP] ? TERMINATE : 0;
}
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) { (void)m; return 0; }
