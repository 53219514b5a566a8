/* A small FMI 2.0 Co-Simulation library for the tests of the master.
 *
 * Real:    0 u (input), 1 y = gain u (output, follows u also in initialization mode), 2 gain (parameter),
 *          3 x (state, dx/dt = u, explicit Euler over the step), 4 held = u at the start of the step (discrete output),
 *          5 when (parameter, time of the misbehavior)
 * Integer: 0 i (input), 1 j = i + 1 (output), 2 how (parameter, misbehavior at the first step that ends after `when`:
 *          0 none, 1 fmi2Discard, 2 fmi2Discard and terminated, 3 fmi2Error, 4 fmi2Fatal, 5 fmi2Pending, 6 y is NaN)
 * Boolean: 0 b (input), 1 c = !b (output)
 * String:  0 s (input), 1 t = s (output)
 */

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    void *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
} Callbacks;

typedef struct {
    double real[6];
    int integer[3];
    int boolean[2];
    char text[256];
    double reached;
    int terminated;
    int broken;
} Slave;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                      int visible, int logging) {
    Slave *slave = calloc(1, sizeof *slave);
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    slave->real[2] = 1.0;
    slave->real[5] = 1e300;
    return slave;
}

void fmi2FreeInstance(Slave *slave) { free(slave); }

int fmi2SetupExperiment(Slave *slave, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    slave->reached = start;
    return 0;
}

int fmi2EnterInitializationMode(Slave *slave) { return slave == NULL; }
int fmi2ExitInitializationMode(Slave *slave) { return slave == NULL; }
int fmi2Terminate(Slave *slave) { return slave == NULL; }
int fmi2Reset(Slave *slave) { return slave == NULL; }

int fmi2GetReal(Slave *slave, const unsigned *references, size_t count, double *values) {
    size_t k;
    slave->real[1] = slave->broken ? NAN : slave->real[2] * slave->real[0];
    for (k = 0; k < count; ++k) values[k] = slave->real[references[k]];
    return 0;
}

int fmi2SetReal(Slave *slave, const unsigned *references, size_t count, const double *values) {
    size_t k;
    for (k = 0; k < count; ++k) slave->real[references[k]] = values[k];
    return 0;
}

int fmi2GetInteger(Slave *slave, const unsigned *references, size_t count, int *values) {
    size_t k;
    slave->integer[1] = slave->integer[0] + 1;
    for (k = 0; k < count; ++k) values[k] = slave->integer[references[k]];
    return 0;
}

int fmi2SetInteger(Slave *slave, const unsigned *references, size_t count, const int *values) {
    size_t k;
    for (k = 0; k < count; ++k) slave->integer[references[k]] = values[k];
    return 0;
}

int fmi2GetBoolean(Slave *slave, const unsigned *references, size_t count, int *values) {
    size_t k;
    slave->boolean[1] = !slave->boolean[0];
    for (k = 0; k < count; ++k) values[k] = slave->boolean[references[k]];
    return 0;
}

int fmi2SetBoolean(Slave *slave, const unsigned *references, size_t count, const int *values) {
    size_t k;
    for (k = 0; k < count; ++k) slave->boolean[references[k]] = values[k];
    return 0;
}

int fmi2GetString(Slave *slave, const unsigned *references, size_t count, const char **values) {
    size_t k;
    (void)references;
    for (k = 0; k < count; ++k) values[k] = slave->text;
    return 0;
}

int fmi2SetString(Slave *slave, const unsigned *references, size_t count, const char *const *values) {
    (void)references;
    if (count > 0) strncpy(slave->text, values[0], sizeof slave->text - 1);
    return 0;
}

int fmi2DoStep(Slave *slave, double time, double step, int no_set_state) {
    (void)no_set_state;
    if (fabs(time - slave->reached) > 1e-9) return 3;
    if (time + step > slave->real[5]) {
        switch (slave->integer[2]) {
        case 1: slave->reached = slave->real[5]; return 2;
        case 2: slave->reached = slave->real[5]; slave->terminated = 1; return 2;
        case 3: return 3;
        case 4: return 4;
        case 5: return 5;
        case 6: slave->broken = 1; break;
        default: break;
        }
    }
    slave->real[3] += step * slave->real[0];
    slave->real[4] = slave->real[0];
    slave->reached = time + step;
    return 0;
}

int fmi2GetRealStatus(Slave *slave, int kind, double *value) {
    if (kind != 2) return 2;
    *value = slave->reached;
    return 0;
}

int fmi2GetBooleanStatus(Slave *slave, int kind, int *value) {
    if (kind != 3) return 2;
    *value = slave->terminated;
    return 0;
}
