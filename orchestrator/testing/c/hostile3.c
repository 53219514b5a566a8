/* The FMU of `hostile.c` by FMI 3.0: der(x) = u - x, y = x, both interfaces; it misbehaves as HOSTILE says (`hostile.h`).
 *
 * Float64: 0 u (input), 1 x (state), 2 der(x), 3 y (output), 4 indicator, 5 time. String: 6 s (output). */

#define _GNU_SOURCE
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void (*Logger)(void *, int, const char *, const char *);
typedef void (*Update)(void *, double, bool, bool, bool, bool, bool *, double *);

typedef struct {
    double real[6], time;
    void *environment;
    Logger logger;
    Update update;
} Unit;

#define SAY(unit, name, status, category, text) \
    do { if ((unit) != NULL && (unit)->logger != NULL) (unit)->logger((unit)->environment, status, category, text); } while (0)

#include "hostile.h"

typedef const unsigned *Refs;

const char *fmi3GetVersion(void) {
    fault("fmi3GetVersion", NULL, NULL, 0);
    return asked("fmi3GetVersion", "null", NULL) ? NULL : asked("fmi3GetVersion", "bytes", NULL) ? "\xff\033[1m" : "3.0";
}

static Unit *instance(void *environment, Logger logger, Update update) {
    Unit *unit = calloc(1, sizeof *unit);
    unit->environment = environment;
    unit->logger = logger;
    unit->update = update;
    unit->real[1] = 1.0;
    return fault("fmi3Instantiate", unit, NULL, 0) > 0 ? NULL : unit;
}

void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                   void *environment, Logger logger) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    return instance(environment, logger, NULL);
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, Refs required, size_t count, void *environment, Logger logger,
                                  Update update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)count;
    return instance(environment, logger, update);
}

void fmi3FreeInstance(Unit *unit) {
    fault("fmi3FreeInstance", unit, NULL, 0);
    free(unit);
}

#define SIMPLE(function) \
    int function(Unit *unit) { return fault(#function, unit, NULL, 0); }

SIMPLE(fmi3ExitInitializationMode)
SIMPLE(fmi3Terminate)
SIMPLE(fmi3Reset)
SIMPLE(fmi3EnterEventMode)
SIMPLE(fmi3EnterContinuousTimeMode)
SIMPLE(fmi3EnterConfigurationMode)
SIMPLE(fmi3ExitConfigurationMode)

int fmi3SetDebugLogging(Unit *unit, bool on, size_t count, const char *const *categories) {
    (void)on, (void)count, (void)categories;
    return fault("fmi3SetDebugLogging", unit, NULL, 0);
}

int fmi3EnterInitializationMode(Unit *unit, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    unit->time = start;
    return fault("fmi3EnterInitializationMode", unit, NULL, 0);
}

int fmi3GetFloat64(Unit *unit, Refs references, size_t count, double *values, size_t length) {
    int status = fault("fmi3GetFloat64", unit, values, length);
    unit->real[2] = unit->real[0] - unit->real[1];
    unit->real[3] = unit->real[1];
    unit->real[4] = 1.0;
    unit->real[5] = unit->time;
    for (size_t k = 0; status == 0 && k < count; ++k) values[k] = unit->real[references[k]];
    return status < 0 ? 0 : status;
}

int fmi3SetFloat64(Unit *unit, Refs references, size_t count, const double *values, size_t length) {
    (void)length;
    for (size_t k = 0; k < count; ++k) unit->real[references[k]] = values[k];
    return fault("fmi3SetFloat64", unit, NULL, 0);
}

int fmi3GetString(Unit *unit, Refs references, size_t count, const char **values, size_t length) {
    int is_null;
    const char *strange = strange_text("fmi3GetString", unit, &is_null);
    (void)references, (void)length;
    for (size_t k = 0; k < count; ++k) values[k] = is_null ? NULL : strange != NULL ? strange : "text";
    return fault("fmi3GetString", unit, NULL, 0);
}

int fmi3GetFMUState(Unit *unit, void **state) { return save_state("fmi3GetFMUState", unit, state); }
int fmi3SetFMUState(Unit *unit, void *state) {
    Unit now = *unit;
    memcpy(unit, state, sizeof *unit);
    unit->environment = now.environment, unit->logger = now.logger, unit->update = now.update;
    return fault("fmi3SetFMUState", unit, NULL, 0);
}
int fmi3FreeFMUState(Unit *unit, void **state) { return free_state("fmi3FreeFMUState", unit, state); }
int fmi3SerializedFMUStateSize(Unit *unit, void *state, size_t *size) {
    (void)state;
    return size_of_state("fmi3SerializedFMUStateSize", unit, size);
}
int fmi3SerializeFMUState(Unit *unit, void *state, uint8_t *bytes, size_t size) {
    return write_state("fmi3SerializeFMUState", unit, state, bytes, size);
}
int fmi3DeserializeFMUState(Unit *unit, const uint8_t *bytes, size_t size, void **state) {
    return read_state("fmi3DeserializeFMUState", unit, bytes, size, state);
}

int fmi3GetDirectionalDerivative(Unit *unit, Refs unknowns, size_t rows, Refs knowns, size_t columns, const double *seed,
                                 size_t seeds, double *out, size_t outs) {
    (void)seeds;
    return derivatives("fmi3GetDirectionalDerivative", unit, unknowns, rows, knowns, columns, seed, out, outs);
}

int fmi3GetOutputDerivatives(Unit *unit, Refs references, size_t count, const int32_t *orders, double *values, size_t length) {
    int status = fault("fmi3GetOutputDerivatives", unit, values, length);
    (void)references, (void)count, (void)orders;
    for (size_t k = 0; status == 0 && k < length; ++k) values[k] = unit->real[0] - unit->real[1];
    return status < 0 ? 0 : status;
}

int fmi3DoStep(Unit *unit, double t, double h, bool keep, bool *event, bool *terminate, bool *early, double *last) {
    const char *function = "fmi3DoStep";
    (void)keep;
    unit->time = t;
    *event = asked(function, "event", unit);
    *terminate = asked(function, "end", unit);
    *early = false;
    *last = t + h;
    if (asked(function, "early", unit)) { *early = true; *last = t; return 0; }
    if (asked(function, "back", unit)) { *early = true; *last = t - 1.0; return 0; }
    if (asked(function, "nanlast", unit)) { *early = true; *last = 0.0 / never; return 0; }
    if (asked(function, "crumbs", unit)) { *early = true; *last = t + 1e-12; return 0; }
    if (asked(function, "flags", unit)) memset(early, 0x55, 1);
    if (asked(function, "update", unit) && unit->update != NULL) {
        bool wanted = true;
        double when = 0.0;
        for (int k = 0; k < 100000; ++k) unit->update(unit->environment, 0.0 / never, true, true, true, true, &wanted, &when);
    }
    if (asked(function, "updatenull", unit) && unit->update != NULL)
        unit->update(NULL, t, false, false, false, false, NULL, NULL);
    int status = fault(function, unit, NULL, 0);
    if (status > 1) return status;
    unit->real[1] += h * (unit->real[0] - unit->real[1]);
    unit->time = t + h;
    return status;
}

int fmi3SetTime(Unit *unit, double time) {
    unit->time = time;
    return fault("fmi3SetTime", unit, NULL, 0);
}

int fmi3SetContinuousStates(Unit *unit, const double *states, size_t count) {
    for (size_t k = 0; k < count; ++k) unit->real[1 + k] = states[k];
    return fault("fmi3SetContinuousStates", unit, NULL, 0);
}

#define READ(function, value) \
    int function(Unit *unit, double *values, size_t count) { \
        int status = fault(#function, unit, values, count); \
        for (size_t k = 0; status == 0 && k < count; ++k) values[k] = value; \
        return status < 0 ? 0 : status; \
    }

READ(fmi3GetContinuousStates, unit->real[1])
READ(fmi3GetContinuousStateDerivatives, unit->real[0] - unit->real[1])
READ(fmi3GetEventIndicators, 1.0)
READ(fmi3GetNominalsOfContinuousStates, 1.0)

int fmi3GetNumberOfContinuousStates(Unit *unit, size_t *count) {
    *count = asked("fmi3GetNumberOfContinuousStates", "endless", unit) ? (size_t)-1 : 1;
    return fault("fmi3GetNumberOfContinuousStates", unit, NULL, 0);
}
int fmi3GetNumberOfEventIndicators(Unit *unit, size_t *count) {
    *count = asked("fmi3GetNumberOfEventIndicators", "endless", unit) ? (size_t)-1 : 1;
    return fault("fmi3GetNumberOfEventIndicators", unit, NULL, 0);
}

int fmi3UpdateDiscreteStates(Unit *unit, bool *needed, bool *terminate, bool *nominals, bool *values, bool *timed, double *next) {
    const char *function = "fmi3UpdateDiscreteStates";
    *needed = asked(function, "again", unit);
    *terminate = asked(function, "end", unit);
    *values = asked(function, "values", unit);
    *nominals = asked(function, "nominals", unit);
    *timed = true;
    if (asked(function, "past", unit)) *next = unit->time - 1.0;
    else if (asked(function, "now", unit)) *next = unit->time;
    else if (asked(function, "dense", unit)) *next = unit->time + 1e-15;
    else if (asked(function, "often", unit)) *next = unit->time + 1e-7;
    else if (asked(function, "nantime", unit)) *next = 0.0 / never;
    else if (asked(function, "inftime", unit)) *next = 1.0 / never;
    else *timed = false;
    return fault(function, unit, NULL, 0);
}

int fmi3CompletedIntegratorStep(Unit *unit, bool keep, bool *event, bool *end) {
    (void)keep;
    *event = asked("fmi3CompletedIntegratorStep", "event", unit);
    *end = asked("fmi3CompletedIntegratorStep", "end", unit);
    return fault("fmi3CompletedIntegratorStep", unit, NULL, 0);
}
