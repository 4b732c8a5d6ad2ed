#include "walls.h"

/* Integral of the hat function (1 - |t|) from -1 to t, for t in [-1, 1]; constant outside. */
static double hat_integral(double t)
{
    if (t <= -1.0) return 0.0;
    if (t >= 1.0) return 1.0;
    return t < 0.0 ? 0.5 * (1.0 + t) * (1.0 + t) : 1.0 - 0.5 * (1.0 - t) * (1.0 - t);
}

static double hat(double t)
{
    if (t <= -1.0 || t >= 1.0) return 0.0;
    return t < 0.0 ? 1.0 + t : 1.0 - t;
}

int wall_prepare(Wall *wall, double A, const double *layer_C, const double *layer_R, double R_total)
{
    const double n = N_NODES - 1; /* elements */
    double R_sum = 0.0;
    for (int i = 0; i < N_LAYERS; i++) {
        R_sum += layer_R[i];
    }
    if (!(R_sum > 0.0)) return -1;

    wall->A = A;
    wall->G = n * A / (R_total > 0.0 ? R_total : R_sum);
    for (int j = 0; j < N_NODES; j++) {
        double C = 0.0, R_before = 0.0;
        for (int i = 0; i < N_LAYERS; i++) {
            const double ta = R_before / R_sum * n - j;
            R_before += layer_R[i];
            const double tb = R_before / R_sum * n - j;
            /* a layer without resistance sits at one point; ta == tb also when its share is lost in rounding */
            C += layer_C[i] * (tb > ta ? (hat_integral(tb) - hat_integral(ta)) / (tb - ta) : hat(ta));
        }
        if (!(C > 0.0)) return j + 1;
        wall->C[j] = C * A;
        wall->invC[j] = 1.0 / wall->C[j];
    }
    return 0;
}
