/* The physics of MixedAirCO2 as pure functions. No global state, no memory, no FMI.
 *
 * One flat array r[N_REAL], indexed by value reference (variables.h), holds inputs, outputs, locals,
 * parameters, states and derivatives, each in the unit of variables.toml. */
#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>

#include "controllers.h"
#include "effects.h"
#include "variables.h"
#include "walls.h"

/* What depends on parameters only, computed once at initialisation. */
typedef struct {
    Wall facade, floor, ceiling, inner;
    double A_win;                             /* window area [m2] */
    double C_pane, inv_C_pane;                /* one pane [J/K], [K/J] */
    double G_win;                             /* pane to pane [W/K] */
    double m_air, inv_m_air, C_air, inv_C_air;/* [kg], [1/kg], [J/K], [K/J]; furniture in C_air */
    double cp;                                /* [J/(kg.K)] */
    double X_per_ppm, ppm_per_X;              /* mass fraction against volume fraction */
    double gr_facade, gr_win, gr_floor, gr_ceiling, gr_inner, inv_gr; /* long-wave to the star node [W/K] */
    double fac_forced, win_forced;            /* forced convection over sqrt(v) [W/(K.(m/s)^0.5)] */
    double fac_lw, win_lw, f_sky;             /* A*eps*sigma [W/K4], view factor to the sky */
    double sol_facade, sol_pane, sol_floor, sol_ceiling, sol_inner; /* absorbed sun over irradiance [m2] */
    double Q_rad_person, Q_con_person;        /* [W] */
    Controller con_co2, con_hea;
    double d_set, inv_d_set;                  /* CO2 set point above outdoors [ppm] */
    double m_out, inv_m_out;                  /* [kg/s] */
    double Q_max, inv_Q_scale;                /* largest heater power [W]; scale of its clamp's indicator [1/W] */
    double Q_coo;                             /* largest cooling power [W] */
    EffectFactors effect;
    int replay;
} Coef;

/* Discrete modes of the two limiters and the two clamps. */
typedef struct {
    int co2, hea, flow, heat, coo;
} Modes;

/* Distances from the limits, each relative to its scale: what modes and event indicators are made from. */
typedef struct {
    double co2_low, co2_high, hea_low, hea_high, flow_low, heat_low, coo_low, coo_high;
} Limits;

/* Compute coef from the parameters in r. On failure writes a sentence to message and returns nonzero. */
int model_prepare(Coef *coef, const double *r, int replay, char *message, size_t size);

/* Set the states in r to their initial values. */
void model_start(const Coef *coef, double *r);

/* Write derivatives, outputs and locals in r from states and inputs in r. */
void model_evaluate(const Coef *coef, const Modes *modes, double *r, Limits *limits);

/* Move modes to where limits say; returns nonzero if one changed. */
int model_update_modes(const Coef *coef, Modes *modes, const Limits *limits);

/* Event indicators z[N_EVENTS]. */
void model_indicators(const Modes *modes, const Limits *limits, double *z);

#endif
