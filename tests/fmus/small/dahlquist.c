/* Decay: x' = -k x. */
static int load(Model *m) { (void)m; return OK; }
static void begin(Model *m) { (void)m; }
static int rates(Model *m, double *dx) { dx[0] = -m->v[K] * m->v[X]; return OK; }
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { (void)m; }
static int stepped(Model *m) { (void)m; return 0; }
