/* Effects: physics that the base model leaves out, each with an amplitude that is zero by default.
 * EQUATIONS.md section 7.
 *
 * To add one: give it a parameter `effect.<name>.*` with start 0 in variables.toml, and its term here. An
 * effect may add air exchange, add heat to the room air, add heat capacity, or scale sun, heater and mixing.
 */
#ifndef EFFECTS_H
#define EFFECTS_H

#include "surfaces.h"
#include "variables.h"

/* Factors that are constant in time; all 1 or 0 in the base model. */
typedef struct {
    double sun;       /* share of the irradiance that arrives [1] */
    double heater;    /* share of the largest heater power that is there [1] */
    double mixing;    /* share of the ventilation air that mixes with the room air [1] */
    double C_air;     /* heat capacity added to the room air [J/K] */
} EffectFactors;

static inline void effect_factors(const double *r, EffectFactors *f)
{
    f->sun = 1.0 - r[V_effect_shading_fra];
    f->heater = 1.0 - r[V_effect_heater_derate];
    f->mixing = 1.0 - r[V_effect_mixing_bypass];
    f->C_air = r[V_effect_furniture_C];
}

/* Infiltration [kg/s] at room and outdoor air temperature [K]. */
static inline double effect_infiltration(const double *r, double T_air, double T_out)
{
    return r[V_effect_infiltration_m0] + r[V_effect_infiltration_cWind] * r[V_winSpe]
           + r[V_effect_infiltration_cStack] * (smooth_abs(T_air - T_out) - DT_SMOOTH);
}

/* Heat to the room air [W]. */
static inline double effect_heat(const double *r, double T_air, double T_out)
{
    return r[V_effect_plug_Q] + r[V_effect_bridge_UA] * (T_out - T_air)
           + r[V_effect_adjacent_UA] * (r[V_effect_adjacent_T] - T_air);
}

#endif
