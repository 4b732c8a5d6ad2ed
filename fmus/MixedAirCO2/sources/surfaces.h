/* Heat exchange at surfaces: convection that depends on the temperature difference, wind, long-wave
 * radiation. EQUATIONS.md section 4. Smooth everywhere: no branch on a state. */
#ifndef SURFACES_H
#define SURFACES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define SIGMA 5.670374419e-8 /* Stefan-Boltzmann constant [W/(m2.K4)] */

/* Natural convection, h = c*|dT|^(1/3) in W/(m2.K). */
#define C_VERTICAL 1.31 /* vertical surface */
#define C_ENHANCED 1.51 /* warm floor, cold ceiling: buoyancy helps */
#define C_REDUCED 0.76  /* cold floor, warm ceiling: buoyancy hinders */
#define C_FORCED 2.537  /* forced convection, h = c*Wf*Rf*sqrt(P*v/A) */

#define DT_SMOOTH 0.01 /* [K] below which |dT| is rounded off */
#define V_SMOOTH 0.01  /* [m/s] below which sqrt(v) is rounded off */

/* Cube root of a positive normal number. Our own, because libm's differs between platforms (the binaries
 * are to agree to the last bit) and is slower: divide the exponent by three, then three Halley steps. */
static inline double cube_root(double a)
{
    uint64_t bits;
    double t;
    memcpy(&bits, &a, sizeof bits);
    bits = bits / 3u + UINT64_C(0x2A9F7893782DA1CE);
    memcpy(&t, &bits, sizeof t);
    for (int i = 0; i < 3; i++) {
        const double t3 = t * t * t;
        t *= (t3 + 2.0 * a) / (2.0 * t3 + a);
    }
    return t;
}

/* |d| rounded off at zero: sqrt(d^2 + DT_SMOOTH^2). [K] */
static inline double smooth_abs(double d)
{
    return sqrt(d * d + DT_SMOOTH * DT_SMOOTH);
}

/* Convective coefficient [W/(m2.K)] of a surface dT [K] warmer than the air, equal for both signs. */
static inline double h_vertical(double dT)
{
    return C_VERTICAL * cube_root(smooth_abs(dT));
}

/* The same where buoyancy helps one sign: up = 1 for a floor, -1 for a ceiling. */
static inline double h_horizontal(double dT, double up)
{
    const double r = smooth_abs(dT);
    return (0.5 * (C_ENHANCED + C_REDUCED) + 0.5 * (C_ENHANCED - C_REDUCED) * up * dT / r) * cube_root(r);
}

/* sqrt(v) for wind speed v [m/s], with a finite slope at 0; negative v counts as calm. */
static inline double sqrt_wind(double v)
{
    /* written so that NaN passes through */
    return v <= 0.0 ? 0.0 : v / sqrt(sqrt(v * v + V_SMOOTH * V_SMOOTH));
}

static inline double pow4(double T)
{
    const double T2 = T * T;
    return T2 * T2;
}

#endif
