/* A small FMI 2.0 Model Exchange library with second derivatives in closed form, and ways to fail.
 *
 * Real: 0 u (input), 1 y = u x0 + exp(x1) (output), 2 x0, 3 x1 (states), 4 der(x0) = 3 x1,
 *       5 der(x1) = u x0^2 - sin(x0), 6 fault, 7 limit (parameters)
 * Where u is above the limit, the derivatives come to: fault 1 fmi2Discard, 2 fmi2Error (and nothing but
 * fmi2FreeInstance works from then on), 3 NaN.
 */

#include <math.h>
#include <stdlib.h>

typedef struct {
    double real[8];
    int broken;
} Bent;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

/* Status, values up to date. */
static int update(Bent *c) {
    double *r = c->real;
    int over = r[0] > r[7];
    if (c->broken) return 3;
    if (over && r[6] == 1.0) return 2;
    if (over && r[6] == 2.0) {
        c->broken = 1;
        return 3;
    }
    r[1] = r[0] * r[2] + exp(r[3]);
    r[4] = 3.0 * r[3];
    r[5] = over && r[6] == 3.0 ? NAN : r[0] * r[2] * r[2] - sin(r[2]);
    return 0;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Bent *c = calloc(1, sizeof *c);
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    c->real[7] = 1e300;
    return c;
}

void fmi2FreeInstance(Bent *c) { free(c); }

int fmi2SetupExperiment(Bent *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return c->broken ? 3 : 0;
}

int fmi2EnterInitializationMode(Bent *c) { return c->broken ? 3 : 0; }
int fmi2ExitInitializationMode(Bent *c) { return c->broken ? 3 : 0; }
int fmi2Terminate(Bent *c) { return c->broken ? 3 : 0; }
int fmi2Reset(Bent *c) { return c->broken ? 3 : 0; }

int fmi2GetReal(Bent *c, const unsigned *references, size_t count, double *values) {
    int status = update(c);
    size_t k;
    for (k = 0; k < count && status == 0; ++k) values[k] = c->real[references[k]];
    return status;
}

int fmi2SetReal(Bent *c, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) c->real[references[k]] = values[k];
    return c->broken ? 3 : 0;
}

int fmi2GetInteger(Bent *c, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetInteger(Bent *c, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2GetBoolean(Bent *c, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetBoolean(Bent *c, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2GetString(Bent *c, const unsigned *r, size_t n, const char **v) { (void)r, (void)v; return c && n ? 3 : 0; }
int fmi2SetString(Bent *c, const unsigned *r, size_t n, const char *const *v) { (void)r, (void)v; return c && n ? 3 : 0; }

int fmi2GetDirectionalDerivative(Bent *c, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                                 const double *seed, double *out) {
    const double *r = c->real;
    int status = update(c);
    size_t i, j;
    for (i = 0; i < unknowns && status == 0; ++i) {
        out[i] = 0.0;
        for (j = 0; j < knowns; ++j) {
            double slope = 0.0;
            if (unknown[i] == 1) slope = known[j] == 0 ? r[2] : known[j] == 2 ? r[0] : exp(r[3]);
            if (unknown[i] == 4) slope = known[j] == 3 ? 3.0 : 0.0;
            if (unknown[i] == 5) {
                slope = known[j] == 0 ? r[2] * r[2] : known[j] == 2 ? 2.0 * r[0] * r[2] - cos(r[2]) : 0.0;
            }
            out[i] += slope * seed[j];
        }
    }
    return status;
}

int fmi2EnterEventMode(Bent *c) { return c->broken ? 3 : 0; }
int fmi2EnterContinuousTimeMode(Bent *c) { return c->broken ? 3 : 0; }

int fmi2NewDiscreteStates(Bent *c, EventInfo *info) {
    EventInfo none = {0, 0, 0, 0, 0, 0.0};
    *info = none;
    return c->broken ? 3 : 0;
}

int fmi2CompletedIntegratorStep(Bent *c, int no_set_state_prior, int *event, int *terminate) {
    (void)no_set_state_prior;
    *event = *terminate = 0;
    return c->broken ? 3 : 0;
}

int fmi2SetTime(Bent *c, double time) { return c->broken || isnan(time) ? 3 : 0; }

int fmi2SetContinuousStates(Bent *c, const double *x, size_t count) {
    if (count != 2 || c->broken) return 3;
    c->real[2] = x[0];
    c->real[3] = x[1];
    return 0;
}

int fmi2GetContinuousStates(Bent *c, double *x, size_t count) {
    if (count != 2 || c->broken) return 3;
    x[0] = c->real[2];
    x[1] = c->real[3];
    return 0;
}

int fmi2GetDerivatives(Bent *c, double *dx, size_t count) {
    int status = update(c);
    if (count != 2) return 3;
    dx[0] = c->real[4];
    dx[1] = c->real[5];
    return status;
}

int fmi2GetEventIndicators(Bent *c, double *z, size_t count) { (void)z; return c->broken || count ? 3 : 0; }

int fmi2GetNominalsOfContinuousStates(Bent *c, double *nominals, size_t count) {
    size_t k;
    for (k = 0; k < count; ++k) nominals[k] = 1.0;
    return c->broken ? 3 : 0;
}
