/* What the truth of the blind check has and the model has not. Every amplitude is zero by default. The forms differ on
 * purpose from those in effects.h. */
#ifndef TRUTH_H
#define TRUTH_H

#include <math.h>

#include "surfaces.h"
#include "variables.h"

/* Infiltration [kg/s]: cracks, dp ~ v^2 and dp ~ |dT|, both parts in quadrature (ASHRAE Fundamentals, chapter 16,
 * enhanced model). */
static inline double truth_infiltration(const double *r, double T_air, double T_out)
{
    const double n = r[V_truth_infiltration_n];
    const double v = r[V_winSpe] > 0.0 ? r[V_winSpe] : 0.0;
    const double wind = r[V_truth_infiltration_wind], stack = r[V_truth_infiltration_stack];
    if (wind == 0.0 && stack == 0.0) return 0.0;
    const double m_wind = wind * pow(v / 4.0, 2.0 * n);
    const double m_stack = stack * pow(smooth_abs(T_air - T_out) / 20.0, n);
    return sqrt(m_wind * m_wind + m_stack * m_stack);
}

/* Air through an open window [kg/s]: single-sided, buoyancy (orifice, Cd = 0.6) or wind, whichever is stronger
 * (BS 5925: Q = Cd A / 3 sqrt(dT g h / T), Q = 0.025 A v), joined smoothly. */
static inline double truth_window(const double *r, double T_air, double T_out)
{
    const double area = r[V_truth_window_A] * r[V_yWin];
    if (area == 0.0) return 0.0;
    const double v = r[V_winSpe] > 0.0 ? r[V_winSpe] : 0.0;
    const double q_stack = 0.6 / 3.0 * sqrt(9.81 * r[V_truth_window_h] * smooth_abs(T_air - T_out) / 290.0);
    const double q_wind = 0.025 * v;
    return r[V_rho_air] * area * sqrt(q_stack * q_stack + q_wind * q_wind);
}

/* Share of the ventilation air that mixes with the room air [1]. */
static inline double truth_mixing(const double *r)
{
    const double m = r[V_mOA];
    return 1.0 - r[V_truth_mixing_fra] * m / (m + r[V_truth_mixing_mHalf]);
}

/* Air exchange with the adjacent space [kg/s]. */
static inline double truth_door(const double *r)
{
    return r[V_truth_door_m] * r[V_yDoo];
}

/* What the valve makes of the controller's output [1]: nearly nothing below the dead band. */
static inline double truth_valve(const double *r, double y)
{
    const double dead = r[V_truth_heater_dead];
    return dead > 0.0 ? y * (1.0 - exp(-pow4(y / dead))) : y;
}

/* Share of the largest heater power that is there [1]: less when it is cold outdoors. */
static inline double truth_heater(const double *r)
{
    return 1.0 - r[V_truth_heater_cold] / (1.0 + exp((r[V_TDryBul] - 278.15) / 2.5));
}

/* Heater power that leaks [W]: the supply is hotter when it is cold outdoors. */
static inline double truth_leak(const double *r)
{
    const double d = 293.15 - r[V_TDryBul];
    return d > 0.0 ? r[V_truth_valve_Q] * d / 20.0 : 0.0;
}

/* Heat to the room air [W] from furniture, thermal bridge, partition and door. */
static inline double truth_heat(const double *r, double T_air, double cp)
{
    return r[V_truth_furniture_C] * r[V_truth_furniture_fra] * (r[V_truth_furniture_TSur] - T_air)
               / r[V_truth_furniture_tauSur]
           + 2.0 * r[V_truth_bridge_UA] * (r[V_truth_bridge_T] - T_air)
           + (r[V_truth_adjacent_UA] + truth_door(r) * cp) * (r[V_TAdj] - T_air);
}

/* Derivatives of the truth's own states [K/s]. */
static inline void truth_derivatives(double *r, double T_air, double T_out)
{
    const double T_sur = r[V_truth_furniture_TSur], T_cor = r[V_truth_furniture_TCor], f = r[V_truth_furniture_fra];
    const double inward = (T_sur - T_cor) / r[V_truth_furniture_tauCor];
    r[D_truth_furniture_TSur] = (T_air - T_sur) / r[V_truth_furniture_tauSur] - inward * (1.0 - f) / f;
    r[D_truth_furniture_TCor] = inward;
    r[D_truth_bridge_T] = (T_air + T_out - 2.0 * r[V_truth_bridge_T]) / r[V_truth_bridge_tau];
}

#endif
