/* Planar arm with two joints in the horizontal plane, driven by a torque at each. The declared model: viscous friction only. */
enum { STATES = 4, INPUTS = 2, PARAMETERS = 7 };

static const char GUID[] = "{5d6f2e0a-8c41-4b77-9a53-0d1f6b2c7e08}";
/* q_1, q_2 [rad], w_1, w_2 [rad/s]; tau_1, tau_2 [N.m]; l_1, a_2 [m], m_2 [kg], I_1, I_2 [kg.m2], b_1, b_2 [N.m.s/rad]. */
static const double START[] = {0, 0, 0, 0, 0, 0, 0.35, 0.16, 0.9, 0.12, 0.011, 0.25, 0.08};

static void rates(const double *x, const double *u, const double *p, double *dx);
#include "../model_exchange.h"

static void rates(const double *x, const double *u, const double *p, double *dx) {
    const double l_1 = p[0], a_2 = p[1], m_2 = p[2], I_1 = p[3], I_2 = p[4], b_1 = p[5], b_2 = p[6];
    const double w_1 = x[2], w_2 = x[3], coupling = m_2 * l_1 * a_2;
    /* I_1: first link about joint 1; I_2: second link about its center of mass, at a_2 from joint 2. */
    const double m_22 = I_2 + m_2 * a_2 * a_2, m_12 = m_22 + coupling * cos(x[1]);
    const double m_11 = I_1 + m_2 * l_1 * l_1 + m_22 + 2 * coupling * cos(x[1]);
    const double h = coupling * sin(x[1]), det = m_11 * m_22 - m_12 * m_12;
    const double f_1 = u[0] - b_1 * w_1 + h * (2 * w_1 + w_2) * w_2, f_2 = u[1] - b_2 * w_2 - h * w_1 * w_1;
    dx[0] = w_1;
    dx[1] = w_2;
    dx[2] = (m_22 * f_1 - m_12 * f_2) / det;
    dx[3] = (m_11 * f_2 - m_12 * f_1) / det;
}
