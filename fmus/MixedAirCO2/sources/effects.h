/* Effects: physics that the base model leaves out, each with an amplitude that is zero by default.
 * EQUATIONS.md section 7.
 *
 * To add one: give it a parameter `effect.<name>.*` with start 0 in variables.toml, and its term here. An
 * effect may add air exchange, add heat to the room air, add heat capacity, or scale sun, heater and mixing.
 * One that comes and goes has a shape as well, an input between 0 and 1.
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

/* Air exchange through the window [kg/s]. */
static inline double effect_window(const double *r, double T_air, double T_out)
{
    return r[V_yWin] * (r[V_effect_window_m0]
                        + r[V_effect_window_cStack] * (smooth_abs(T_air - T_out) - DT_SMOOTH));
}

/* Share of the outdoor air flow that the fan delivers [1]. */
static inline double effect_fan(const double *r)
{
    return 1.0 - r[V_effect_shutdown_fra] * r[V_yOff];
}

/* Share of the irradiance that moving blinds let through [1]. */
static inline double effect_blinds(const double *r)
{
    return 1.0 - r[V_effect_blinds_fra] * r[V_ySha];
}

/* Heat to the room air [W]. */
static inline double effect_heat(const double *r, double T_air, double T_out)
{
    return r[V_effect_plug_Q] + r[V_effect_timetable_Q] * r[V_yPlu] + r[V_effect_bridge_UA] * (T_out - T_air)
           + r[V_effect_adjacent_UA] * (r[V_effect_adjacent_T] - T_air);
}

#endif
