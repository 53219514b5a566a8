/* FMI 2.0 Model Exchange over the equations of one system: no directional derivatives, no states to get and set, no
 * Co-Simulation, as a third-party tool exports it. fmu.py writes `layout.h`: NX states, NU inputs, NP parameters, their
 * start values, and the function `rates`. All variables stand in one array: states, inputs, parameters, derivatives;
 * a value reference is a place in it.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "layout.h"

typedef struct {
    double real[NX + NU + NP + NX];
} Model;

typedef struct {
    int needed, terminate, nominals_changed, values_changed, next_defined;
    double next;
} EventInfo;

enum { OK = 0, FAILED = 3, COUNT = NX + NU + NP + NX, FIRST_RATE = NX + NU + NP };

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

int fmi2SetDebugLogging(void *m, int on, size_t n, const char *const *c) { (void)on, (void)n, (void)c; return m ? OK : FAILED; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Model *model;
    (void)name, (void)resources, (void)callbacks, (void)visible, (void)logging;
    if (type != 0 || strcmp(guid, GUID) != 0) return NULL;
    model = calloc(1, sizeof *model);
    if (model) memcpy(model->real, START, sizeof START);
    return model;
}

void fmi2FreeInstance(void *m) { free(m); }

int fmi2SetupExperiment(void *m, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return m ? OK : FAILED;
}

int fmi2EnterInitializationMode(void *m) { return m ? OK : FAILED; }
int fmi2ExitInitializationMode(void *m) { return m ? OK : FAILED; }
int fmi2Terminate(void *m) { return m ? OK : FAILED; }

int fmi2Reset(void *m) {
    memset(m, 0, sizeof(Model));
    memcpy(((Model *)m)->real, START, sizeof START);
    return OK;
}

int fmi2GetReal(void *m, const unsigned *references, size_t count, double *values) {
    double *real = ((Model *)m)->real;
    size_t k;
    rates(real, real + NX, real + NX + NU, real + FIRST_RATE);
    for (k = 0; k < count; ++k) {
        if (references[k] >= COUNT) return FAILED;
        values[k] = real[references[k]];
    }
    return OK;
}

int fmi2SetReal(void *m, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) {
        if (references[k] >= FIRST_RATE) return FAILED;
        ((Model *)m)->real[references[k]] = values[k];
    }
    return OK;
}

int fmi2GetInteger(void *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetInteger(void *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2GetBoolean(void *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetBoolean(void *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2GetString(void *m, const unsigned *r, size_t n, const char **v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetString(void *m, const unsigned *r, size_t n, const char *const *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }

int fmi2GetFMUstate(void *m, void **s) { (void)m, (void)s; return FAILED; }
int fmi2SetFMUstate(void *m, void *s) { (void)m, (void)s; return FAILED; }
int fmi2FreeFMUstate(void *m, void **s) { (void)m, (void)s; return FAILED; }
int fmi2SerializedFMUstateSize(void *m, void *s, size_t *n) { (void)m, (void)s, (void)n; return FAILED; }
int fmi2SerializeFMUstate(void *m, void *s, char *b, size_t n) { (void)m, (void)s, (void)b, (void)n; return FAILED; }
int fmi2DeSerializeFMUstate(void *m, const char *b, size_t n, void **s) { (void)m, (void)b, (void)n, (void)s; return FAILED; }
int fmi2GetDirectionalDerivative(void *m, const unsigned *z, size_t nz, const unsigned *v, size_t nv, const double *dv,
                                 double *dz) {
    (void)m, (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz;
    return FAILED;
}

int fmi2EnterEventMode(void *m) { return m ? OK : FAILED; }
int fmi2EnterContinuousTimeMode(void *m) { return m ? OK : FAILED; }

int fmi2NewDiscreteStates(void *m, EventInfo *info) {
    EventInfo none = {0, 0, 0, 0, 0, 0.0};
    *info = none;
    return m ? OK : FAILED;
}

int fmi2CompletedIntegratorStep(void *m, int no_set_state_prior, int *event, int *terminate) {
    (void)no_set_state_prior;
    *event = *terminate = 0;
    return m ? OK : FAILED;
}

int fmi2SetTime(void *m, double time) { return m && !isnan(time) ? OK : FAILED; }

int fmi2SetContinuousStates(void *m, const double *x, size_t count) {
    if (count != NX) return FAILED;
    memcpy(((Model *)m)->real, x, NX * sizeof *x);
    return OK;
}

int fmi2GetContinuousStates(void *m, double *x, size_t count) {
    if (count != NX) return FAILED;
    memcpy(x, ((Model *)m)->real, NX * sizeof *x);
    return OK;
}

int fmi2GetDerivatives(void *m, double *dx, size_t count) {
    double *real = ((Model *)m)->real;
    if (count != NX) return FAILED;
    rates(real, real + NX, real + NX + NU, dx);
    return OK;
}

int fmi2GetEventIndicators(void *m, double *z, size_t count) { (void)z; return m && count == 0 ? OK : FAILED; }

int fmi2GetNominalsOfContinuousStates(void *m, double *nominals, size_t count) {
    if (count != NX) return FAILED;
    memcpy(nominals, NOMINAL, sizeof NOMINAL);
    return m ? OK : FAILED;
}
