/* FMI 2.0 Model Exchange around the equations of one model, for models that need no events: include it after
 *
 *     enum { STATES, INPUTS, PARAMETERS };                       how many there are
 *     static const double START[STATES + INPUTS + PARAMETERS];   start values in this order
 *     static const char GUID[];                                  as in modelDescription.xml
 *     static void rates(const double *x, const double *u, const double *p, double *dx);
 *
 * and, where states are far from 1, #define NOMINAL(k), the nominal value of state k.
 * All variables stand in one array: states, inputs, parameters, derivatives; a value reference is a place in it.
 * Types and status codes are those of the standard (fmi-standard.org, FMI 2.0.4).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef NOMINAL
#define NOMINAL(k) 1.0
#endif

enum { FIRST_RATE = STATES + INPUTS + PARAMETERS, VARIABLES = FIRST_RATE + STATES };
enum { OK = 0, FAILED = 3, MODEL_EXCHANGE = 0 };

typedef struct {
    double values[VARIABLES];
} Model;

typedef struct {
    int new_discrete_states, terminate, nominals_changed, values_changed, next_event_defined;
    double next_event;
} EventInfo;

static void update(Model *m) {
    rates(m->values, m->values + STATES, m->values + STATES + INPUTS, m->values + FIRST_RATE);
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    Model *m;
    (void)name, (void)resources, (void)callbacks, (void)visible, (void)logging;
    if (type != MODEL_EXCHANGE || strcmp(guid, GUID) != 0) return NULL;
    m = calloc(1, sizeof *m);
    if (m) memcpy(m->values, START, sizeof START);
    return m;
}

void fmi2FreeInstance(void *m) { free(m); }

int fmi2Reset(void *m) {
    memset(m, 0, sizeof(Model));
    memcpy(((Model *)m)->values, START, sizeof START);
    return OK;
}

int fmi2GetReal(void *m, const unsigned *references, size_t count, double *values) {
    size_t k;
    update(m);
    for (k = 0; k < count; ++k) {
        if (references[k] >= VARIABLES) return FAILED;
        values[k] = ((Model *)m)->values[references[k]];
    }
    return OK;
}

int fmi2SetReal(void *m, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) {
        if (references[k] >= FIRST_RATE) return FAILED;
        ((Model *)m)->values[references[k]] = values[k];
    }
    return OK;
}

int fmi2GetContinuousStates(void *m, double *x, size_t count) {
    if (count != STATES) return FAILED;
    memcpy(x, ((Model *)m)->values, STATES * sizeof *x);
    return OK;
}

int fmi2SetContinuousStates(void *m, const double *x, size_t count) {
    if (count != STATES) return FAILED;
    memcpy(((Model *)m)->values, x, STATES * sizeof *x);
    return OK;
}

int fmi2GetDerivatives(void *m, double *dx, size_t count) {
    if (count != STATES) return FAILED;
    update(m);
    memcpy(dx, ((Model *)m)->values + FIRST_RATE, STATES * sizeof *dx);
    return OK;
}

int fmi2NewDiscreteStates(void *m, EventInfo *info) {
    (void)m;
    memset(info, 0, sizeof *info);
    return OK;
}

int fmi2CompletedIntegratorStep(void *m, int no_set_state_prior, int *event, int *terminate) {
    (void)m, (void)no_set_state_prior;
    *event = *terminate = 0;
    return OK;
}

int fmi2SetupExperiment(void *m, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)m, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return OK;
}

int fmi2GetNominalsOfContinuousStates(void *m, double *nominals, size_t count) {
    size_t k;
    (void)m;
    for (k = 0; k < count; ++k) nominals[k] = NOMINAL(k);
    return OK;
}

int fmi2GetEventIndicators(void *m, double *indicators, size_t count) {
    (void)m, (void)indicators;
    return count ? FAILED : OK;
}

int fmi2SetTime(void *m, double time) { return m && !isnan(time) ? OK : FAILED; }
int fmi2SetDebugLogging(void *m, int on, size_t n, const char *const *c) { (void)m, (void)on, (void)n, (void)c; return OK; }
int fmi2EnterInitializationMode(void *m) { (void)m; return OK; }
int fmi2ExitInitializationMode(void *m) { (void)m; return OK; }
int fmi2EnterEventMode(void *m) { (void)m; return OK; }
int fmi2EnterContinuousTimeMode(void *m) { (void)m; return OK; }
int fmi2Terminate(void *m) { (void)m; return OK; }

/* Variables of other types there are none. */
int fmi2GetInteger(void *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetInteger(void *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2GetBoolean(void *m, const unsigned *r, size_t n, int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetBoolean(void *m, const unsigned *r, size_t n, const int *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2GetString(void *m, const unsigned *r, size_t n, const char **v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }
int fmi2SetString(void *m, const unsigned *r, size_t n, const char *const *v) { (void)m, (void)r, (void)v; return n ? FAILED : OK; }

/* modelDescription.xml does not promise these. */
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
