/* A Model Exchange FMU as another tool might write it: FMI 2.0 in plain C, without directional derivatives.
 *
 * Van der Pol's oscillator with a force: dx1/dt = (1 - x2^2) x1 - x2 + u, dx2/dt = x1.
 * Real: 0 u, 1 x1, 2 x2, 3 der(x1), 4 der(x2).
 */

#include <stdlib.h>
#include <string.h>

typedef struct {
    double u, x[2];
} Model;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

static void rates(const Model *model, double *out) {
    const double *x = model->x;
    out[0] = (1.0 - x[1] * x[1]) * x[0] - x[1] + model->u;
    out[1] = x[0];
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Model *model = calloc(1, sizeof *model);
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    if (model) model->x[1] = 1.0;
    return model;
}

void fmi2FreeInstance(Model *model) { free(model); }
int fmi2SetDebugLogging(Model *m, int on, size_t n, const char *const *c) { (void)m, (void)on, (void)n, (void)c; return 0; }

int fmi2SetupExperiment(Model *model, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)model, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return 0;
}

int fmi2EnterInitializationMode(Model *model) { (void)model; return 0; }
int fmi2ExitInitializationMode(Model *model) { (void)model; return 0; }
int fmi2Terminate(Model *model) { (void)model; return 0; }

int fmi2Reset(Model *model) {
    memset(model, 0, sizeof *model);
    model->x[1] = 1.0;
    return 0;
}

int fmi2GetReal(Model *model, const unsigned *references, size_t count, double *values) {
    double all[5] = {model->u, model->x[0], model->x[1]};
    rates(model, all + 3);
    for (size_t k = 0; k < count; ++k) {
        if (references[k] > 4) return 3;
        values[k] = all[references[k]];
    }
    return 0;
}

int fmi2SetReal(Model *model, const unsigned *references, size_t count, const double *values) {
    for (size_t k = 0; k < count; ++k) {
        if (references[k] > 2) return 3;
        if (references[k] == 0) model->u = values[k];
        else model->x[references[k] - 1] = values[k];
    }
    return 0;
}

int fmi2GetInteger(Model *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }
int fmi2SetInteger(Model *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }
int fmi2GetBoolean(Model *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }
int fmi2SetBoolean(Model *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }
int fmi2GetString(Model *m, const unsigned *r, size_t n, const char **v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }
int fmi2SetString(Model *m, const unsigned *r, size_t n, const char *const *v) { (void)m, (void)r, (void)v; return n ? 3 : 0; }

int fmi2EnterEventMode(Model *model) { (void)model; return 0; }
int fmi2EnterContinuousTimeMode(Model *model) { (void)model; return 0; }

int fmi2NewDiscreteStates(Model *model, EventInfo *info) {
    (void)model;
    memset(info, 0, sizeof *info);
    return 0;
}

int fmi2CompletedIntegratorStep(Model *model, int no_set_state_prior, int *event, int *terminate) {
    (void)model, (void)no_set_state_prior;
    *event = *terminate = 0;
    return 0;
}

int fmi2SetTime(Model *model, double time) { (void)model, (void)time; return 0; }

int fmi2SetContinuousStates(Model *model, const double *x, size_t count) {
    if (count != 2) return 3;
    memcpy(model->x, x, sizeof model->x);
    return 0;
}

int fmi2GetContinuousStates(Model *model, double *x, size_t count) {
    if (count != 2) return 3;
    memcpy(x, model->x, sizeof model->x);
    return 0;
}

int fmi2GetDerivatives(Model *model, double *dx, size_t count) {
    if (count != 2) return 3;
    rates(model, dx);
    return 0;
}

int fmi2GetEventIndicators(Model *model, double *z, size_t count) { (void)model, (void)z; return count ? 3 : 0; }

int fmi2GetNominalsOfContinuousStates(Model *model, double *nominals, size_t count) {
    (void)model;
    for (size_t k = 0; k < count; ++k) nominals[k] = 1.0;
    return 0;
}
