/* Two tanks in a cascade: a pump fills the upper one, which drains into the lower one, which drains into the sump. */
enum { STATES = 2, INPUTS = 3, PARAMETERS = 6 };

static const char GUID[] = "{0b9e4c16-27d3-4f58-8e0a-6a41c5b9d209}";
/* h_1, h_2 [m]; u [V], q_1, q_2 [m3/s]; A_1, A_2, s_1, s_2 [m2], k [m3/(s.V)], g [m/s2]. */
static const double START[] = {0.1, 0.1, 0, 0, 0, 0.012, 0.010, 5e-5, 5.5e-5, 2.4e-5, 9.81};

static void rates(const double *x, const double *u, const double *p, double *dx);
#include "../model_exchange.h"

static double outflow(double area, double g, double level) { return level > 0 ? area * sqrt(2 * g * level) : 0; }

static void rates(const double *x, const double *u, const double *p, double *dx) {
    const double between = outflow(p[2], p[5], x[0]);
    /* q_1 and q_2 are flows that leave the tanks on ways which the model does not know. */
    dx[0] = (p[4] * u[0] - between - u[1]) / p[0];
    dx[1] = (between - outflow(p[3], p[5], x[1]) - u[2]) / p[1];
}
