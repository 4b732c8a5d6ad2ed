/* What it was one second ago, with the sign turned: x'(t) = -k x(t - 1), and x = 1 before. Its past is what it was told. */
static double when[1 << 16], what[1 << 16];
static int known;
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; known = 0; }
static double past(double t) {
  int k = known;
  if (t <= 0 || known == 0) return 1;
  while (k > 0 && when[k - 1] > t) k--;
  if (k == known) return what[known - 1];
  double from = k ? when[k - 1] : 0, old = k ? what[k - 1] : 1;
  return old + (what[k] - old) * (t - from) / (when[k] - from);
}
static int rates(Model *m, double *dx) { dx[0] = -m->v[K] * past(m->time - 1); return OK; }
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) {
  if (known < 1 << 16 && m->time > (known ? when[known - 1] : 0)) when[known] = m->time, what[known++] = m->v[X];
  return 0;
}
