/* A small FMI 2.0 library for the tests of algebraic loops, with both interfaces.
 *
 * Real: 0 u (input), 1 y = gain u + bend tanh(u) + share x + offset (output with feed-through), 2 x (state and output),
 *       3 der(x) = rate (u - x), 4 gain, 5 bend, 6 share, 7 rate, 8 offset (parameters), 9 v (input without effect)
 *
 * Compiled with STALE, a slave computes its outputs in fmi2DoStep only (and in initialization mode); with STRICT, it
 * also answers with fmi2Error when outputs are read after inputs were set and before the next step.
 */

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double real[10];
    int is_slave, initialized, changed;
} Looped;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

static void update(Looped *c) {
    double *r = c->real;
    r[1] = r[4] * r[0] + r[5] * tanh(r[0]) + r[6] * r[2] + r[8];
    r[3] = r[7] * (r[0] - r[2]);
    c->changed = 0;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Looped *c = calloc(1, sizeof *c);
    (void)name, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    c->is_slave = type == 1;
    return c;
}

void fmi2FreeInstance(Looped *c) { free(c); }

int fmi2SetupExperiment(Looped *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return c == NULL;
}

int fmi2EnterInitializationMode(Looped *c) { return c == NULL; }
int fmi2ExitInitializationMode(Looped *c) {
    update(c);
    c->initialized = 1;
    return 0;
}
int fmi2Terminate(Looped *c) { return c == NULL; }
int fmi2Reset(Looped *c) { return c == NULL; }

int fmi2GetReal(Looped *c, const unsigned *references, size_t count, double *values) {
    size_t k;
#ifdef STRICT
    if (c->is_slave && c->initialized && c->changed) return 3;
#endif
#if defined(STALE) || defined(STRICT)
    if (!c->is_slave || !c->initialized) update(c);
#else
    update(c);
#endif
    for (k = 0; k < count; ++k) values[k] = c->real[references[k]];
    return 0;
}

int fmi2SetReal(Looped *c, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) c->real[references[k]] = values[k];
    c->changed = 1;
    return 0;
}

int fmi2GetInteger(Looped *c, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetInteger(Looped *c, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2GetBoolean(Looped *c, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetBoolean(Looped *c, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2GetString(Looped *c, const unsigned *r, size_t n, const char **v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetString(Looped *c, const unsigned *r, size_t n, const char *const *v) { (void)r, (void)v; return c && n ? 3 : 0; }

/* Under the held input the state is computed exactly. */
int fmi2DoStep(Looped *c, double time, double step, int no_set_state) {
    double *r = c->real;
    (void)time, (void)no_set_state;
    r[2] += (1.0 - exp(-r[7] * step)) * (r[0] - r[2]);
    update(c);
    return 0;
}

int fmi2GetRealStatus(Looped *c, int kind, double *value) { (void)c, (void)kind, (void)value; return 2; }
int fmi2GetBooleanStatus(Looped *c, int kind, int *value) { (void)c, (void)kind, (void)value; return 2; }

int fmi2GetFMUstate(Looped *c, void **state) {
    if (*state == NULL) *state = malloc(sizeof *c);
    memcpy(*state, c, sizeof *c);
    return 0;
}
int fmi2SetFMUstate(Looped *c, void *state) {
    memcpy(c, state, sizeof *c);
    return 0;
}
int fmi2FreeFMUstate(Looped *c, void **state) {
    free(*state);
    *state = NULL;
    return c == NULL;
}

/* y and der(x) by u and x. */
int fmi2GetDirectionalDerivative(Looped *c, const unsigned *unknown, size_t unknowns, const unsigned *known,
                                 size_t knowns, const double *seed, double *out) {
    const double *r = c->real;
    double slope = r[4] + r[5] * (1.0 - tanh(r[0]) * tanh(r[0]));
    size_t k;
    if (knowns != 1 || (known[0] != 0 && known[0] != 2 && known[0] != 9)) return 3;
    for (k = 0; k < unknowns; ++k) {
        double by_u = unknown[k] == 1 ? slope : unknown[k] == 3 ? r[7] : 0.0;
        double by_x = unknown[k] == 1 ? r[6] : unknown[k] == 3 ? -r[7] : 1.0;
        out[k] = known[0] == 9 ? 0.0 : seed[0] * (known[0] == 0 ? by_u : by_x);
    }
    return 0;
}

int fmi2EnterEventMode(Looped *c) { return c == NULL; }
int fmi2EnterContinuousTimeMode(Looped *c) { return c == NULL; }
int fmi2NewDiscreteStates(Looped *c, EventInfo *info) {
    EventInfo none = {0, 0, 0, 0, 0, 0.0};
    *info = none;
    return c == NULL;
}
int fmi2CompletedIntegratorStep(Looped *c, int no_set_state_prior, int *event, int *terminate) {
    (void)no_set_state_prior;
    *event = *terminate = 0;
    return c == NULL;
}
int fmi2SetTime(Looped *c, double time) { return c == NULL || isnan(time); }
int fmi2SetContinuousStates(Looped *c, const double *x, size_t count) {
    if (count != 1) return 3;
    c->real[2] = x[0];
    return 0;
}
int fmi2GetContinuousStates(Looped *c, double *x, size_t count) {
    if (count != 1) return 3;
    x[0] = c->real[2];
    return 0;
}
int fmi2GetDerivatives(Looped *c, double *dx, size_t count) {
    if (count != 1) return 3;
    update(c);
    dx[0] = c->real[3];
    return 0;
}
int fmi2GetEventIndicators(Looped *c, double *z, size_t count) { (void)c, (void)z; return count ? 3 : 0; }
int fmi2GetNominalsOfContinuousStates(Looped *c, double *nominals, size_t count) {
    if (count != 1) return 3;
    nominals[0] = 1.0;
    return c == NULL;
}
