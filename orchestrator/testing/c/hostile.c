/* An FMU of FMI 2.0 that misbehaves as the environment variable HOSTILE says: see `hostile.h`. Without it:
 * der(x) = u - x, y = x, by both interfaces.
 *
 * Real: 0 u (input), 1 x (state), 2 der(x), 3 y (output). String: 0 s (output). One event indicator. */

#define _GNU_SOURCE
#include <stddef.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished;
    void *environment;
} Callbacks;

typedef struct {
    double real[4], time;
    const Callbacks *callbacks;
} Unit;

#define SAY(unit, name, status, category, text) \
    do { if ((unit) != NULL) (unit)->callbacks->logger((unit)->callbacks->environment, name, status, category, text); } while (0)

#include "hostile.h"

const char *fmi2GetTypesPlatform(void) { return asked("fmi2GetTypesPlatform", "null", NULL) ? NULL : "default"; }
const char *fmi2GetVersion(void) {
    fault("fmi2GetVersion", NULL, NULL, 0);
    return asked("fmi2GetVersion", "null", NULL) ? NULL : asked("fmi2GetVersion", "bytes", NULL) ? "\xff\033[1m" : "2.0";
}

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                      int visible, int logging) {
    Unit *unit = calloc(1, sizeof *unit);
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    unit->callbacks = callbacks;
    unit->real[1] = 1.0;
    if (fault("fmi2Instantiate", unit, NULL, 0) > 0) return NULL;
    return unit;
}

void fmi2FreeInstance(Unit *unit) {
    fault("fmi2FreeInstance", unit, NULL, 0);
    free(unit);
}

#define SIMPLE(function) \
    int function(Unit *unit) { return fault(#function, unit, NULL, 0); }

SIMPLE(fmi2EnterInitializationMode)
SIMPLE(fmi2ExitInitializationMode)
SIMPLE(fmi2Terminate)
SIMPLE(fmi2Reset)
SIMPLE(fmi2EnterEventMode)
SIMPLE(fmi2EnterContinuousTimeMode)

int fmi2SetDebugLogging(Unit *unit, int on, size_t count, const char *const *categories) {
    (void)on, (void)count, (void)categories;
    return fault("fmi2SetDebugLogging", unit, NULL, 0);
}

int fmi2SetupExperiment(Unit *unit, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    unit->time = start;
    return fault("fmi2SetupExperiment", unit, NULL, 0);
}

int fmi2GetReal(Unit *unit, const unsigned *references, size_t count, double *values) {
    int status = fault("fmi2GetReal", unit, values, count);
    unit->real[2] = unit->real[0] - unit->real[1];
    unit->real[3] = unit->real[1];
    for (size_t k = 0; status == 0 && k < count; ++k) values[k] = unit->real[references[k]];
    return status < 0 ? 0 : status;
}

int fmi2SetReal(Unit *unit, const unsigned *references, size_t count, const double *values) {
    for (size_t k = 0; k < count; ++k) unit->real[references[k]] = values[k];
    return fault("fmi2SetReal", unit, NULL, 0);
}

int fmi2GetString(Unit *unit, const unsigned *references, size_t count, const char **values) {
    int is_null;
    const char *strange = strange_text("fmi2GetString", unit, &is_null);
    (void)references;
    for (size_t k = 0; k < count; ++k) values[k] = is_null ? NULL : strange != NULL ? strange : "text";
    return fault("fmi2GetString", unit, NULL, 0);
}

int fmi2GetInteger(Unit *unit, const unsigned *r, size_t n, int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetInteger(Unit *unit, const unsigned *r, size_t n, const int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2GetBoolean(Unit *unit, const unsigned *r, size_t n, int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetBoolean(Unit *unit, const unsigned *r, size_t n, const int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetString(Unit *unit, const unsigned *r, size_t n, const char **v) { (void)unit, (void)r, (void)n, (void)v; return 3; }

int fmi2GetFMUstate(Unit *unit, void **state) { return save_state("fmi2GetFMUstate", unit, state); }
int fmi2SetFMUstate(Unit *unit, void *state) {
    const Callbacks *callbacks = unit->callbacks;
    memcpy(unit, state, sizeof *unit);
    unit->callbacks = callbacks;
    return fault("fmi2SetFMUstate", unit, NULL, 0);
}
int fmi2FreeFMUstate(Unit *unit, void **state) { return free_state("fmi2FreeFMUstate", unit, state); }
int fmi2SerializedFMUstateSize(Unit *unit, void *state, size_t *size) {
    (void)state;
    return size_of_state("fmi2SerializedFMUstateSize", unit, size);
}
int fmi2SerializeFMUstate(Unit *unit, void *state, char *bytes, size_t size) {
    return write_state("fmi2SerializeFMUstate", unit, state, bytes, size);
}
int fmi2DeSerializeFMUstate(Unit *unit, const char *bytes, size_t size, void **state) {
    return read_state("fmi2DeSerializeFMUstate", unit, bytes, size, state);
}

int fmi2GetDirectionalDerivative(Unit *unit, const unsigned *unknowns, size_t rows, const unsigned *knowns, size_t columns,
                                 const double *seed, double *out) {
    return derivatives("fmi2GetDirectionalDerivative", unit, unknowns, rows, knowns, columns, seed, out, rows);
}

int fmi2SetRealInputDerivatives(Unit *unit, const unsigned *r, size_t n, const int *order, const double *v) {
    (void)r, (void)n, (void)order, (void)v;
    return fault("fmi2SetRealInputDerivatives", unit, NULL, 0);
}
int fmi2GetRealOutputDerivatives(Unit *unit, const unsigned *r, size_t n, const int *order, double *v) {
    int status = fault("fmi2GetRealOutputDerivatives", unit, v, n);
    (void)r, (void)order;
    for (size_t k = 0; status == 0 && k < n; ++k) v[k] = unit->real[0] - unit->real[1];
    return status < 0 ? 0 : status;
}

int fmi2DoStep(Unit *unit, double t, double h, int keep) {
    (void)keep;
    unit->time = t;
    int status = fault("fmi2DoStep", unit, NULL, 0);
    if (status > 1) return status;
    unit->real[1] += h * (unit->real[0] - unit->real[1]);
    unit->time = t + h;
    return status;
}

int fmi2GetRealStatus(Unit *unit, int kind, double *value) {
    (void)kind;
    *value = unit->time;
    int status = fault("fmi2GetRealStatus", unit, value, 1);
    return status < 0 ? 0 : status;
}
int fmi2GetBooleanStatus(Unit *unit, int kind, int *value) {
    (void)kind;
    *value = asked("fmi2GetBooleanStatus", "yes", unit);
    return fault("fmi2GetBooleanStatus", unit, NULL, 0);
}

int fmi2SetTime(Unit *unit, double time) {
    unit->time = time;
    return fault("fmi2SetTime", unit, NULL, 0);
}

int fmi2SetContinuousStates(Unit *unit, const double *states, size_t count) {
    for (size_t k = 0; k < count; ++k) unit->real[1 + k] = states[k];
    return fault("fmi2SetContinuousStates", unit, NULL, 0);
}

#define READ(function, value) \
    int function(Unit *unit, double *values, size_t count) { \
        int status = fault(#function, unit, values, count); \
        for (size_t k = 0; status == 0 && k < count; ++k) values[k] = value; \
        return status < 0 ? 0 : status; \
    }

READ(fmi2GetContinuousStates, unit->real[1])
READ(fmi2GetDerivatives, unit->real[0] - unit->real[1])
READ(fmi2GetEventIndicators, 1.0)
READ(fmi2GetNominalsOfContinuousStates, 1.0)

typedef struct { int needed, terminate, nominals, values, timed; double next; } EventInfo;

int fmi2NewDiscreteStates(Unit *unit, EventInfo *info) {
    const char *function = "fmi2NewDiscreteStates";
    memset(info, 0, sizeof *info);
    info->needed = asked(function, "again", unit);
    info->terminate = asked(function, "end", unit);
    info->values = asked(function, "values", unit);
    info->nominals = asked(function, "nominals", unit);
    info->timed = 1;
    if (asked(function, "past", unit)) info->next = unit->time - 1.0;
    else if (asked(function, "now", unit)) info->next = unit->time;
    else if (asked(function, "dense", unit)) info->next = unit->time + 1e-15;
    else if (asked(function, "often", unit)) info->next = unit->time + 1e-7;
    else if (asked(function, "nantime", unit)) info->next = 0.0 / never;
    else if (asked(function, "inftime", unit)) info->next = 1.0 / never;
    else info->timed = 0;
    return fault(function, unit, NULL, 0);
}

int fmi2CompletedIntegratorStep(Unit *unit, int keep, int *event, int *end) {
    (void)keep;
    *event = asked("fmi2CompletedIntegratorStep", "event", unit);
    *end = asked("fmi2CompletedIntegratorStep", "end", unit);
    return fault("fmi2CompletedIntegratorStep", unit, NULL, 0);
}
