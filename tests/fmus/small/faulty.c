/* Decay at rate k until a moment, from when on it misbehaves; the parameter "fault" says how. */
enum { NONE, ENDS, FAILS, HANGS, NOT_A_NUMBER, DISCARDS, RETURNS_EARLY, NEVER_SETTLES, DIRTY, SLOW, CRASHES, LEAKS, MUTTERS, CHATTERS };
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { m->next = m->v[WHEN]; }
static int is(Model *m, int fault) { return m->v[FAULT] == fault && m->time >= m->v[WHEN]; }
static int rates(Model *m, double *dx) {
  dx[0] = -m->v[K] * m->v[X];
  if (m->v[FAULT] == DIRTY) dx[0] += m->kept;
  if (is(m, SLOW)) wait_seconds(0.005);
  while (is(m, HANGS)) wait_seconds(0.05);
  if (is(m, NOT_A_NUMBER)) dx[0] = NAN;
  if (is(m, CRASHES)) *(volatile int *)8 = 0;
  if (is(m, LEAKS)) memset(malloc(10000), 1, 10000);
  if (is(m, DISCARDS)) return DISCARD;
  if (is(m, FAILS)) say(m, FAILED, "something broke");
  if (is(m, MUTTERS)) { /* what no importer should trust: nothing at all, and text that is not UTF-8 */
    say_as(m, NULL, FAILED, NULL, NULL);
    say_as(m, NULL, FAILED, "from nobody", NULL);
    say_as(m, "B\xfcro", FAILED, "\xff", "T\xfcr klemmt,\n\x1b[31m50 K too hot");
  }
  if (is(m, CHATTERS)) { /* what matters, among what does not */
    say(m, 1, "a licence ends in 30 days");
    say_as(m, m->name, 1, "WARNING", "<AssertionError><value>\"k &gt; 1\"</value></AssertionError>");
    say(m, FAILED, "the valve is stuck");
    for (int i = 0; i < 30; i++) say(m, 1, "step size reduced");
  }
  return is(m, FAILS) || is(m, MUTTERS) || is(m, CHATTERS) ? FAILED : OK;
}
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) {
  if (m->time >= m->next) m->next = HUGE_VAL;
  return is(m, NEVER_SETTLES) ? AGAIN : 0;
}
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) {
  if (m->v[FAULT] == DIRTY) m->kept += 1e-3;
  return (is(m, ENDS) ? TERMINATE : 0) | (is(m, RETURNS_EARLY) ? AGAIN : 0);
}
