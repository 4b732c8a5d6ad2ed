#include "model.h"

#include "surfaces.h"

void model_start(const Coef *c, double *r)
{
    r[V_air_T] = r[V_T_start];
    r[V_air_X] = r[V_CO2_start] * c->X_per_ppm;
    for (int j = 0; j < N_NODES; j++) {
        r[V_facade_T + j] = r[V_floor_T + j] = r[V_ceiling_T + j] = r[V_innWal_T + j] = r[V_T_start];
    }
    r[V_win_TOut] = r[V_win_TIn] = r[V_T_start];
    r[V_conCO2_xI] = r[V_conHea_xI] = 0.0;
}

/* Outdoor CO2, heating and cooling loops: writes yCO2, yHea, mOA, QHea, the integrators' derivatives, the limits. */
static void controls(const Coef *c, const Modes *m, double *r, Limits *lim)
{
    double m_request, Q_request, Q_cooling = 0.0, Q_low = 0.0;
    lim->coo_low = lim->coo_high = 1.0;
    if (c->replay) {
        Q_low = 0.0 - c->Q_coo;
        m_request = r[V_mOA_in];
        Q_request = r[V_QHea_in];
        r[V_yCO2] = r[V_yHea] = 0.0;
        r[D_conCO2_xI] = r[D_conHea_xI] = 0.0;
        lim->co2_low = lim->co2_high = lim->hea_low = lim->hea_high = 1.0;
    } else {
        const double e_co2 = (r[V_CO2] - r[V_CO2Out] - c->d_set) * c->inv_d_set;
        const double u_co2 = c->con_co2.k * (e_co2 + r[V_conCO2_xI]);
        const double y_co2 = limited(m->co2, u_co2, c->con_co2.y_max);
        const double e_hea = r[V_TSet] - r[V_air_T];
        const double u_hea = c->con_hea.k * (e_hea + r[V_conHea_xI]);
        const double y_hea = limited(m->hea, u_hea, c->con_hea.y_max);

        m_request = c->m_out * (1.0 + y_co2) + r[V_excOut];
        Q_request = c->Q_max * y_hea + r[V_excHea];
        r[V_yCO2] = y_co2;
        r[V_yHea] = y_hea;
        r[D_conCO2_xI] = integrator_derivative(&c->con_co2, e_co2, u_co2, y_co2);
        r[D_conHea_xI] = integrator_derivative(&c->con_hea, e_hea, u_hea, y_hea);
        lim->co2_low = u_co2;
        lim->co2_high = c->con_co2.y_max - u_co2;
        lim->hea_low = u_hea;
        lim->hea_high = c->con_hea.y_max - u_hea;
        if (c->Q_coo > 0.0) { /* no events of a cooler that is not there */
            const double u_coo = r[V_conCoo_k] * (r[V_air_T] - r[V_TSet] - r[V_conCoo_dSet]);
            Q_cooling = c->Q_coo * limited(m->coo, u_coo, 1.0);
            lim->coo_low = u_coo;
            lim->coo_high = 1.0 - u_coo;
        }
    }
    r[V_mOA] = m->flow == MODE_LOW ? 0.0 : effect_fan(r) * m_request;
    r[V_QHea] = (m->heat == MODE_LOW ? Q_low : Q_request) + (c->replay ? 0.0 : r[V_effect_valve_Q]) - Q_cooling;
    lim->flow_low = m_request * c->inv_m_out;
    lim->heat_low = (Q_request - Q_low) * c->inv_Q_scale;
}

void model_evaluate(const Coef *c, const Modes *m, double *r, Limits *lim)
{
    const double T_air = r[V_air_T], X = r[V_air_X], T_out = r[V_TDryBul];
    const double *T_fac = r + V_facade_T, *T_flo = r + V_floor_T, *T_cei = r + V_ceiling_T, *T_inn = r + V_innWal_T;
    const double T_po = r[V_win_TOut], T_pi = r[V_win_TIn];
    const double n_per = r[V_nPer];
    enum { LAST = N_NODES - 1 };

    r[V_TRoo] = T_air;
    r[V_CO2] = X * c->ppm_per_X;
    controls(c, m, r, lim);

    /* inside convection, positive from surface to air [W] */
    const double d_fac = T_fac[LAST] - T_air, d_win = T_pi - T_air, d_flo = T_flo[LAST] - T_air;
    const double d_cei = T_cei[LAST] - T_air, d_inn = T_inn[LAST] - T_air;
    const double qc_fac = c->facade.A * h_vertical(d_fac) * d_fac;
    const double qc_win = c->A_win * h_vertical(d_win) * d_win;
    const double qc_flo = c->floor.A * h_horizontal(d_flo, 1.0) * d_flo;
    const double qc_cei = c->ceiling.A * h_horizontal(d_cei, -1.0) * d_cei;
    const double qc_inn = c->inner.A * h_vertical(d_inn) * d_inn;

    /* long-wave exchange over the mean radiant node, which also takes the radiant gains [W] */
    const double Q_rad = c->Q_rad_person * n_per + r[V_fraRadHea] * r[V_QHea];
    const double T_mrt = (c->gr_facade * T_fac[LAST] + c->gr_win * T_pi + c->gr_floor * T_flo[LAST]
                          + c->gr_ceiling * T_cei[LAST] + c->gr_inner * T_inn[LAST] + Q_rad) * c->inv_gr;
    const double qr_fac = c->gr_facade * (T_fac[LAST] - T_mrt);
    const double qr_win = c->gr_win * (T_pi - T_mrt);
    const double qr_flo = c->gr_floor * (T_flo[LAST] - T_mrt);
    const double qr_cei = c->gr_ceiling * (T_cei[LAST] - T_mrt);
    const double qr_inn = c->gr_inner * (T_inn[LAST] - T_mrt);

    /* outside, positive into the surface [W] */
    const double v_root = sqrt_wind(r[V_winSpe]);
    const double d_fo = T_out - T_fac[0], d_po = T_out - T_po;
    const double T4_env = c->f_sky * pow4(r[V_TSky]) + (1.0 - c->f_sky) * pow4(T_out);
    const double Q_fac_out = (c->facade.A * h_vertical(d_fo) + c->fac_forced * v_root) * d_fo
                             + c->fac_lw * (T4_env - pow4(T_fac[0]));
    const double Q_win_out = (c->A_win * h_vertical(d_po) + c->win_forced * v_root) * d_po
                             + c->win_lw * (T4_env - pow4(T_po));

    /* sun: the factor of constant shading is already in the coefficients */
    const double H = r[V_HFac] * effect_blinds(r);
    const double sol_pane = c->sol_pane * H;

    /* walls and panes */
    wall_derivative(&c->facade, T_fac, Q_fac_out + c->sol_facade * H, -qc_fac - qr_fac, r + D_facade_T);
    wall_derivative(&c->floor, T_flo, 0.0, c->sol_floor * H - qc_flo - qr_flo, r + D_floor_T);
    wall_derivative(&c->ceiling, T_cei, 0.0, c->sol_ceiling * H - qc_cei - qr_cei, r + D_ceiling_T);
    wall_derivative(&c->inner, T_inn, 0.0, c->sol_inner * H - qc_inn - qr_inn, r + D_innWal_T);
    const double Q_pane = c->G_win * (T_po - T_pi);
    r[D_win_TOut] = (Q_win_out + sol_pane - Q_pane) * c->inv_C_pane;
    r[D_win_TIn] = (Q_pane + sol_pane - qc_win - qr_win) * c->inv_C_pane;

    /* air */
    const double m_ven = c->effect.mixing * r[V_mOA];
    const double m_inf = effect_infiltration(r, T_air, T_out) + effect_window(r, T_air, T_out);
    const double Q_ven = m_ven * c->cp * (T_out - T_air);
    const double Q_inf = m_inf * c->cp * (T_out - T_air);
    const double Q_eff = effect_heat(r, T_air, T_out);
    const double qc_mass = qc_flo + qc_cei + qc_inn;
    const double Q_con = c->Q_con_person * n_per + (1.0 - r[V_fraRadHea]) * r[V_QHea];
    r[D_air_T] = (qc_fac + qc_win + qc_mass + Q_ven + Q_inf + Q_eff + Q_con) * c->inv_C_air;
    r[D_air_X] = ((m_ven + m_inf) * (r[V_CO2Out] * c->X_per_ppm - X) + r[V_gaiCO2_k] * n_per) * c->inv_m_air;

    /* what is left to report */
    r[V_TMRT] = T_mrt;
    r[V_mInf] = m_inf;
    r[V_QFacOut] = Q_fac_out;
    r[V_QWinOut] = Q_win_out;
    r[V_QSolFac] = c->sol_facade * H;
    r[V_QSolWin] = 2.0 * sol_pane;
    r[V_QSolTra] = (c->sol_floor + c->sol_ceiling + c->sol_inner) * H;
    r[V_QFacRoo] = qc_fac + qr_fac;
    r[V_QWinRoo] = qc_win + qr_win;
    r[V_QMasAir] = qc_mass;
    r[V_QVen] = Q_ven;
    r[V_QInf] = Q_inf;
    r[V_QEff] = Q_eff;
    r[V_QPeo] = (c->Q_con_person + c->Q_rad_person) * n_per;
    r[V_UStored] = c->C_air * (T_air - 273.15) + c->C_pane * (T_po - 273.15 + T_pi - 273.15)
                   + wall_heat(&c->facade, T_fac) + wall_heat(&c->floor, T_flo)
                   + wall_heat(&c->ceiling, T_cei) + wall_heat(&c->inner, T_inn);
}

int model_update_modes(const Coef *c, Modes *m, const Limits *lim)
{
    Modes n = *m;
    if (!c->replay) {
        n.co2 = next_mode(m->co2, lim->co2_low, lim->co2_high);
        n.hea = next_mode(m->hea, lim->hea_low, lim->hea_high);
        n.coo = next_mode(m->coo, lim->coo_low, lim->coo_high);
    }
    n.flow = next_mode(m->flow, lim->flow_low, 1.0);
    n.heat = next_mode(m->heat, lim->heat_low, 1.0);
    const int changed = n.co2 != m->co2 || n.hea != m->hea || n.flow != m->flow || n.heat != m->heat
                        || n.coo != m->coo;
    *m = n;
    return changed;
}

void model_indicators(const Modes *m, const Limits *lim, double *z)
{
    z[0] = indicator_low(m->co2, lim->co2_low);
    z[1] = indicator_high(m->co2, lim->co2_high);
    z[2] = indicator_low(m->hea, lim->hea_low);
    z[3] = indicator_high(m->hea, lim->hea_high);
    z[4] = indicator_low(m->flow, lim->flow_low);
    z[5] = indicator_low(m->heat, lim->heat_low);
    z[6] = indicator_low(m->coo, lim->coo_low);
    z[7] = indicator_high(m->coo, lim->coo_high);
}
