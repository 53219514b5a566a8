/* A small FMI 2.0 library for the tests of the importer. Its answers are told by the value of the string variable 0
 * ("trace" file, one line per call) and by macros at compile time:
 *   NO_FREE_INSTANCE  leaves out fmi2FreeInstance
 *   VERSION           answer of fmi2GetVersion
 *   STATUS_OF_STEP    answer of fmi2DoStep, STATUS_OF_SET answer of fmi2SetReal
 * fmi2Instantiate returns NULL for any guid but "right". */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef VERSION
#define VERSION "2.0"
#endif
#ifndef STATUS_OF_STEP
#define STATUS_OF_STEP 0
#endif
#ifndef STATUS_OF_SET
#define STATUS_OF_SET 0
#endif

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} Callbacks;

typedef struct {
    Callbacks callbacks;
    char trace[4096];
} Instance;

static void trace(Instance *it, const char *function) {
    if (it->trace[0] != '\0') {
        FILE *file = fopen(it->trace, "a");
        if (file != NULL) {
            fprintf(file, "%s\n", function);
            fclose(file);
        }
    }
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return VERSION; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                      int visible, int logging) {
    Instance *it;
    if (strcmp(guid, "right") != 0) {
        callbacks->logger(callbacks->environment, name, 3, "logStatusError", "guid %s, wanted %s (%d%%)", guid, "right",
                          100);
        callbacks->logger(callbacks->environment, NULL, 3, NULL, NULL);
        return NULL;
    }
    it = callbacks->allocate(1, sizeof *it);
    it->callbacks = *callbacks;
    (void)type, (void)resources, (void)visible, (void)logging;
    return it;
}

#ifndef NO_FREE_INSTANCE
void fmi2FreeInstance(Instance *it) {
    trace(it, "fmi2FreeInstance");
    it->callbacks.release(it);
}
#endif

#define SIMPLE(function)                                                                                               \
    int function(Instance *it) {                                                                                       \
        trace(it, #function);                                                                                          \
        return 0;                                                                                                      \
    }
#define NOTHING(function)                                                                                              \
    int function(Instance *it) {                                                                                       \
        trace(it, #function);                                                                                          \
        return 3;                                                                                                      \
    }

SIMPLE(fmi2SetupExperiment)
SIMPLE(fmi2EnterInitializationMode)
SIMPLE(fmi2ExitInitializationMode)
SIMPLE(fmi2Terminate)
SIMPLE(fmi2Reset)
SIMPLE(fmi2SetDebugLogging)
NOTHING(fmi2GetReal)
NOTHING(fmi2GetInteger)
NOTHING(fmi2GetBoolean)
NOTHING(fmi2GetString)
NOTHING(fmi2SetInteger)
NOTHING(fmi2SetBoolean)

int fmi2SetReal(Instance *it, const unsigned *references, size_t count, const double *values) {
    (void)references, (void)count, (void)values;
    trace(it, "fmi2SetReal");
    return STATUS_OF_SET;
}

int fmi2SetString(Instance *it, const unsigned *references, size_t count, const char *const *values) {
    (void)references;
    if (count == 1 && strlen(values[0]) < sizeof it->trace) {
        strcpy(it->trace, values[0]);
    }
    return 0;
}

int fmi2DoStep(Instance *it, double time, double step, int no_set_state) {
    int message;
    (void)time, (void)step, (void)no_set_state;
    trace(it, "fmi2DoStep");
    for (message = 0; message < 300; ++message) {
        it->callbacks.logger(it->callbacks.environment, "it", 0, "logAll", "message %d of step %g", message, step);
    }
    return STATUS_OF_STEP;
}
