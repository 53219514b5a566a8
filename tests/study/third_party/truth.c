/* What really happens: the six systems with effects at their ports, by Runge-Kutta steps much finer than the records.
 * Typed apart from the equations of the FMUs (other coordinates, other order of solution) and called by truth.py.
 *
 * An effect acts at a port of its system. At a force, torque or flow it takes `term(v, x, t)` from what acts there; at a
 * command it changes the command before it reaches the plant, in the order of the list. Kinds: see the enum.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    VISCOUS, COULOMB, STRIBECK, SPRING, ENDSTOP, COGGING, QUADDRAG, OFFSET, ASYMMETRY, POSCOULOMB, LEAKAGE, OVERFLOW_, LOADFRICTION,
    CUBIC = 20, BUMP, SPEEDBUMP, PRODUCT, WANDER, POWER, TEETH, CROSS, HEAT, STEPCHANGE,
    GAIN = 40, COMMAND_OFFSET, DEADBAND, SATURATION, PLAY, DELAY, LAG, MODE, RATELIMIT, DROOP, ASYMLAG,
    KINK = 60, COMMAND_CUBIC, COMMAND_WANDER, COMMAND_BUMP, HEATGAIN
};
enum { MAX_STATES = 8, MAX_INPUTS = 2, MAX_EFFECTS = 16, MAX_DELAY = 100000 };

typedef struct {
    int kind, port;
    double q[6];
} Effect;

typedef struct {
    const double *p;
    const Effect *effects;
    int count;
    /* Memory of an effect on a command, and of a friction. */
    double memory[MAX_EFFECTS][2];
    double t;
    const double *x;
} Plant;

static double sign_of(double v, double vt) { return tanh(v / vt); }

/* Force, torque or flow that is left of `value` at `port`; v: velocity, x: position or level there, other: a variable of
 * the system elsewhere. */
static double at_port(const Plant *plant, int port, double value, double v, double x, double other) {
    int k;
    double taken = 0.0;
    for (k = 0; k < plant->count; ++k) {
        const double *q = plant->effects[k].q;
        if (plant->effects[k].port != port) continue;
        switch (plant->effects[k].kind) {
        case VISCOUS: taken += q[0] * v; break;
        case COULOMB: taken += q[0] * sign_of(v, q[1]); break;
        case STRIBECK: taken += q[0] * exp(-(v / q[1]) * (v / q[1])) * sign_of(v, q[2]); break;
        case SPRING: taken += q[0] * (x - q[1]); break;
        case ENDSTOP: if (x > q[2]) taken += fmax(0.0, q[0] * (x - q[2]) + q[1] * v); break;
        case COGGING: taken += q[0] * sin(2.0 * M_PI * x / q[1] + q[2]); break;
        case QUADDRAG: taken += q[0] * fabs(v) * v; break;
        case OFFSET: taken += q[0]; break;
        case ASYMMETRY: if (v > 0.0) taken += q[0] * sign_of(v, q[1]); break;
        case POSCOULOMB: taken += q[0] * x * sign_of(v, q[1]); break;
        case LEAKAGE: taken += q[0] * sqrt(fmax(x, 0.0)); break;
        case OVERFLOW_: taken += q[0] * fmax(0.0, x - q[1]); break;
        case LOADFRICTION: taken += q[0] * fabs(value) * sign_of(v, q[1]); break;
        case CUBIC: taken += q[0] * x * x * x; break;
        case BUMP: taken += q[0] * exp(-((x - q[1]) / q[2]) * ((x - q[1]) / q[2])); break;
        case SPEEDBUMP: taken += q[0] * exp(-((v - q[1]) / q[2]) * ((v - q[1]) / q[2])); break;
        case PRODUCT: taken += q[0] * (x - q[1]) * v; break;
        case WANDER: taken += q[0] * sin(2.0 * M_PI * q[1] * plant->t + q[2]); break;
        case POWER: taken += q[0] * copysign(pow(fabs(v), q[1]), v); break;
        case TEETH: taken += q[0] * pow(sin(2.0 * M_PI * x / q[1] + q[2]), 3.0); break;
        case CROSS: taken += q[0] * tanh(other / q[1]); break;
        case HEAT: taken += q[0] * (other - q[1]) * sign_of(v, q[2]); break;
        case STEPCHANGE: if (plant->t > q[1]) taken += q[0]; break;
        default: break;
        }
    }
    return value - taken;
}

/* Command that reaches the plant for the one that was sent, over the fine step `h`. `sent`: its past, newest at `now`. */
static double command(Plant *plant, int port, const double *sent, long now, double h) {
    double u = sent[now];
    int k;
    for (k = 0; k < plant->count; ++k) {
        const double *q = plant->effects[k].q;
        double *m = plant->memory[k];
        if (plant->effects[k].port != port) continue;
        switch (plant->effects[k].kind) {
        case GAIN: u *= 1.0 + q[0]; break;
        case COMMAND_OFFSET: u += q[0]; break;
        case DEADBAND: u -= fmin(fmax(u, -q[0]), q[0]); break;
        case SATURATION: u = fmin(fmax(u, -q[0]), q[0]); break;
        case PLAY: m[0] = fmin(fmax(m[0], u - q[0]), u + q[0]); u = m[0]; break;
        case DELAY: {
            long back = lround(q[0] / h);
            u = sent[now > back ? now - back : 0];
            break;
        }
        case LAG: m[0] += (u - m[0]) * (1.0 - exp(-h / q[0])); u = m[0]; break;
        case ASYMLAG: m[0] += (u - m[0]) * (1.0 - exp(-h / (u > m[0] ? q[0] : q[1]))); u = m[0]; break;
        case MODE: {
            double w = 2.0 * M_PI * q[0];
            int j;
            for (j = 0; j < 8; ++j) {
                m[1] += h / 8.0 * (w * w * (u - m[0]) - 2.0 * q[1] * w * m[1]);
                m[0] += h / 8.0 * m[1];
            }
            u = m[0];
            break;
        }
        case RATELIMIT: m[0] += fmin(fmax(u - m[0], -q[0] * h), q[0] * h); u = m[0]; break;
        case DROOP: u *= 1.0 - q[0] * (1.0 - exp(-plant->t / q[1])); break;
        case KINK: u += q[0] * fmax(0.0, u - q[1]); break;
        case COMMAND_CUBIC: u += q[0] * u * u * u; break;
        case COMMAND_WANDER: u *= 1.0 + q[0] * sin(2.0 * M_PI * q[1] * plant->t + q[2]); break;
        case COMMAND_BUMP: u += q[0] * exp(-((u - q[1]) / q[2]) * ((u - q[1]) / q[2])); break;
        case HEATGAIN: u *= 1.0 - q[0] * (plant->x[3] - q[1]); break;
        default: break;
        }
    }
    return u;
}

/* x: phi_m w_m phi_l w_l; p: J_m J_l k d b_m b_l tau_c w_c; ports: 0 tau_m, 1 tau_l */
static void servo(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double motor = at_port(s, 0, u[0], x[1], x[0], x[3]) - p[4] * x[1] - p[6] * tanh(x[1] / p[7]);
    double load = at_port(s, 1, 0.0, x[3], x[2], x[1]) - p[5] * x[3];
    double twist = x[0] - x[2], rate = x[1] - x[3];
    dx[0] = x[1];
    dx[1] = (motor - p[2] * twist - p[3] * rate) / p[0];
    dx[2] = x[3];
    dx[3] = (load + p[2] * twist + p[3] * rate) / p[1];
}

/* x: q_1 q_2 w_1 w_2; p: m_1 m_2 l_1 a_1 a_2 I_1 I_2 b_1 b_2 g; ports: 0 tau_1, 1 tau_2. In absolute angles of the links. */
static void arm(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double one = at_port(s, 0, u[0], x[2], x[0], x[3]) - p[7] * x[2];
    double two = at_port(s, 1, u[1], x[3], x[1], x[2]) - p[8] * x[3];
    double th1 = x[0], th2 = x[0] + x[1], v1 = x[2], v2 = x[2] + x[3];
    double a11 = p[5] + p[0] * p[3] * p[3] + p[1] * p[2] * p[2], a22 = p[6] + p[1] * p[4] * p[4];
    double b = p[1] * p[2] * p[4], c = cos(th2 - th1), sn = sin(th2 - th1);
    double f1 = one - two + b * sn * v2 * v2 - (p[0] * p[3] + p[1] * p[2]) * p[9] * sin(th1);
    double f2 = two - b * sn * v1 * v1 - p[1] * p[4] * p[9] * sin(th2);
    double acc2 = (f2 - b * c * f1 / a11) / (a22 - b * b * c * c / a11);
    double acc1 = (f1 - b * c * acc2) / a11;
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = acc1;
    dx[3] = acc2 - acc1;
}

/* x: h_1 h_2; p: A_1 A_2 s_1 s_2 k_p g; ports: 0 u, 1 q_1, 2 q_2 */
static void tanks(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double upper = x[0] > 0.0 ? x[0] : 0.0, lower = x[1] > 0.0 ? x[1] : 0.0;
    double fall = p[2] * sqrt(2.0 * p[5]) * sqrt(upper);
    dx[0] = (at_port(s, 1, 0.0, 0.0, x[0], x[1]) + p[4] * u[0] - fall) / p[0];
    dx[1] = (at_port(s, 2, 0.0, 0.0, x[1], x[0]) + fall - p[3] * sqrt(2.0 * p[5]) * sqrt(lower)) / p[1];
}

/* x: phi w i T; p: R L K J b tau_c w_c alpha C_th R_th T_a; ports: 0 V, 1 tau_load */
static void motor(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double ohm = p[0] + p[0] * p[7] * (x[3] - p[10]);
    double voltage = at_port(s, 0, u[0], x[2], 0.0, x[3]);
    double torque = at_port(s, 1, p[2] * x[2], x[1], x[0], x[3]) - p[4] * x[1] - p[5] * tanh(x[1] / p[6]);
    dx[0] = x[1];
    dx[1] = torque / p[3];
    dx[2] = (voltage - p[2] * x[1] - ohm * x[2]) / p[1];
    dx[3] = ohm * x[2] * x[2] / p[8] - (x[3] - p[10]) / (p[9] * p[8]);
}

static double orifice(double drop) { return drop / sqrt(fabs(drop) + 1000.0); }

/* x: x v p_A p_B; p: m b k A_A A_B V_A V_B E q_n u_n p_n p_s p_t c_i; ports: 0 u, 1 F_ext, 2 leak from A to B */
static void cylinder(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double scale = p[8] / p[9] / sqrt(p[10]), open = u[0] * scale, in, out;
    double force = at_port(s, 1, p[3] * x[2] - p[4] * x[3], x[1], x[0], x[2]) - p[1] * x[1] - p[2] * x[0];
    double through = p[13] * (x[2] - x[3]) - at_port(s, 2, 0.0, x[2] - x[3], x[0], x[1]);
    if (u[0] > 0.0) {
        in = open * orifice(p[11] - x[2]);
        out = open * orifice(x[3] - p[12]);
    } else {
        in = open * orifice(x[2] - p[12]);
        out = open * orifice(p[11] - x[3]);
    }
    dx[0] = x[1];
    dx[1] = force / p[0];
    dx[2] = p[7] / (p[5] + p[3] * x[0]) * (in - through - p[3] * x[1]);
    dx[3] = p[7] / (p[6] - p[4] * x[0]) * (through - out + p[4] * x[1]);
}

/* x: theta w_theta alpha w_alpha; p: J_a r b_a k_a m l J_p b_p g; ports: 0 tau, 1 tau_p. Solved for the pendulum first. */
static void furuta(const Plant *s, const double *u, const double *x, double *dx) {
    const double *p = s->p;
    double sa = sin(x[2]), ca = cos(x[2]), moment = p[4] * p[5], about = p[6] + moment * p[5];
    double arm_torque = at_port(s, 0, u[0], x[1], x[0], x[3]) - p[2] * x[1] - p[3] * x[0];
    double own_torque = at_port(s, 1, 0.0, x[3], x[2], x[1]) - p[7] * x[3] - moment * p[8] * sa;
    double f1 = arm_torque + moment * p[1] * sa * x[3] * x[3] - about * sin(2.0 * x[2]) * x[3] * x[1];
    double f2 = own_torque + 0.5 * about * sin(2.0 * x[2]) * x[1] * x[1];
    double m11 = p[0] + p[4] * p[1] * p[1] + about * sa * sa, m12 = moment * p[1] * ca;
    double acc = (f2 - m12 / m11 * f1) / (about - m12 * m12 / m11);
    dx[0] = x[1];
    dx[1] = (f1 - m12 * acc) / m11;
    dx[2] = x[3];
    dx[3] = acc;
}

typedef void (*Rates)(const Plant *, const double *, const double *, double *);
static const Rates SYSTEMS[] = {servo, arm, tanks, motor, cylinder, furuta};
static const int STATES[] = {4, 4, 2, 4, 4, 4}, INPUTS[] = {1, 2, 1, 1, 1, 1};

/* Simulates n samples at `step`, `inner` Runge-Kutta steps each. `sent`, [n][inputs]: commands, held over each sample; with a
 * `gain` of feedback the first one gets gain times (its reference less the measured state 0) added, rounded and limited,
 * and is written back. `wobble`, [n]: sensor noise in the feedback. `out`, [n][states]. Returns 1 where states run away. */
int simulate(int system, const double *p, const Effect *effects, int count, double *sent, const double *reference,
             const double *wobble, double gain, double limit, double step, long n, int inner, const double *start, double *out) {
    Plant plant = {p, effects, count, {{0.0}}, 0.0, NULL};
    int nx = STATES[system], nu = INPUTS[system], k, j;
    double x[MAX_STATES], a[MAX_STATES], b[MAX_STATES], c[MAX_STATES], d[MAX_STATES], y[MAX_STATES], u[MAX_INPUTS];
    double h = step / inner, *past[MAX_INPUTS];
    long i;
    Rates rates = SYSTEMS[system];
    for (k = 0; k < nu; ++k) past[k] = malloc((size_t)(n * inner) * sizeof(double));
    memcpy(x, start, (size_t)nx * sizeof *x);
    for (i = 0; i < n; ++i) {
        if (gain != 0.0) {
            double fed = sent[i * nu] + gain * (reference[i] - x[0] - wobble[i]);
            sent[i * nu] = round(fmin(fmax(fed, -limit), limit) * 1e4) / 1e4;
        }
        if (i == 0)
            for (k = 0; k < count; ++k)
                for (j = 0; j < nu; ++j)
                    if (effects[k].port == j && effects[k].kind >= PLAY) plant.memory[k][0] = sent[j];
        memcpy(out + i * nx, x, (size_t)nx * sizeof *x);
        for (k = 0; k < inner; ++k) {
            plant.t = ((double)i + (double)k / inner) * step;
            plant.x = x;
            for (j = 0; j < nu; ++j) {
                past[j][i * inner + k] = sent[i * nu + j];
                u[j] = command(&plant, j, past[j], i * inner + k, h);
            }
            rates(&plant, u, x, a);
            plant.t += h / 2.0;
            for (j = 0; j < nx; ++j) y[j] = x[j] + h / 2.0 * a[j];
            rates(&plant, u, y, b);
            for (j = 0; j < nx; ++j) y[j] = x[j] + h / 2.0 * b[j];
            rates(&plant, u, y, c);
            plant.t += h / 2.0;
            for (j = 0; j < nx; ++j) y[j] = x[j] + h * c[j];
            rates(&plant, u, y, d);
            for (j = 0; j < nx; ++j) x[j] += h / 6.0 * (a[j] + 2.0 * b[j] + 2.0 * c[j] + d[j]);
        }
        for (j = 0; j < nx; ++j)
            if (!isfinite(x[j])) {
                for (k = 0; k < nu; ++k) free(past[k]);
                return 1;
            }
    }
    for (k = 0; k < nu; ++k) free(past[k]);
    return 0;
}
