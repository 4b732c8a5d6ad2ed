/* From parameters to coefficients: checks, areas, capacities. EQUATIONS.md sections 1 to 5. */
#include <math.h>
#include <stdio.h>

#include "model.h"
#include "surfaces.h"

#define MOLAR_MASS_AIR 28.9647e-3 /* [kg/mol] */
#define MOLAR_MASS_CO2 44.0095e-3 /* [kg/mol] */

#define FAIL(...) return snprintf(message, size, __VA_ARGS__), -1

/* Every real parameter is finite and within the limits of the variables table. */
static int check_limits(const double *r, char *message, size_t size)
{
    for (int i = 0; i < N_LIMITS; i++) {
        const VariableLimit *lim = &VARIABLE_LIMITS[i];
        const double v = r[lim->vr];
        const char *name = VARIABLE_NAMES[lim->vr];
        if (!isfinite(v)) FAIL("%s = %g is not a finite number.", name, v);
        if (v < lim->low || (lim->low_open && v == lim->low)) {
            FAIL("%s = %g must be %s %g.", name, v, lim->low_open ? "greater than" : "at least", lim->low);
        }
        if (v > lim->high || (lim->high_open && v == lim->high)) {
            FAIL("%s = %g must be %s %g.", name, v, lim->high_open ? "less than" : "at most", lim->high);
        }
    }
    return 0;
}

static int prepare_wall(Wall *wall, const char *name, double A, const double *C, const double *R, double R_total,
                        char *message, size_t size)
{
    const int status = wall_prepare(wall, A, C, R, R_total);
    if (status < 0) FAIL("%s.layer[*].R: the layers have no thermal resistance.", name);
    if (status > 0) {
        FAIL("%s.layer[*].C: node %d of %d has no heat capacity; give capacity to the layers near it.", name, status,
             N_NODES);
    }
    return 0;
}

static int prepare_walls(Coef *c, const double *r, char *message, size_t size)
{
    const double A_flo = r[V_roo_AFlo], h_roo = r[V_roo_hRoo];
    const double A_facade = sqrt(A_flo) * h_roo;
    c->A_win = r[V_fraWin] * A_facade;
    if (prepare_wall(&c->facade, "facade", A_facade - c->A_win, r + V_facade_layer_C, r + V_facade_layer_R,
                     r[V_matExtWal_R], message, size)
        || prepare_wall(&c->floor, "floor", A_flo, r + V_floor_layer_C, r + V_floor_layer_R, 0.0, message, size)
        || prepare_wall(&c->ceiling, "ceiling", A_flo, r + V_ceiling_layer_C, r + V_ceiling_layer_R, 0.0, message,
                        size)
        || prepare_wall(&c->inner, "innWal", 3.0 * A_facade, r + V_innWal_layer_C, r + V_innWal_layer_R, 0.0, message,
                        size)) {
        return -1;
    }
    return 0;
}

static int prepare_window(Coef *c, const double *r, char *message, size_t size)
{
    const double U = r[V_glaSys_UFra];
    const double R_panes = 1.0 / U - r[V_win_RFilOut] - r[V_win_RFilIn];
    if (!(R_panes > 0.0)) {
        FAIL("glaSys.UFra = %g W/(m2.K) leaves no resistance between the panes: 1/U must exceed the standard films "
             "win.RFilOut + win.RFilIn = %g m2.K/W.",
             U, r[V_win_RFilOut] + r[V_win_RFilIn]);
    }
    c->G_win = c->A_win / R_panes;
    c->C_pane = r[V_win_C] * c->A_win;
    c->inv_C_pane = 1.0 / c->C_pane;
    return 0;
}

static int prepare_sun(Coef *c, const double *r, char *message, size_t size)
{
    const double absorbed = r[V_glaSys_absSolFra], reflected = r[V_win_refSol];
    if (absorbed + reflected > 1.0) {
        FAIL("glaSys.absSolFra = %g and win.refSol = %g add up to more than 1.", absorbed, reflected);
    }
    const double sun = c->effect.sun;
    const double transmitted = sun * (1.0 - absorbed - reflected) * c->A_win;
    const double rest = (1.0 - r[V_fraSolFlo]) * transmitted / (c->ceiling.A + c->inner.A);
    c->sol_facade = sun * r[V_facade_absSol] * c->facade.A;
    c->sol_pane = sun * 0.5 * absorbed * c->A_win;
    c->sol_floor = r[V_fraSolFlo] * transmitted;
    c->sol_ceiling = rest * c->ceiling.A;
    c->sol_inner = rest * c->inner.A;
    return 0;
}

static void prepare_surfaces(Coef *c, const double *r)
{
    const double T0 = r[V_inside_T0];
    const double h_lw = 4.0 * r[V_inside_eps] * SIGMA * T0 * T0 * T0;
    c->gr_facade = h_lw * c->facade.A;
    c->gr_win = h_lw * c->A_win;
    c->gr_floor = h_lw * c->floor.A;
    c->gr_ceiling = h_lw * c->ceiling.A;
    c->gr_inner = h_lw * c->inner.A;
    c->inv_gr = 1.0 / (c->gr_facade + c->gr_win + c->gr_floor + c->gr_ceiling + c->gr_inner);

    /* wall and window are parts of one facade, whose perimeter and area count */
    const double s = sqrt(r[V_roo_AFlo]), h = r[V_roo_hRoo];
    const double forced = C_FORCED * r[V_outside_wind] * sqrt(2.0 * (s + h) / (s * h));
    c->fac_forced = forced * r[V_facade_roughness] * c->facade.A;
    c->win_forced = forced * r[V_win_roughness] * c->A_win;
    c->fac_lw = r[V_facade_eps] * SIGMA * c->facade.A;
    c->win_lw = r[V_win_eps] * SIGMA * c->A_win;
    c->f_sky = r[V_outside_fraSky];
}

static int prepare_air(Coef *c, const double *r, char *message, size_t size)
{
    c->m_air = r[V_rho_air] * r[V_roo_V];
    c->inv_m_air = 1.0 / c->m_air;
    c->cp = r[V_cp_air];
    c->C_air = c->m_air * c->cp + c->effect.C_air;
    if (!(c->C_air > 0.0)) FAIL("effect.furniture.C = %g J/K leaves the air without heat capacity.", c->effect.C_air);
    c->inv_C_air = 1.0 / c->C_air;
    c->X_per_ppm = 1e-6 * MOLAR_MASS_CO2 / MOLAR_MASS_AIR;
    c->ppm_per_X = 1.0 / c->X_per_ppm;
    if (r[V_people_fraRad] + r[V_people_fraCon] > 1.0) {
        FAIL("people.fraRad = %g and people.fraCon = %g add up to more than 1.", r[V_people_fraRad], r[V_people_fraCon]);
    }
    c->Q_rad_person = r[V_people_Q] * r[V_people_fraRad];
    c->Q_con_person = r[V_people_Q] * r[V_people_fraCon];
    return 0;
}

static void prepare_controls(Coef *c, const double *r, int replay)
{
    c->con_co2 = (Controller){r[V_conCO2_k], 1.0 / r[V_conCO2_Ti], 1.0 / (r[V_conCO2_k] * r[V_conCO2_Ni]),
                              r[V_conCO2_yMax]};
    c->con_hea = (Controller){r[V_conHea_k], 1.0 / r[V_conHea_Ti], 1.0 / (r[V_conHea_k] * r[V_conHea_Ni]), 1.0};
    c->d_set = r[V_conCO2_dSet];
    c->inv_d_set = 1.0 / c->d_set;
    c->m_out = r[V_mOut_flow];
    c->inv_m_out = 1.0 / c->m_out;
    c->Q_max = r[V_QHea_max] * c->effect.heater;
    c->inv_Q_scale = 1.0 / r[V_QHea_max];
    c->Q_coo = r[V_QCoo_max];
    c->replay = replay;
}

int model_prepare(Coef *c, const double *r, int replay, char *message, size_t size)
{
    if (check_limits(r, message, size)) return -1;
    effect_factors(r, &c->effect);
    if (prepare_walls(c, r, message, size) || prepare_window(c, r, message, size) || prepare_sun(c, r, message, size)
        || prepare_air(c, r, message, size)) {
        return -1;
    }
    prepare_surfaces(c, r);
    prepare_controls(c, r, replay);
    return 0;
}
