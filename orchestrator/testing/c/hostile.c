/* An FMU that misbehaves as the environment variable HOSTILE says: `function:fault` or `function:fault:time`, where
 * `load` and `unload` are functions, too, and a time [s] is that of the instance. Without it: der(x) = u - x, y = x,
 * by both interfaces.
 *
 * Real: 0 u (input), 1 x (state), 2 der(x), 3 y (output). String: 0 s (parameter, never set: NULL). */

#define _GNU_SOURCE
#include <fenv.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

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

static volatile double never;
static volatile int zero;

static void *idle(void *nothing) {
    for (;;) usleep(1000);
    return nothing;
}

static int deep(int n) {
    volatile char room[65536];
    room[0] = (char)n;
    return n < 0 ? room[0] : deep(n + 1) + room[0];
}

/* Does what is asked; the status for the function, 0 for none. */
static int fault(const char *function, Unit *unit, double *values, size_t count) {
    const char *wish = getenv("HOSTILE");
    char place[64], what[64];
    double time = -1e300;
    if (wish == NULL || sscanf(wish, "%63[^:]:%63[^:]:%lf", place, what, &time) < 2) return 0;
    if (strcmp(place, function) != 0 || (unit != NULL && unit->time < time)) return 0;
    if (strcmp(what, "segv") == 0) *(volatile int *)8 = 1;
    if (strcmp(what, "abort") == 0) abort();
    if (strcmp(what, "exit0") == 0) exit(0);
    if (strcmp(what, "exit3") == 0) exit(3);
    if (strcmp(what, "_exit") == 0) _exit(0);
    if (strcmp(what, "loop") == 0) for (;;) never += 1;
    if (strcmp(what, "sleep") == 0) for (;;) pause();
    if (strcmp(what, "stop") == 0) raise(SIGSTOP);
    if (strcmp(what, "kill") == 0) raise(SIGKILL);
    if (strcmp(what, "term") == 0) raise(SIGTERM);
    if (strcmp(what, "trap") == 0) __builtin_trap();
    if (strcmp(what, "fpe") == 0) zero = 1 / zero;
    if (strcmp(what, "alarm") == 0) { alarm(1); for (;;) pause(); }
    if (strcmp(what, "stack") == 0) return deep(1) == 0;
    if (strcmp(what, "free") == 0) { free(unit); free(unit); }
    if (strcmp(what, "memory") == 0) {
        char *much = malloc(8ul << 30);
        for (size_t k = 0; k < 8ul << 30; k += 4096) much[k] = 1;
    }
    if (strcmp(what, "flood") == 0) for (int k = 0; k < 200000; ++k) printf("a line of a flood on the standard output\n");
    if (strcmp(what, "says") == 0) { fprintf(stderr, "the valve is stuck\n"); abort(); }
    if (strcmp(what, "shared") == 0) { char junk[65536]; memset(junk, 0xff, sizeof junk); (void)!pwrite(3, junk, sizeof junk, 0); }
    if (strcmp(what, "shrink") == 0) (void)!ftruncate(3, 0);
    if (strcmp(what, "close") == 0) for (int k = 0; k < 64; ++k) close(k);
    if (strcmp(what, "round") == 0) fesetround(FE_UPWARD);
    if (strcmp(what, "thread") == 0) { pthread_t one; pthread_create(&one, NULL, idle, NULL); }
    if (strcmp(what, "fork") == 0 && fork() == 0) for (;;) pause();
    if (strcmp(what, "file") == 0) fclose(fopen("left_behind.txt", "w"));
    if (strcmp(what, "logn") == 0) unit->callbacks->logger(unit->callbacks->environment, "m", 0, "c", "a %n b");
    if (strcmp(what, "logs") == 0) unit->callbacks->logger(unit->callbacks->environment, "m", 3, "c", "%s %s %s %s %s %s %d");
    if (strcmp(what, "lognull") == 0) unit->callbacks->logger(unit->callbacks->environment, NULL, 9, NULL, NULL);
    if (strcmp(what, "logflood") == 0) for (int k = 0; k < 100000; ++k) unit->callbacks->logger(unit->callbacks->environment, "m", 0, "c", "line %d", k);
    if (strcmp(what, "over") == 0 && values != NULL) for (size_t k = 0; k < count + 100000; ++k) values[k] = 1.0;
    if (strcmp(what, "nan") == 0 && values != NULL) { for (size_t k = 0; k < count; ++k) values[k] = 0.0 / never; return -1; }
    if (strcmp(what, "inf") == 0 && values != NULL) { for (size_t k = 0; k < count; ++k) values[k] = 1.0 / never; return -1; }
    if (strcmp(what, "discard") == 0) return 2;
    if (strcmp(what, "error") == 0) return 3;
    if (strcmp(what, "fatal") == 0) return 4;
    if (strcmp(what, "pending") == 0) return 5;
    if (strcmp(what, "strange") == 0) return 77;
    return 0;
}

__attribute__((constructor)) static void load(void) { fault("load", NULL, NULL, 0); }
__attribute__((destructor)) static void unload(void) { fault("unload", NULL, NULL, 0); }

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

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
    (void)references;
    for (size_t k = 0; k < count; ++k) values[k] = NULL;
    return fault("fmi2GetString", unit, NULL, 0);
}

int fmi2GetInteger(Unit *unit, const unsigned *r, size_t n, int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetInteger(Unit *unit, const unsigned *r, size_t n, const int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2GetBoolean(Unit *unit, const unsigned *r, size_t n, int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetBoolean(Unit *unit, const unsigned *r, size_t n, const int *v) { (void)unit, (void)r, (void)n, (void)v; return 3; }
int fmi2SetString(Unit *unit, const unsigned *r, size_t n, const char **v) { (void)unit, (void)r, (void)n, (void)v; return 3; }

int fmi2DoStep(Unit *unit, double t, double h, int keep) {
    (void)keep;
    unit->time = t;
    int status = fault("fmi2DoStep", unit, NULL, 0);
    if (status > 1) return status;
    unit->real[1] += h * (unit->real[0] - unit->real[1]);
    unit->time = t + h;
    return 0;
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

int fmi2NewDiscreteStates(Unit *unit, int *info) {
    memset(info, 0, 32);
    return fault("fmi2NewDiscreteStates", unit, NULL, 0);
}

int fmi2CompletedIntegratorStep(Unit *unit, int keep, int *event, int *end) {
    (void)keep;
    *event = *end = 0;
    return fault("fmi2CompletedIntegratorStep", unit, NULL, 0);
}
