/* A slide behind a drive as an FMU 2.0 of Co-Simulation only, with fixed steps of its own: semi-implicit Euler. */
#include <stdlib.h>

enum { U, LOAD, X, V, MASS, DAMPING, FORCE, LATE, X0, COUNT };
static const double START[COUNT] = {0, 0, 0, 0, 1.5, 6.0, 20.0, 0.05, 0};
static const double STEP = 2e-4;

typedef struct {
    double value[COUNT], push;
} Slide;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const list[]) { return 0; }
int fmi2Reset(void *c) {
    Slide *own = c;
    for (int k = 0; k < COUNT; k++) own->value[k] = START[k];
    own->push = 0;
    return 0;
}
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, const void *calls, int shown, int log) {
    void *own = kind == 1 ? malloc(sizeof(Slide)) : NULL;
    if (own) fmi2Reset(own);
    return own;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int tolerant, double tolerance, double from, int ends, double to) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) {
    Slide *own = c;
    own->value[X] = own->value[X0];
    return 0;
}
int fmi2Terminate(void *c) { return 0; }
int fmi2GetReal(void *c, const unsigned list[], size_t n, double value[]) {
    for (size_t k = 0; k < n; k++) value[k] = ((Slide *)c)->value[list[k]];
    return 0;
}
int fmi2SetReal(void *c, const unsigned list[], size_t n, const double value[]) {
    for (size_t k = 0; k < n; k++) ((Slide *)c)->value[list[k]] = value[k];
    return 0;
}
int fmi2DoStep(void *c, double time, double step, int never_back) {
    Slide *own = c;
    double *value = own->value;
    for (long left = (long)(step / STEP + 0.5); left > 0; left--) {
        own->push += STEP * (value[FORCE] * value[U] - own->push) / value[LATE];
        value[V] += STEP * (own->push + value[LOAD] - value[DAMPING] * value[V]) / value[MASS];
        value[X] += STEP * value[V];
    }
    return 0;
}
/* The interface asks for functions that this FMU refuses. */
#define REFUSED(name) \
    int fmi2##name(void) { return 3; }
REFUSED(GetInteger) REFUSED(GetBoolean) REFUSED(GetString) REFUSED(SetInteger) REFUSED(SetBoolean) REFUSED(SetString)
REFUSED(GetFMUstate) REFUSED(SetFMUstate) REFUSED(FreeFMUstate) REFUSED(SerializedFMUstateSize) REFUSED(SerializeFMUstate)
REFUSED(DeSerializeFMUstate) REFUSED(GetDirectionalDerivative) REFUSED(SetRealInputDerivatives) REFUSED(GetRealOutputDerivatives)
REFUSED(CancelStep) REFUSED(GetStatus) REFUSED(GetRealStatus) REFUSED(GetIntegerStatus) REFUSED(GetBooleanStatus)
REFUSED(GetStringStatus)
