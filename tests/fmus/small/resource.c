/* Reads a number from resources/number.txt when it is instantiated. */
static int load(Model *m) {
  char path[1100];
  size_t n = strlen(m->resources);
  snprintf(path, sizeof path, "%s%snumber.txt", m->resources, n && m->resources[n - 1] == '/' ? "" : "/");
  FILE *file = fopen(path, "r");
  if (!file) return FAILED;
  int found = fscanf(file, "%lf", &m->v[NUMBER]);
  fclose(file);
  return found == 1 ? OK : FAILED;
}
static void begin(Model *m) { (void)m; }
static int rates(Model *m, double *dx) { (void)m; (void)dx; return OK; }
static void indicators(Model *m, double *z) { (void)m; (void)z; }
static int event(Model *m) { (void)m; return 0; }
static void outputs(Model *m) { m->v[Y] = m->v[GAIN] * m->v[NUMBER]; }
static int stepped(Model *m) { (void)m; return 0; }
