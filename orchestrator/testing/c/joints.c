/* A small FMI 2.0 Model Exchange library as another tool might write it: an arm of two joints that move each other.
 *
 * Real: 0 tau_1, 1 tau_2 (inputs, torques), 2 q_1, 3 q_2, 4 w_1, 5 w_2 (states, outputs), 6 to 9 their derivatives.
 * States in the order of the model description: q_1, q_2, w_1, w_2.
 */

#include <math.h>
#include <stdlib.h>

typedef struct {
    double real[10];
} Model;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

static void update(Model *model) {
    double *r = model->real;
    const double a = r[0] - 0.3 * r[4] - 2.0 * sin(r[2]);
    const double b = r[1] - 0.1 * r[5] - 0.8 * sin(r[2] + r[3]);
    /* Mass matrix [[0.30, 0.08], [0.08, 0.05]]. */
    const double det = 0.30 * 0.05 - 0.08 * 0.08;
    r[6] = r[4];
    r[7] = r[5];
    r[8] = (0.05 * a - 0.08 * b) / det;
    r[9] = (0.30 * b - 0.08 * a) / det;
}

static void start(Model *model) {
    size_t k;
    for (k = 0; k < 10; ++k) model->real[k] = 0.0;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Model *model = calloc(1, sizeof *model);
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    if (model) start(model);
    return model;
}

void fmi2FreeInstance(Model *model) { free(model); }

int fmi2SetupExperiment(Model *model, int has_tolerance, double tolerance, double start_time, int has_stop,
                        double stop) {
    (void)has_tolerance, (void)tolerance, (void)start_time, (void)has_stop, (void)stop;
    return model == NULL;
}

int fmi2EnterInitializationMode(Model *model) { return model == NULL; }
int fmi2ExitInitializationMode(Model *model) { return model == NULL; }
int fmi2Terminate(Model *model) { return model == NULL; }

int fmi2Reset(Model *model) {
    start(model);
    return 0;
}

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

int fmi2EnterEventMode(Model *model) { return model == NULL; }
int fmi2EnterContinuousTimeMode(Model *model) { return model == NULL; }

int fmi2NewDiscreteStates(Model *model, EventInfo *info) {
    EventInfo none = {0, 0, 0, 0, 0, 0.0};
    *info = none;
    return model == NULL;
}

int fmi2CompletedIntegratorStep(Model *model, int no_set_state_prior, int *event, int *terminate) {
    (void)no_set_state_prior;
    *event = *terminate = 0;
    return model == NULL;
}

int fmi2SetTime(Model *model, double time) { (void)time; return model == NULL; }

int fmi2SetContinuousStates(Model *model, const double *x, size_t count) {
    size_t k;
    if (count != 4) return 3;
    for (k = 0; k < 4; ++k) model->real[2 + k] = x[k];
    return 0;
}

int fmi2GetContinuousStates(Model *model, double *x, size_t count) {
    size_t k;
    if (count != 4) return 3;
    for (k = 0; k < 4; ++k) x[k] = model->real[2 + k];
    return 0;
}

int fmi2GetDerivatives(Model *model, double *dx, size_t count) {
    size_t k;
    if (count != 4) return 3;
    update(model);
    for (k = 0; k < 4; ++k) dx[k] = model->real[6 + k];
    return 0;
}

int fmi2GetEventIndicators(Model *model, double *z, size_t count) { (void)z; return model && count ? 3 : 0; }

int fmi2GetNominalsOfContinuousStates(Model *model, double *nominals, size_t count) {
    size_t k;
    if (count != 4) return 3;
    for (k = 0; k < 4; ++k) nominals[k] = 1.0;
    return model == NULL;
}
