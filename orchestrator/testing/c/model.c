/* A small FMI 2.0 Model Exchange library for the tests of the monolithic master.
 *
 * Real:    0 u (input), 1 y = gain u + offset, 2 c = cos(u) (outputs with feed-through), 3 x (state and output),
 *          4 der(x) = rate (u - x) - relay s + growth x^2, with s the sign of x at the last event,
 *          5 gain, 6 offset, 7 rate, 8 relay, 9 growth (parameters), 10 held = u at the last event (discrete output)
 * Event indicator: x where relay is not 0, else 1.
 */

#include <math.h>
#include <stdlib.h>

typedef struct {
    double real[11];
    double sign;
} Model;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

static void update(Model *model) {
    double *r = model->real;
    r[1] = r[5] * r[0] + r[6];
    r[2] = cos(r[0]);
    r[4] = r[7] * (r[0] - r[3]) - r[8] * model->sign + r[9] * r[3] * r[3];
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Model *model = calloc(1, sizeof *model);
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    model->real[5] = 1.0;
    return model;
}

void fmi2FreeInstance(Model *model) { free(model); }

int fmi2SetupExperiment(Model *model, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return model == NULL;
}

int fmi2EnterInitializationMode(Model *model) { return model == NULL; }
int fmi2ExitInitializationMode(Model *model) { return model == NULL; }
int fmi2Terminate(Model *model) { return model == NULL; }
int fmi2Reset(Model *model) { return model == NULL; }

int fmi2GetReal(Model *model, const unsigned *references, size_t count, double *values) {
    size_t k;
    update(model);
    for (k = 0; k < count; ++k) values[k] = model->real[references[k]];
    return 0;
}

int fmi2SetReal(Model *model, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) model->real[references[k]] = values[k];
    return 0;
}

int fmi2GetInteger(Model *model, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return model && n ? 3 : 0; }
int fmi2SetInteger(Model *model, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return model && n ? 3 : 0; }
int fmi2GetBoolean(Model *model, const unsigned *r, size_t n, int *v) { (void)r, (void)v; return model && n ? 3 : 0; }
int fmi2SetBoolean(Model *model, const unsigned *r, size_t n, const int *v) { (void)r, (void)v; return model && n ? 3 : 0; }
int fmi2GetString(Model *model, const unsigned *r, size_t n, const char **v) { (void)r, (void)v; return model && n ? 3 : 0; }
int fmi2SetString(Model *model, const unsigned *r, size_t n, const char *const *v) { (void)r, (void)v; return model && n ? 3 : 0; }

/* The outputs y and c by the input u. */
int fmi2GetDirectionalDerivative(Model *model, const unsigned *unknown, size_t unknowns, const unsigned *known,
                                 size_t knowns, const double *seed, double *out) {
    size_t k;
    if (knowns != 1 || known[0] != 0) return 3;
    for (k = 0; k < unknowns; ++k) {
        if (unknown[k] != 1 && unknown[k] != 2) return 3;
        out[k] = seed[0] * (unknown[k] == 1 ? model->real[5] : -sin(model->real[0]));
    }
    return 0;
}

int fmi2EnterEventMode(Model *model) { return model == NULL; }
int fmi2EnterContinuousTimeMode(Model *model) { return model == NULL; }

int fmi2NewDiscreteStates(Model *model, EventInfo *info) {
    EventInfo none = {0, 0, 0, 0, 0, 0.0};
    model->sign = model->real[3] > 0.0 ? 1.0 : -1.0;
    model->real[10] = model->real[0];
    *info = none;
    return 0;
}

int fmi2CompletedIntegratorStep(Model *model, int no_set_state_prior, int *event, int *terminate) {
    (void)no_set_state_prior;
    *event = *terminate = 0;
    return model == NULL;
}

int fmi2SetTime(Model *model, double time) { return model == NULL || isnan(time); }

int fmi2SetContinuousStates(Model *model, const double *x, size_t count) {
    if (count != 1) return 3;
    model->real[3] = x[0];
    return 0;
}

int fmi2GetContinuousStates(Model *model, double *x, size_t count) {
    if (count != 1) return 3;
    x[0] = model->real[3];
    return 0;
}

int fmi2GetDerivatives(Model *model, double *dx, size_t count) {
    if (count != 1) return 3;
    update(model);
    dx[0] = model->real[4];
    return 0;
}

int fmi2GetEventIndicators(Model *model, double *z, size_t count) {
    if (count != 1) return 3;
    z[0] = model->real[8] != 0.0 ? model->real[3] : 1.0;
    return 0;
}

int fmi2GetNominalsOfContinuousStates(Model *model, double *nominals, size_t count) {
    if (count != 1) return 3;
    nominals[0] = 1.0;
    return model == NULL;
}
