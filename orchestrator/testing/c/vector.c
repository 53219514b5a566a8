/* An FMU of FMI 3.0 with arrays and variables of all types, both interfaces.
 *
 *   der(x) = A x + u      y = 2 x + u      (n elements each, A n by n row by row; n is a structural parameter)
 *   every scalar output `*_out` is its input `*_in`
 *   count: number of time events so far, one every 0.25 s; below: whether x[1] < 0.5, by a state event
 *
 * Co-Simulation is ten explicit Euler steps for each communication step. With early = true a step returns early in its
 * middle, whether that is allowed or not. `updates` counts the intermediate updates that were answered with "go on".
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define MAX 4

typedef void *fmi3Instance;
typedef uint32_t Ref;
typedef int Status;
enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef void (*Logger)(void *, Status, const char *, const char *);
typedef void (*Update)(void *, double, bool, bool, bool, bool, bool *, double *);

typedef enum { INSTANTIATED, CONFIGURATION, INITIALIZATION, EVENT, CONTINUOUS, STEP, TERMINATED } Mode;

enum { TIME, N, A, U, X, DERX, Y, EARLY = 40, UPDATES, COUNT, INDICATOR, BELOW };

typedef struct {
    uint64_t n;
    double a[MAX * MAX], u[MAX], x[MAX];
    float f32;
    int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32; uint32_t u32; int64_t i64; uint64_t u64;
    bool flag, early, below;
    int64_t choice;
    char text[64];
    uint8_t bytes[16];
    size_t length;
    int32_t updates, count;
    double time, next;
} Data;

typedef struct {
    Data d;
    Mode mode;
    bool cs;
    void *environment;
    Logger log;
    Update update;
} Vector;

static Status refuse(Vector *v, const char *message) {
    if (v->log) v->log(v->environment, ERROR, "logStatusError", message);
    return ERROR;
}

static void start(Data *d) {
    static const double a[] = {1, 2, 3, 4}, x[] = {1, -1};
    memset(d, 0, sizeof *d);
    d->n = 2;
    memcpy(d->a, a, sizeof a);
    memcpy(d->bytes, "\x00\xff\x10", d->length = 3);
    memcpy(d->x, x, sizeof x);
    d->choice = 1;
    strcpy(d->text, "start");
    d->next = 0.25;
}

static void rate(const Data *d, double *out) {
    for (uint64_t i = 0; i < d->n; i++) {
        out[i] = d->u[i];
        for (uint64_t j = 0; j < d->n; j++) out[i] += d->a[i * d->n + j] * d->x[j];
    }
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

static Vector *make(const char *token, const char *resources, void *environment, Logger log) {
    if (strcmp(token, "vector") != 0) {
        if (log) log(environment, ERROR, "logStatusError", "wrong token");
        return NULL;
    }
    if (!resources || resources[0] != '/' || resources[strlen(resources) - 1] != '/') {
        if (log) log(environment, ERROR, "logStatusError", "the path of the resources is not a folder");
        return NULL;
    }
    Vector *v = calloc(1, sizeof *v);
    start(&v->d);
    v->environment = environment;
    v->log = log;
    return v;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources,
                                                 bool visible, bool logging, void *environment, Logger log) {
    (void)name; (void)visible; (void)logging;
    return make(token, resources, environment, log);
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                                bool visible, bool logging, bool event_mode, bool early_return,
                                                const Ref *intermediate, size_t intermediates, void *environment,
                                                Logger log, Update update) {
    (void)name; (void)visible; (void)logging; (void)intermediate;
    if (event_mode || early_return || intermediates) return NULL;
    Vector *v = make(token, resources, environment, log);
    if (v) { v->cs = true; v->update = update; }
    return v;
}

EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }
EXPORT Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t n, const char **categories) {
    (void)c; (void)on; (void)n; (void)categories;
    return OK;
}

EXPORT Status fmi3EnterConfigurationMode(fmi3Instance c) {
    Vector *v = c;
    if (v->mode != INSTANTIATED) return refuse(v, "configuration mode after instantiation only");
    v->mode = CONFIGURATION;
    return OK;
}
EXPORT Status fmi3ExitConfigurationMode(fmi3Instance c) {
    Vector *v = c;
    if (v->mode != CONFIGURATION) return refuse(v, "not in configuration mode");
    v->mode = INSTANTIATED;
    return OK;
}
EXPORT Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance, double begin,
                                          bool has_stop, double stop) {
    Vector *v = c;
    (void)has_tolerance; (void)tolerance; (void)has_stop; (void)stop;
    if (v->mode != INSTANTIATED) return refuse(v, "initialization mode after instantiation only");
    v->mode = INITIALIZATION;
    v->d.time = begin;
    v->d.next = begin + 0.25;
    return OK;
}
EXPORT Status fmi3ExitInitializationMode(fmi3Instance c) {
    Vector *v = c;
    if (v->mode != INITIALIZATION) return refuse(v, "not in initialization mode");
    v->mode = v->cs ? STEP : EVENT;
    v->d.below = v->d.x[0] < 0.5;
    return OK;
}
EXPORT Status fmi3EnterEventMode(fmi3Instance c) {
    Vector *v = c;
    if (v->mode != CONTINUOUS) return refuse(v, "event mode from continuous-time mode only");
    v->mode = EVENT;
    return OK;
}
EXPORT Status fmi3Terminate(fmi3Instance c) { ((Vector *)c)->mode = TERMINATED; return OK; }
EXPORT Status fmi3Reset(fmi3Instance c) {
    Vector *v = c;
    start(&v->d);
    v->mode = INSTANTIATED;
    return OK;
}

static void events(Data *d) {
    if (d->time + 1e-12 >= d->next) { d->count++; d->next += 0.25; }
    d->below = d->x[0] < 0.5;
}

#define PASS(NAME, TYPE, FIELD, REF)                                                                                \
    EXPORT Status fmi3Get##NAME(fmi3Instance c, const Ref *refs, size_t n, TYPE *values, size_t count) {            \
        if (n != count) return refuse(c, "lengths differ");                                                         \
        for (size_t i = 0; i < n; i++) {                                                                            \
            if (refs[i] / 2 != REF / 2) return refuse(c, "not a variable of type " #NAME);                          \
            values[i] = ((Vector *)c)->d.FIELD;                                                                     \
        }                                                                                                           \
        return OK;                                                                                                  \
    }                                                                                                               \
    EXPORT Status fmi3Set##NAME(fmi3Instance c, const Ref *refs, size_t n, const TYPE *values, size_t count) {      \
        if (n != count) return refuse(c, "lengths differ");                                                         \
        for (size_t i = 0; i < n; i++) {                                                                            \
            if (refs[i] != REF) return refuse(c, "not an input of type " #NAME);                                    \
            ((Vector *)c)->d.FIELD = values[i];                                                                     \
        }                                                                                                           \
        return OK;                                                                                                  \
    }

PASS(Int8, int8_t, i8, 10)
PASS(UInt8, uint8_t, u8, 12)
PASS(Int16, int16_t, i16, 14)
PASS(UInt16, uint16_t, u16, 16)
PASS(UInt32, uint32_t, u32, 20)
PASS(Float32, float, f32, 26)

EXPORT Status fmi3GetInt32(fmi3Instance c, const Ref *refs, size_t n, int32_t *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    if (n != count) return refuse(c, "lengths differ");
    for (size_t i = 0; i < n; i++) {
        switch (refs[i]) {
            case 18: case 19: values[i] = d->i32; break;
            case UPDATES: values[i] = d->updates; break;
            case COUNT: values[i] = d->count; break;
            default: return refuse(c, "not an Int32");
        }
    }
    return OK;
}
EXPORT Status fmi3SetInt32(fmi3Instance c, const Ref *refs, size_t n, const int32_t *values, size_t count) {
    for (size_t i = 0; i < n; i++) {
        if (refs[i] != 18 || n != count) return refuse(c, "not an Int32 input");
        ((Vector *)c)->d.i32 = values[i];
    }
    return OK;
}
EXPORT Status fmi3GetInt64(fmi3Instance c, const Ref *refs, size_t n, int64_t *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count || (refs[i] / 2 != 11 && refs[i] / 2 != 16)) return refuse(c, "not an Int64");
        values[i] = refs[i] / 2 == 11 ? d->i64 : d->choice;
    }
    return OK;
}
EXPORT Status fmi3SetInt64(fmi3Instance c, const Ref *refs, size_t n, const int64_t *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count || (refs[i] != 22 && refs[i] != 32)) return refuse(c, "not an Int64 input");
        if (refs[i] == 22) d->i64 = values[i]; else d->choice = values[i];
    }
    return OK;
}
EXPORT Status fmi3GetUInt64(fmi3Instance c, const Ref *refs, size_t n, uint64_t *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count || (refs[i] != N && refs[i] / 2 != 12)) return refuse(c, "not a UInt64");
        values[i] = refs[i] == N ? d->n : refs[i] == 24 ? d->u64 : d->u64 + ((uint64_t)d->flag << 40);
    }
    return OK;
}
EXPORT Status fmi3SetUInt64(fmi3Instance c, const Ref *refs, size_t n, const uint64_t *values, size_t count) {
    Vector *v = c;
    for (size_t i = 0; i < n; i++) {
        if (n != count || (refs[i] != N && refs[i] != 24)) return refuse(c, "not a UInt64 that can be set");
        if (refs[i] == 24) { v->d.u64 = values[i]; continue; }
        if (v->mode != CONFIGURATION) return refuse(c, "n outside of configuration mode");
        if (values[i] > MAX) return refuse(c, "n is too large");
        v->d.n = values[i];
        for (uint64_t j = 0; j < v->d.n; j++) v->d.x[j] = j % 2 ? -1 : 1;
    }
    return OK;
}
EXPORT Status fmi3GetBoolean(fmi3Instance c, const Ref *refs, size_t n, bool *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count) return refuse(c, "lengths differ");
        values[i] = refs[i] == EARLY ? d->early : refs[i] == BELOW ? d->below : d->flag;
    }
    return OK;
}
EXPORT Status fmi3SetBoolean(fmi3Instance c, const Ref *refs, size_t n, const bool *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count || (refs[i] != EARLY && refs[i] != 28)) return refuse(c, "not a Boolean that can be set");
        if (refs[i] == EARLY) d->early = values[i]; else d->flag = values[i];
    }
    return OK;
}
EXPORT Status fmi3GetString(fmi3Instance c, const Ref *refs, size_t n, const char **values, size_t count) {
    for (size_t i = 0; i < n; i++) {
        if (n != count || refs[i] / 2 != 15) return refuse(c, "not a String");
        values[i] = ((Vector *)c)->d.text;
    }
    return OK;
}
EXPORT Status fmi3SetString(fmi3Instance c, const Ref *refs, size_t n, const char **values, size_t count) {
    for (size_t i = 0; i < n; i++) {
        if (n != count || refs[i] != 30) return refuse(c, "not a String input");
        snprintf(((Vector *)c)->d.text, sizeof ((Vector *)c)->d.text, "%s", values[i]);
    }
    return OK;
}
EXPORT Status fmi3GetBinary(fmi3Instance c, const Ref *refs, size_t n, size_t *sizes, const uint8_t **values,
                            size_t count) {
    for (size_t i = 0; i < n; i++) {
        if (n != count || refs[i] / 2 != 26) return refuse(c, "not a Binary");
        sizes[i] = ((Vector *)c)->d.length;
        values[i] = ((Vector *)c)->d.bytes;
    }
    return OK;
}
EXPORT Status fmi3SetBinary(fmi3Instance c, const Ref *refs, size_t n, const size_t *sizes, const uint8_t **values,
                            size_t count) {
    Data *d = &((Vector *)c)->d;
    for (size_t i = 0; i < n; i++) {
        if (n != count || refs[i] != 52 || sizes[i] > sizeof d->bytes) return refuse(c, "not a Binary input, or too long");
        memcpy(d->bytes, values[i], sizes[i]);
        d->length = sizes[i];
    }
    return OK;
}

EXPORT Status fmi3GetFloat64(fmi3Instance c, const Ref *refs, size_t n, double *values, size_t count) {
    Data *d = &((Vector *)c)->d;
    size_t at = 0;
    for (size_t i = 0; i < n; i++) {
        size_t length = refs[i] == A ? d->n * d->n : refs[i] == TIME || refs[i] == INDICATOR ? 1 : d->n;
        if (at + length > count) return refuse(c, "too few values");
        switch (refs[i]) {
            case TIME: values[at] = d->time; break;
            case A: memcpy(values + at, d->a, length * sizeof *values); break;
            case U: memcpy(values + at, d->u, length * sizeof *values); break;
            case X: memcpy(values + at, d->x, length * sizeof *values); break;
            case DERX: rate(d, values + at); break;
            case Y: for (size_t j = 0; j < length; j++) values[at + j] = 2 * d->x[j] + d->u[j]; break;
            case INDICATOR: values[at] = d->x[0] - 0.5; break;
            default: return refuse(c, "not a Float64");
        }
        at += length;
    }
    return at == count ? OK : refuse(c, "too many values");
}
EXPORT Status fmi3SetFloat64(fmi3Instance c, const Ref *refs, size_t n, const double *values, size_t count) {
    Vector *v = c;
    Data *d = &v->d;
    size_t at = 0;
    for (size_t i = 0; i < n; i++) {
        size_t length = refs[i] == A ? d->n * d->n : d->n;
        double *target = refs[i] == A ? d->a : refs[i] == U ? d->u : refs[i] == X ? d->x : NULL;
        if (!target || at + length > count) return refuse(c, "not a Float64 that can be set, or too few values");
        memcpy(target, values + at, length * sizeof *values);
        at += length;
    }
    return at == count ? OK : refuse(c, "too many values");
}

EXPORT Status fmi3GetFMUState(fmi3Instance c, void **state) {
    if (!*state) *state = malloc(sizeof(Vector));
    memcpy(*state, c, sizeof(Vector));
    return OK;
}
EXPORT Status fmi3SetFMUState(fmi3Instance c, void *state) {
    Vector *v = c, *s = state;
    v->d = s->d;
    v->mode = s->mode;
    return OK;
}
EXPORT Status fmi3FreeFMUState(fmi3Instance c, void **state) { (void)c; free(*state); *state = NULL; return OK; }
EXPORT Status fmi3SerializedFMUStateSize(fmi3Instance c, void *state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Vector);
    return OK;
}
EXPORT Status fmi3SerializeFMUState(fmi3Instance c, void *state, uint8_t *bytes, size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return OK;
}
EXPORT Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t *bytes, size_t size, void **state) {
    (void)c;
    if (!*state) *state = malloc(sizeof(Vector));
    memcpy(*state, bytes, size);
    return OK;
}

EXPORT Status fmi3GetDirectionalDerivative(fmi3Instance c, const Ref *unknowns, size_t n_unknowns, const Ref *knowns,
                                           size_t n_knowns, const double *seed, size_t n_seed, double *out,
                                           size_t n_out) {
    Data *d = &((Vector *)c)->d;
    double u[MAX] = {0}, x[MAX] = {0}, f32 = 0;
    size_t at = 0;
    for (size_t i = 0; i < n_knowns; i++) {
        size_t length = knowns[i] == 26 ? 1 : d->n;
        double *target = knowns[i] == 26 ? &f32 : knowns[i] == U ? u : knowns[i] == X ? x : NULL;
        for (size_t j = 0; j < i; j++) if (knowns[j] == knowns[i]) return refuse(c, "a known twice");
        if (!target || at + length > n_seed) return refuse(c, "seeds of whole arrays of knowns are needed");
        memcpy(target, seed + at, length * sizeof *seed);
        at += length;
    }
    if (at != n_seed) return refuse(c, "too many seeds");
    at = 0;
    for (size_t i = 0; i < n_unknowns; i++) {
        size_t length = unknowns[i] == 27 ? 1 : d->n;
        if (at + length > n_out) return refuse(c, "too few sensitivities");
        for (size_t r = 0; r < length; r++) {
            double sum = unknowns[i] == 27 ? f32 : u[r];
            if (unknowns[i] == Y) sum += 2 * x[r];
            else if (unknowns[i] == DERX) for (uint64_t s = 0; s < d->n; s++) sum += d->a[r * d->n + s] * x[s];
            else if (unknowns[i] != 27) return refuse(c, "not an unknown");
            out[at + r] = sum;
        }
        at += length;
    }
    return at == n_out ? OK : refuse(c, "too many sensitivities");
}

EXPORT Status fmi3GetOutputDerivatives(fmi3Instance c, const Ref *refs, size_t n, const int32_t *orders, double *values,
                                       size_t count) {
    Data *d = &((Vector *)c)->d;
    if (n == 1 && refs[0] == 27 && orders[0] == 1 && count == 1) { values[0] = 0; return OK; } /* its input is held */
    if (n != 1 || refs[0] != Y || orders[0] != 1 || count != d->n) return refuse(c, "first derivatives only");
    rate(d, values);
    for (size_t i = 0; i < count; i++) values[i] *= 2;
    return OK;
}

EXPORT Status fmi3DoStep(fmi3Instance c, double t, double h, bool no_set, bool *event, bool *terminate, bool *early,
                         double *last) {
    Vector *v = c;
    (void)no_set;
    *event = *terminate = *early = false;
    if (v->mode != STEP) return refuse(v, "not in step mode");
    if (!(h > 0)) return refuse(v, "a step must be longer than 0 s");
    if (t < v->d.time - 1e-9 || t > v->d.time + 1e-9) return refuse(v, "the step does not begin where the last one ended");
    double target = t + h;
    /* Half a step, once for each multiple of 0.1 s. */
    if (v->d.early && h > 0.06) { h /= 2; target = t + h; *early = true; }
    for (int i = 0; i < 10; i++) {
        double r[MAX];
        rate(&v->d, r);
        for (uint64_t j = 0; j < v->d.n; j++) v->d.x[j] += h / 10 * r[j];
        if (v->update) {
            bool requested = true;
            double when = -1;
            v->update(v->environment, t + h * (i + 1) / 10, false, true, true, true, &requested, &when);
            if (!requested) v->d.updates++;
        }
    }
    v->d.time = target;
    events(&v->d);
    *last = target;
    return OK;
}

EXPORT Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *needed, bool *terminate, bool *nominals, bool *values,
                                       bool *timed, double *next) {
    Vector *v = c;
    if (v->mode != EVENT) return refuse(v, "not in event mode");
    events(&v->d);
    *needed = *terminate = *nominals = *values = false;
    *timed = true;
    *next = v->d.next;
    return OK;
}
EXPORT Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    Vector *v = c;
    if (v->mode != EVENT) return refuse(v, "not in event mode");
    v->mode = CONTINUOUS;
    return OK;
}
EXPORT Status fmi3CompletedIntegratorStep(fmi3Instance c, bool no_set, bool *event, bool *terminate) {
    (void)c; (void)no_set;
    *event = *terminate = false;
    return OK;
}
EXPORT Status fmi3SetTime(fmi3Instance c, double time) { ((Vector *)c)->d.time = time; return OK; }
EXPORT Status fmi3SetContinuousStates(fmi3Instance c, const double *x, size_t n) {
    Data *d = &((Vector *)c)->d;
    if (n != d->n) return refuse(c, "wrong number of states");
    memcpy(d->x, x, n * sizeof *x);
    return OK;
}
EXPORT Status fmi3GetContinuousStates(fmi3Instance c, double *x, size_t n) {
    Data *d = &((Vector *)c)->d;
    if (n != d->n) return refuse(c, "wrong number of states");
    memcpy(x, d->x, n * sizeof *x);
    return OK;
}
EXPORT Status fmi3GetContinuousStateDerivatives(fmi3Instance c, double *out, size_t n) {
    if (n != ((Vector *)c)->d.n) return refuse(c, "wrong number of states");
    rate(&((Vector *)c)->d, out);
    return OK;
}
EXPORT Status fmi3GetEventIndicators(fmi3Instance c, double *z, size_t n) {
    if (n != 1) return refuse(c, "wrong number of event indicators");
    z[0] = ((Vector *)c)->d.x[0] - 0.5;
    return OK;
}
EXPORT Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, double *nominals, size_t n) {
    if (n != ((Vector *)c)->d.n) return refuse(c, "wrong number of states");
    for (size_t i = 0; i < n; i++) nominals[i] = 1;
    return OK;
}
EXPORT Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) { *n = ((Vector *)c)->d.n; return OK; }
EXPORT Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) { (void)c; *n = 1; return OK; }
