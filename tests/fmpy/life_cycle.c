/* A short life-cycle of one FMU for valgrind: life_cycle LIBRARY KIND GUID RESOURCES STEP NSTATES
 *
 * KIND 0 is Model Exchange, 1 is Co-Simulation. Declares the few functions it needs itself, so that no header of the
 * standard is needed to compile it. Exit code 1 when a call does not return fmi2OK.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

typedef void *Component;
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;
typedef struct {
    int new_discrete_states_needed, terminate, nominals_changed, values_changed, next_event_time_defined;
    double next_event_time;
} EventInfo;

static void *library;

static void print(void *environment, const char *instance, int status, const char *category, const char *message, ...)
{
    va_list arguments;
    (void)environment;
    va_start(arguments, message);
    printf("%s, status %d, %s: ", instance, status, category);
    vprintf(message, arguments);
    printf("\n");
    va_end(arguments);
}

static void *find(const char *name)
{
    void *symbol = dlsym(library, name);
    if (!symbol) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    return symbol;
}

static void must(const char *name, int status)
{
    if (status != 0) {
        fprintf(stderr, "%s returned %d\n", name, status);
        exit(1);
    }
}

#define CALL(name, types, ...) must(#name, ((int(*) types)find(#name))(__VA_ARGS__))

int main(int argc, char **argv)
{
    if (argc != 7)
        return 2;
    int kind = atoi(argv[2]), n_states = atoi(argv[6]);
    double step = atof(argv[5]);
    Callbacks callbacks = {print, calloc, free, NULL, NULL};

    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    for (int round = 0; round < 2; round++) {
        Component c = ((Component(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))find(
            "fmi2Instantiate"))("valgrind", kind, argv[3], argv[4], &callbacks, 0, 1);
        void *state = NULL, *other = NULL;
        size_t size = 0;
        if (!c)
            return 1;
        CALL(fmi2SetupExperiment, (Component, int, double, double, int, double), c, 0, 0.0, 0.0, 0, 0.0);
        CALL(fmi2EnterInitializationMode, (Component), c);
        CALL(fmi2ExitInitializationMode, (Component), c);
        CALL(fmi2GetFMUstate, (Component, void **), c, &state);
        if (kind == 1) {
            for (int k = 0; k < 5; k++)
                CALL(fmi2DoStep, (Component, double, double, int), c, k * step, step, 0);
        } else {
            EventInfo info = {1, 0, 0, 0, 0, 0.0};
            double *x = malloc((size_t)(n_states + 1) * sizeof *x), *dx = malloc((size_t)(n_states + 1) * sizeof *dx);
            while (info.new_discrete_states_needed)
                CALL(fmi2NewDiscreteStates, (Component, EventInfo *), c, &info);
            CALL(fmi2EnterContinuousTimeMode, (Component), c);
            for (int k = 0; k < 5; k++) {
                int event = 0, end = 0;
                CALL(fmi2GetContinuousStates, (Component, double *, size_t), c, x, (size_t)n_states);
                CALL(fmi2GetDerivatives, (Component, double *, size_t), c, dx, (size_t)n_states);
                CALL(fmi2SetTime, (Component, double), c, (k + 1) * step);
                for (int i = 0; i < n_states; i++)
                    x[i] += step * dx[i];
                CALL(fmi2SetContinuousStates, (Component, const double *, size_t), c, x, (size_t)n_states);
                CALL(fmi2CompletedIntegratorStep, (Component, int, int *, int *), c, 1, &event, &end);
            }
            free(x);
            free(dx);
        }
        CALL(fmi2SerializedFMUstateSize, (Component, void *, size_t *), c, state, &size);
        char *bytes = malloc(size);
        CALL(fmi2SerializeFMUstate, (Component, void *, char *, size_t), c, state, bytes, size);
        CALL(fmi2DeSerializeFMUstate, (Component, const char *, size_t, void **), c, bytes, size, &other);
        CALL(fmi2SetFMUstate, (Component, void *), c, other);
        CALL(fmi2FreeFMUstate, (Component, void **), c, &other);
        CALL(fmi2FreeFMUstate, (Component, void **), c, &state);
        free(bytes);
        CALL(fmi2Terminate, (Component), c);
        CALL(fmi2Reset, (Component), c);
        ((void (*)(Component))find("fmi2FreeInstance"))(c);
    }
    /* The library stays loaded, so that valgrind can name its functions. */
    return 0;
}
