/* A small runtime that turns a model of a few lines into an FMU of FMI 2.0 or 3.0, both kinds in one library.

   Compiled with -DFMI=2 or 3, -DMODEL_FILE="\"name.c\"" and the generated "variables.h": an enum of the variables,
   VARIABLES, STATES, INDICATORS, START and STATE_OF (the variable of each state). Co-Simulation steps the same model
   with explicit Euler steps of INTERNAL seconds, and meets time events exactly and state events to a step. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#include <windows.h>
static void wait_seconds(double s) { Sleep((unsigned)(1000 * s)); }
#else
#define EXPORT __attribute__((visibility("default")))
#include <time.h>
static void wait_seconds(double s) {
  struct timespec t = {(time_t)s, (long)(1e9 * (s - (double)(time_t)s))};
  nanosleep(&t, NULL);
}
#endif
#include "variables.h"

enum { OK = 0, DISCARD = 2, FAILED = 3 };
enum { AGAIN = 1, CHANGED = 2, TERMINATE = 4 }; /* what an event can ask for */

typedef struct {
  double v[VARIABLES], time, next; /* next: time of the next time event, or HUGE_VAL */
  double slope[VARIABLES], slope_from;
  char resources[1024];
  int entered, calls, living;
  char name[64];
  void *environment;
  void *log; /* the importer's function, as the version has it */
  double kept; /* what a reset forgets to clear */
} Model;

static void say(Model *m, int status, const char *text); /* to the importer's log */
static void say_as(Model *m, const char *name, int status, const char *category, const char *message); /* anything */

/* what a model file defines */
static int load(Model *m);                        /* at instantiation */
static void begin(Model *m);                      /* at the end of initialisation */
static int rates(Model *m, double *dx);           /* derivatives; a status */
static void indicators(Model *m, double *z);
static int event(Model *m);                       /* flags */
static void outputs(Model *m);                    /* computes outputs from states and inputs */
static int stepped(Model *m);                     /* flags, after a completed step */

#include MODEL_FILE
#ifndef NOMINAL
#define NOMINAL 1.0
#endif

static Model *create(const char *name, const char *resources, void *log, void *environment) {
  Model *m = calloc(1, sizeof(Model));
  memcpy(m->v, START, sizeof START);
  m->next = HUGE_VAL;
  m->log = log;
  m->environment = environment;
  strncpy(m->name, name, sizeof m->name - 1);
  strncpy(m->resources, resources ? resources : "", sizeof m->resources - 1);
  if (load(m) != OK) {
    say(m, FAILED, "cannot load its resources");
    free(m);
    return NULL;
  }
  m->living = 1;
  return m;
}

static void reset(Model *m) {
  memcpy(m->v, START, sizeof START);
  memset(m->slope, 0, sizeof m->slope);
  m->next = HUGE_VAL;
  m->time = 0;
  m->entered = m->calls = 0;
  load(m);
}

static int get(Model *m, const unsigned *vr, size_t n, double *value) {
  outputs(m);
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= VARIABLES) return FAILED;
    value[i] = m->v[vr[i]];
  }
  return OK;
}

static int set(Model *m, const unsigned *vr, size_t n, const double *value) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= VARIABLES) return FAILED;
    if (m->entered == 2 && DISCRETE[vr[i]]) return FAILED; /* continuous-time mode */
    m->v[vr[i]] = value[i];
  }
  return OK;
}

static int derivatives(Model *m, double *dx) { return rates(m, dx); }

static void get_states(Model *m, double *x) {
  for (int i = 0; i < STATES; i++) x[i] = m->v[STATE_OF[i]];
}

static void set_states(Model *m, const double *x) {
  for (int i = 0; i < STATES; i++) m->v[STATE_OF[i]] = x[i];
}

/* one Co-Simulation step; returns a status, *flags what events asked for, *reached how far it came */
static int do_step(Model *m, double from, double size, int *flags, double *reached) {
  double dx[STATES + 1], z[INDICATORS + 1], z_new[INDICATORS + 1], base[VARIABLES], end = from + size;
  memcpy(base, m->v, sizeof base);
  *flags = 0;
  if (m->calls == 0) m->time = from;
  if (fabs(m->time - from) > 1e-6 * (1 + fabs(from))) return FAILED;
  while (m->time < end - 1e-9 * INTERNAL) {
    double h = fmin(fmin(INTERNAL, end - m->time), m->next - m->time);
    for (int i = 0; i < VARIABLES; i++)
      if (m->slope[i] != 0) m->v[i] = base[i] + m->slope[i] * (m->time + 0.5 * h - from);
    if (h > 0) {
      int status = rates(m, dx);
      if (status != OK) {
        *reached = m->time;
        return status;
      }
      indicators(m, z);
      for (int i = 0; i < STATES; i++) m->v[STATE_OF[i]] += h * dx[i];
      m->time += h;
      indicators(m, z_new);
    }
    int happened = m->time >= m->next - 1e-12 * fabs(m->next);
    for (int i = 0; i < INDICATORS && h > 0; i++) happened |= (z[i] > 0) != (z_new[i] > 0);
    for (int n = 0; happened && n < 100; n++) {
      int asked = event(m);
      *flags |= asked;
      happened = asked & AGAIN;
    }
    *flags |= stepped(m);
    if (*flags & TERMINATE) break;
  }
  m->calls++;
  *reached = m->time;
  if (!(*flags & TERMINATE)) m->time = end;
  return OK;
}

#if FMI == 2
#include "interface2.c"
#else
#include "interface3.c"
#endif
