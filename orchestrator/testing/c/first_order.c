/* A small FMU with both interfaces for the tests of the checker: der(x) = p * x + u, y = x + u * u.
 * Value references: 0 u, 1 x, 2 der(x), 3 y, 4 p. Co-Simulation steps by explicit Euler.
 * Each macro plants one fault:
 *   ANY_GUID RESET_KEEPS_X SHARED_X STATE_WITHOUT_X WRONG_DERIVATIVE NAN_OUTPUT WRONG_START ENDLESS_EVENTS STEP_FAILS
 *   CURVED (der(x) = p * x * x + u) PRINTS CRASHES EXITS HANGS (at the end of initialization) */

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double value[5];
    double time;
    int initialized;
} Instance;

#ifdef SHARED_X
static double shared_x;
#endif

static void start(Instance *it) {
    it->value[0] = 0;
    it->value[1] = 1;
#ifdef WRONG_START
    it->value[1] = 1.5;
#endif
    it->value[4] = -1;
    it->time = 0;
}

static void compute(Instance *it) {
    double *v = it->value;
#ifdef SHARED_X
    v[1] = shared_x;
#endif
#ifdef CURVED
    v[2] = v[4] * v[1] * v[1] + v[0];
#else
    v[2] = v[4] * v[1] + v[0];
#endif
    v[3] = v[1] + v[0] * v[0];
#ifdef NAN_OUTPUT
    v[3] = NAN;
#endif
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

Instance *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                          int visible, int logging) {
    Instance *it;
    (void)name, (void)type, (void)resources, (void)callbacks, (void)visible, (void)logging;
#ifndef ANY_GUID
    if (strcmp(guid, "right") != 0) {
        return NULL;
    }
#else
    (void)guid;
#endif
    it = calloc(1, sizeof *it);
    start(it);
    return it;
}

void fmi2FreeInstance(Instance *it) { free(it); }
int fmi2SetupExperiment(Instance *it, int a, double b, double c, int d, double e) {
    (void)it, (void)a, (void)b, (void)c, (void)d, (void)e;
    return 0;
}
int fmi2EnterInitializationMode(Instance *it) {
#ifdef SHARED_X
    shared_x = it->value[1];
#endif
    (void)it;
    return 0;
}
int fmi2ExitInitializationMode(Instance *it) {
    (void)it;
#ifdef PRINTS
    printf("this is not JSON {\n");
#endif
#ifdef CRASHES
    raise(SIGSEGV);
#endif
#ifdef EXITS
    exit(0);
#endif
#ifdef HANGS
    for (volatile int forever = 1; forever;) {
    }
#endif
    return 0;
}
int fmi2Terminate(Instance *it) { return (void)it, 0; }
int fmi2SetDebugLogging(Instance *it, int on, size_t n, const char *const *c) { return (void)it, (void)on, (void)n, (void)c, 0; }

int fmi2Reset(Instance *it) {
#ifdef RESET_KEEPS_X
    double x = it->value[1];
    start(it);
    it->value[1] = x;
#else
    start(it);
#endif
    return 0;
}

int fmi2GetReal(Instance *it, const unsigned *references, size_t count, double *values) {
    compute(it);
    for (size_t i = 0; i < count; ++i) {
        values[i] = it->value[references[i]];
    }
    return 0;
}

int fmi2SetReal(Instance *it, const unsigned *references, size_t count, const double *values) {
    for (size_t i = 0; i < count; ++i) {
        it->value[references[i]] = values[i];
    }
    return 0;
}

#define UNUSED(function)                                                                                               \
    int function(Instance *it, const unsigned *references, size_t count, void *values) {                              \
        return (void)it, (void)references, (void)values, count == 0 ? 0 : 3;                                           \
    }
UNUSED(fmi2GetInteger)
UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString)
UNUSED(fmi2SetInteger)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetString)

static void set_x(Instance *it, double x) {
    it->value[1] = x;
#ifdef SHARED_X
    shared_x = x;
#endif
}

int fmi2DoStep(Instance *it, double time, double step, int no_set_state) {
    (void)no_set_state;
#ifdef STEP_FAILS
    return 3;
#endif
    if (!(step > 0)) {
        return 3;
    }
    compute(it);
    set_x(it, it->value[1] + step * it->value[2]);
    it->time = time + step;
    return 0;
}

int fmi2GetFMUstate(Instance *it, Instance **state) {
    if (*state == NULL) {
        *state = malloc(sizeof **state);
    }
    **state = *it;
    return 0;
}
int fmi2SetFMUstate(Instance *it, Instance *state) {
    double x = it->value[1];
    *it = *state;
#ifdef STATE_WITHOUT_X
    it->value[1] = x;
#else
    (void)x;
#endif
    return 0;
}
int fmi2FreeFMUstate(Instance *it, Instance **state) {
    (void)it;
    free(*state);
    *state = NULL;
    return 0;
}
int fmi2SerializedFMUstateSize(Instance *it, Instance *state, size_t *size) {
    (void)it, (void)state;
    *size = sizeof *state;
    return 0;
}
int fmi2SerializeFMUstate(Instance *it, Instance *state, char *bytes, size_t size) {
    (void)it;
    memcpy(bytes, state, size);
    return 0;
}
int fmi2DeSerializeFMUstate(Instance *it, const char *bytes, size_t size, Instance **state) {
    (void)it;
    *state = malloc(sizeof **state);
    memcpy(*state, bytes, size);
    return 0;
}

int fmi2GetDirectionalDerivative(Instance *it, const unsigned *unknown, size_t unknowns, const unsigned *known,
                                 size_t knowns, const double *seed, double *out) {
    double u = 0, x = 0;
    for (size_t j = 0; j < knowns; ++j) {
        if (known[j] == 0) {
            u = seed[j];
        } else {
            x = seed[j];
        }
    }
    for (size_t i = 0; i < unknowns; ++i) {
#ifdef WRONG_DERIVATIVE
        double slope = it->value[0];
#else
        double slope = 2 * it->value[0];
#endif
        out[i] = unknown[i] == 2 ? it->value[4] * x + u : x + slope * u;
    }
    return 0;
}

typedef struct {
    int needed, terminate, nominals, values, next_defined;
    double next;
} EventInfo;

int fmi2EnterEventMode(Instance *it) { return (void)it, 0; }
int fmi2EnterContinuousTimeMode(Instance *it) { return (void)it, 0; }
int fmi2NewDiscreteStates(Instance *it, EventInfo *info) {
    (void)it;
    memset(info, 0, sizeof *info);
#ifdef ENDLESS_EVENTS
    info->needed = 1;
#endif
    return 0;
}
int fmi2CompletedIntegratorStep(Instance *it, int no_set_state, int *event, int *terminate) {
    (void)it, (void)no_set_state;
    *event = *terminate = 0;
    return 0;
}
int fmi2SetTime(Instance *it, double time) { return it->time = time, 0; }
int fmi2SetContinuousStates(Instance *it, const double *x, size_t count) { return (void)count, set_x(it, x[0]), 0; }
int fmi2GetContinuousStates(Instance *it, double *x, size_t count) {
    (void)count;
    compute(it);
    x[0] = it->value[1];
    return 0;
}
int fmi2GetDerivatives(Instance *it, double *x, size_t count) {
    (void)count;
    compute(it);
    x[0] = it->value[2];
    return 0;
}
int fmi2GetEventIndicators(Instance *it, double *z, size_t count) { return (void)it, (void)z, (void)count, 0; }
int fmi2GetNominalsOfContinuousStates(Instance *it, double *x, size_t count) {
    (void)it, (void)count;
    x[0] = 1;
    return 0;
}
