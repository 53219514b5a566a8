/* A small FMI 2.0 Model Exchange library as another tool might write it: a carriage on a rail.
 *
 * Real: 0 drive (input, force), 1 place (state, output), 2 speed (state, output), 3 der(place), 4 der(speed),
 *       5 weight (mass), 6 drag (viscous friction)
 */

#include <stdlib.h>

typedef struct {
    double real[7];
} Model;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

static void update(Model *model) {
    double *r = model->real;
    r[3] = r[2];
    r[4] = (r[0] - r[6] * r[2]) / r[5];
}

static void start(Model *model) {
    const double values[7] = {0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0};
    size_t k;
    for (k = 0; k < 7; ++k) model->real[k] = values[k];
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
    if (count != 2) return 3;
    model->real[1] = x[0];
    model->real[2] = x[1];
    return 0;
}

int fmi2GetContinuousStates(Model *model, double *x, size_t count) {
    if (count != 2) return 3;
    x[0] = model->real[1];
    x[1] = model->real[2];
    return 0;
}

int fmi2GetDerivatives(Model *model, double *dx, size_t count) {
    if (count != 2) return 3;
    update(model);
    dx[0] = model->real[3];
    dx[1] = model->real[4];
    return 0;
}

int fmi2GetEventIndicators(Model *model, double *z, size_t count) { (void)z; return model && count ? 3 : 0; }

int fmi2GetNominalsOfContinuousStates(Model *model, double *nominals, size_t count) {
    if (count != 2) return 3;
    nominals[0] = nominals[1] = 1.0;
    return model == NULL;
}
