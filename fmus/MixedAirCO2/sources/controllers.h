/* PI controllers with limiter and anti-windup, and the discrete modes of limiters and clamps.
 * EQUATIONS.md section 6. */
#ifndef CONTROLLERS_H
#define CONTROLLERS_H

/* A mode changes at a state event and nowhere else, so that the right-hand side is smooth between events. */
enum { MODE_FREE = 0, MODE_LOW = 1, MODE_HIGH = 2 };

/* Width of the hysteresis, relative to the limited quantity's own scale. The event indicator changes sign a
 * full width beyond the limit, the decision flips at half a width: what the solver's root finder leaves over
 * can neither miss the decision nor flip it back. */
#define HYSTERESIS 1e-6

typedef struct {
    double k;        /* gain */
    double inv_Ti;   /* 1/reset time [1/s] */
    double track;    /* anti-windup gain 1/(k*Ni) */
    double y_max;    /* upper limit; the lower one is 0 */
} Controller;

/* Limited output y in a given mode from the unlimited one. */
static inline double limited(int mode, double y, double y_max)
{
    return mode == MODE_FREE ? y : (mode == MODE_LOW ? 0.0 : y_max);
}

/* Derivative of the integrator state (same unit as the error e, per second). */
static inline double integrator_derivative(const Controller *c, double e, double y_unlimited, double y)
{
    return (e + (y - y_unlimited) * c->track) * c->inv_Ti;
}

/* Mode that belongs to the distances below (y - lower limit) and above (upper limit - y), both divided by the
 * scale of y, coming from `mode`. */
static inline int next_mode(int mode, double below, double above)
{
    const double half = 0.5 * HYSTERESIS;
    if (below < (mode == MODE_LOW ? half : -half)) return MODE_LOW;
    if (above < (mode == MODE_HIGH ? half : -half)) return MODE_HIGH;
    return MODE_FREE;
}

static inline double indicator_low(int mode, double below)
{
    return below + (mode == MODE_LOW ? -HYSTERESIS : HYSTERESIS);
}

static inline double indicator_high(int mode, double above)
{
    return above + (mode == MODE_HIGH ? -HYSTERESIS : HYSTERESIS);
}

#endif
