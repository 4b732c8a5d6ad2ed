/* Outputs that are inputs, times a gain; no states. The discrete output changes in event mode only. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { m->v[STEPPED] = m->v[GAIN] * m->v[SWITCH]; }
static int rates(Model *m, double *dx) { (void)dx; m->v[STEPPED] = m->v[GAIN] * m->v[SWITCH]; return OK; }
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { m->v[STEPPED] = m->v[GAIN] * m->v[SWITCH]; return 0; }
static void outputs(Model *m) { m->v[Y] = m->v[GAIN] * m->v[U]; }
static int stepped(Model *m) { (void)m; return 0; }
