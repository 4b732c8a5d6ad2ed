/* Opaque walls: one-dimensional conduction through N_NODES nodes, lumped linear finite elements in the
 * resistance coordinate x (0 outside or far side, 1 room side). EQUATIONS.md section 3. */
#ifndef WALLS_H
#define WALLS_H

#include "variables.h"

typedef struct {
    double A;                /* area [m2] */
    double G;                /* conductance between neighbouring nodes [W/K] */
    double C[N_NODES];       /* node heat capacities [J/K] */
    double invC[N_NODES];    /* their reciprocals [K/J] */
} Wall;

/* Spread layers (areal capacities C [J/(m2.K)], resistances R [m2.K/W], far side first) over the nodes.
 * R_total [m2.K/W] replaces the sum of R when positive. Returns 0, or -1 if the layers have no resistance,
 * or j + 1 if node j has no capacity. */
int wall_prepare(Wall *wall, double A, const double *layer_C, const double *layer_R, double R_total);

/* Derivatives of the node temperatures [K/s] from heat flows [W] into the first and the last node. */
static inline void wall_derivative(const Wall *wall, const double *T, double Q_first, double Q_last, double *dT)
{
    double Q_in = Q_first;
    for (int j = 0; j < N_NODES - 1; j++) {
        const double Q_out = wall->G * (T[j] - T[j + 1]);
        dT[j] = (Q_in - Q_out) * wall->invC[j];
        Q_in = Q_out;
    }
    dT[N_NODES - 1] = (Q_in + Q_last) * wall->invC[N_NODES - 1];
}

/* Heat stored in the nodes above 273.15 K [J]. */
static inline double wall_heat(const Wall *wall, const double *T)
{
    double U = 0.0;
    for (int j = 0; j < N_NODES; j++) {
        U += wall->C[j] * (T[j] - 273.15);
    }
    return U;
}

#endif
