/* The subject of the checker's mutants: one model with all kinds of variables, as an FMU of FMI 2.0, or of 3.0 with -DFMI3.
 *
 *   der(x) = v                       der(v) = -k x - d v + g u
 *   y = x + 2 u                      w = v
 *   held = u_held (a discrete Real)  mode = m_in + 1 (Integer)   on = flag (Boolean)   above = x > 0.25 (by a state event)
 *   beats: number of time events, one every 0.1 s                 note = text (String)
 *   doubled = 2 k (calculated parameter)
 *
 * Co-Simulation makes ten Heun steps for each communication step. Unlike a tool, it takes its faults from its guid: "subject" is
 * sound, "subject:STALE_RATES" has the fault of that name, and any other guid is refused. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TIME, U, U_HELD, X, V, DER_X, DER_V, Y, W, HELD, K, D, G, DOUBLED, INDICATOR };
enum { M_IN = 20, MODE, BEATS, LEVEL };
enum { FLAG = 30, ON, ABOVE };
enum { TEXT = 40, NOTE };

typedef struct {
    double time, next, u, u_held, x, v, k, d, g, last_rate[2], last_y;
    int m_in, level, beats, flag, above;
    char text[64];
} Data;

typedef struct {
    Data d;
    bool cs, in_step_mode;
    char fault[64];
    char *kept_text;
    void *garbage;
    int gets, steps, events;
} Subject;

static Data shared;

#define HAS(name) (strcmp(s->fault, #name) == 0)

static void start(Subject *s) {
    static const Data fresh = {.next = 0.1, .x = 1, .k = 4, .d = 0.5, .g = 1, .text = "start", .level = 1};
    Data old = s->d;
    s->d = fresh;
    if (HAS(WRONG_START)) s->d.x = 1.5;
    if (HAS(RESET_KEEPS_STATE)) s->d.x = old.x;
    if (HAS(RESET_KEEPS_PARAMETER) && old.k != 0) s->d.k = old.k;
    if (HAS(RESET_LOSES_PARAMETER) && old.k != 0) s->d.g = 0;
    if (HAS(RESET_KEEPS_INPUT)) s->d.u = old.u;
    if (HAS(RESET_KEEPS_TIME) && old.k != 0) s->d.next = old.next;
    if (HAS(RESET_KEEPS_INTEGER) && old.k != 0) s->d.m_in = old.m_in;
    if (HAS(RESET_KEEPS_COUNT)) s->d.beats = old.beats;
    if (HAS(RESET_KEEPS_TEXT) && old.k != 0) memcpy(s->d.text, old.text, sizeof old.text);
}

static Data *data(Subject *s) {
    if (HAS(SHARED_STATE)) { s->d.x = shared.x; s->d.v = shared.v; }
    if (HAS(SHARED_PARAMETER) && shared.k != 0) s->d.k = shared.k;
    if (HAS(SHARED_INPUT)) s->d.u = shared.u;
    if (HAS(SHARED_INTEGER)) s->d.m_in = shared.m_in;
    return &s->d;
}

static void share(Subject *s) {
    if (strncmp(s->fault, "SHARED_", 7) == 0) shared = s->d;
}

static void rates(Subject *s, double *out) {
    Data *d = data(s);
    double g = HAS(INPUT_WITHOUT_EFFECT_IN_COSIM) && s->cs ? 0 : d->g;
    double k = HAS(COSIM_DIFFERS) && s->cs ? 0.9 * d->k : d->k;
    double damping = HAS(COSIM_OTHER_SIGN) && s->cs ? -d->d : d->d;
    if (HAS(PARAMETER_IGNORED_IN_COSIM) && s->cs) k = 4.4;
    if (HAS(PARAMETER_AS_BUILT_IN_COSIM) && s->cs) k = 4;
    double now[2] = {d->v, -k * d->x - damping * d->v + g * d->u};
    if (HAS(HIDDEN_DEPENDENCY)) now[0] += 0.1 * d->u;
    if (HAS(DISCRETE_IN_RATE)) now[1] += 0.1 * d->u_held;
    if (HAS(INTEGER_IN_RATE)) now[1] += 0.1 * d->m_in;
    if (HAS(CURVED)) now[1] -= d->x * d->x * d->x;
    if (HAS(NAN_RATE) && d->time > 0.05) now[1] = NAN;
    if (HAS(INFINITE_RATE)) now[1] = INFINITY;
    memcpy(out, now, sizeof now);
    if (HAS(STALE_RATES)) {
        memcpy(out, d->last_rate, sizeof now);
        memcpy(d->last_rate, now, sizeof now);
    }
}

static double real(Subject *s, unsigned reference) {
    Data *d = data(s);
    double r[2] = {0, 0};
    switch (reference) {
        case TIME: return HAS(TIME_STANDS) ? 0 : d->time;
        case U: return HAS(INPUT_IGNORED) ? 0 : d->u;
        case U_HELD: return d->u_held;
        case X: return d->x;
        case V: return d->v;
        case DER_X: rates(s, r); return r[0];
        case DER_V: rates(s, r); return HAS(WRONG_RATE_VARIABLE) ? -r[1] : r[1];
        case Y:
            if (HAS(NAN_OUTPUT)) return NAN;
            if (HAS(INFINITE_OUTPUT)) return INFINITY;
            if (HAS(DISCRETE_IN_OUTPUT)) return d->x + 2 * d->u + d->u_held;
            if (HAS(INTEGER_IN_OUTPUT)) return d->x + 2 * d->u + d->m_in;
            if (HAS(BOOLEAN_IN_OUTPUT)) return d->x + 2 * d->u + d->flag;
            if (HAS(UNSTABLE_READING)) return d->x + 2 * d->u + 1e-6 * ++s->gets;
            if (HAS(COSIM_OUTPUT_DIFFERS) && s->cs) return d->x;
            if (HAS(COSIM_OFFSET) && s->cs) return d->x + 2 * d->u + 0.05;
            if (HAS(STATE_IN_OUTPUT)) return d->x + 2 * d->u + 0.5 * d->v;
            return d->x + 2 * d->u;
        case W: return HAS(HIDDEN_INPUT) ? d->v + 0.1 * d->u : d->v;
        case HELD:
            if (HAS(STATE_IN_DISCRETE)) return d->u_held + d->x;
            if (HAS(INTEGER_IN_DISCRETE)) return d->u_held + d->m_in;
            if (HAS(DISCRETE_MOVES)) return d->u_held + d->time;
            return d->u_held;
        case K: return HAS(PARAMETER_IGNORED) ? 4 : HAS(PARAMETER_DRIFTS) ? d->k + 0.01 * d->time : d->k;
        case D: return d->d;
        case G: return d->g;
        case INDICATOR: return d->x - 0.25;
        case DOUBLED: return HAS(FIXED_MOVES) ? 2 * d->k + d->time : 2 * d->k;
    }
    return 0;
}

static bool set_real(Subject *s, unsigned reference, double value) {
    Data *d = data(s);
    switch (reference) {
        case U: if (!(HAS(INPUT_IGNORED_IN_RUN) && s->in_step_mode)) d->u = value; break;
        case U_HELD: d->u_held = value; break;
        case X: if (!HAS(START_IGNORED)) d->x = value; break;
        case V: d->v = value; break;
        case K: if (HAS(PARAMETER_CLIPPED)) value = fmin(value, 4); d->k = value; break;
        case D: d->d = value; break;
        case G: if (!(HAS(TUNABLE_IGNORED) && s->in_step_mode)) d->g = value; break;
        default: return false;
    }
    share(s);
    return true;
}

static int integer(Subject *s, unsigned reference) {
    Data *d = data(s);
    switch (reference) {
        case M_IN: return HAS(INTEGER_IGNORED) ? 0 : d->m_in;
        case MODE:
            if (HAS(REAL_IN_INTEGER)) return d->m_in + 1 + (d->u_held > 0.01);
            if (HAS(BOOLEAN_IN_INTEGER)) return d->m_in + 1 + d->flag;
            return d->m_in + 1;
        case BEATS: return HAS(COSIM_LOSES_EVENTS) && s->cs ? 0 : d->beats;
        case LEVEL: return HAS(NO_ITEM) ? 7 : d->level;
    }
    return 0;
}

static bool set_integer(Subject *s, unsigned reference, int value) {
    Data *d = data(s);
    if (reference == M_IN) d->m_in = value;
    else if (reference == LEVEL) d->level = value;
    else return false;
    share(s);
    return true;
}

static int boolean(Subject *s, unsigned reference) {
    Data *d = data(s);
    switch (reference) {
        case FLAG: return HAS(BOOLEAN_IGNORED) ? 0 : d->flag;
        case ON: return HAS(REAL_IN_BOOLEAN) ? d->flag ^ (d->u_held > 0.01) : HAS(INTEGER_IN_BOOLEAN) ? d->flag ^ (d->m_in > 0) : d->flag;
        case ABOVE: return HAS(DISCRETE_STATE_MOVES) ? d->x > 0.99 : d->above;
    }
    return 0;
}

static bool set_boolean(Subject *s, unsigned reference, int value) {
    if (reference != FLAG) return false;
    s->d.flag = value;
    return true;
}

static const char *string(Subject *s, unsigned reference) {
    if (HAS(TEXT_IGNORED)) return "start";
    if (HAS(TEXT_LOST) && reference == NOTE) return s->d.beats > 0 ? "" : s->d.text;
    return s->d.text;
}

static bool set_string(Subject *s, unsigned reference, const char *value) {
    if (reference != TEXT) return false;
    snprintf(s->d.text, sizeof s->d.text, "%s", value);
    return true;
}

static void crash(Subject *s, const char *where) {
    char name[64];
    snprintf(name, sizeof name, "CRASH_%s", where);
    if (strcmp(s->fault, name) == 0) { volatile int *nothing = NULL; *nothing = 1; }
    snprintf(name, sizeof name, "EXIT_%s", where);
    if (strcmp(s->fault, name) == 0) exit(0);
    snprintf(name, sizeof name, "ABORT_%s", where);
    if (strcmp(s->fault, name) == 0) abort();
    snprintf(name, sizeof name, "HANG_%s", where);
    if (strcmp(s->fault, name) == 0) for (volatile int forever = 1; forever;) {}
    if (HAS(PRINTS)) printf("{ this is no JSON\n");
    if (HAS(LEAK_EACH_CALL)) { volatile char *lost = malloc(24); lost[0] = 1; }
}

static Subject *make(const char *token, bool cs) {
    if (strncmp(token, "subject", 7) != 0) return NULL;
    Subject *s = calloc(1, sizeof *s);
    const char *colon = strchr(token, ':');
    snprintf(s->fault, sizeof s->fault, "%s", colon ? colon + 1 : "");
    s->cs = cs;
    if (HAS(NO_COSIM) && cs) { free(s); return NULL; }
    start(s);
    if (HAS(LEAK_FILE)) { volatile FILE *lost = fopen("/dev/null", "r"); (void)lost; }
    if (HAS(LEAK_INSTANCE)) { volatile char *lost = malloc(200); lost[0] = 1; }
    share(s);
    crash(s, "instantiate");
    return s;
}

static void drop(Subject *s) {
    crash(s, "free");
    if (!HAS(LEAK_ALL)) free(s);
}

static int enter_initialization(Subject *s, double begin) {
    crash(s, "initialize");
    s->d.time = begin;
    s->d.next = begin + 0.1;
    if (HAS(RESET_KEEPS_TIME) && s->steps > 0) s->d.next = begin + 0.05;
    s->in_step_mode = false;
    return HAS(INITIALIZATION_FAILS) ? 3 : 0;
}

static int exit_initialization(Subject *s) {
    crash(s, "initialized");
    s->in_step_mode = true;
    data(s)->above = s->d.x > 0.25;
    share(s);
    return 0;
}

static int terminate(Subject *s) { return HAS(TERMINATE_FAILS) ? 3 : 0; }

static int reset(Subject *s) {
    crash(s, "reset");
    s->in_step_mode = false;
    start(s);
    share(s);
    if (HAS(LEAK_RESET)) { volatile char *lost = malloc(64); lost[0] = 1; }
    return HAS(RESET_FAILS) ? 3 : 0;
}

/* Event iteration; yields whether the continuous states jumped. */
static bool events(Subject *s) {
    Data *d = data(s);
    bool jump = false;
    s->events++;
    if (d->time + 1e-9 >= d->next) {
        d->beats++;
        d->next += 0.1;
        if (HAS(SILENT_JUMP)) { d->v *= 0.5; jump = false; }
        if (HAS(ANNOUNCED_JUMP)) { d->v *= 0.5; jump = true; }
        if (HAS(ME_LOSES_EVENTS) && !s->cs) d->beats--;
    }
    d->above = d->x > 0.25;
    share(s);
    return jump;
}

static double next_event(Subject *s) {
    if (HAS(EVENT_IN_PAST)) return s->d.time - 1;
    if (HAS(EVENT_IN_PAST_LATER)) return s->d.beats > 0 ? s->d.time - 0.05 : s->d.next;
    if (HAS(EVENT_NAN)) return NAN;
    if (HAS(EVENT_NOW)) return s->d.time;
    return s->d.next;
}

static int do_step(Subject *s, double t, double h) {
    Data *d = data(s);
    crash(s, "step");
    s->steps++;
    if (HAS(STEP_FAILS)) return 3;
    if (HAS(LATE_STEP_FAILS) && s->steps > 12) return 3;
    if (HAS(STEP_FATAL)) return 4;
    if (HAS(ACCEPTS_ANY_STEP)) { if (h < 0) h = -h; }
    else if (HAS(ACCEPTS_ZERO_STEP)) { if (h < 0) return 3; }
    else if (HAS(ACCEPTS_NEGATIVE_STEP)) { if (h == 0) return 3; }
    else if (!(h > 0)) return 3;
    if (HAS(FIXED_STEP) && fabs(h - 0.01) > 1e-9) return 3;
    if (HAS(STANDS_STILL)) return 0;
    if (HAS(STANDS_STILL_BUT_TIME)) { d->time = t + h; return 0; }
    if (HAS(HALF_STEP)) h *= 0.5;
    for (int i = 0; i < 10 && h != 0; i++) {
        double a[2], b[2], x = d->x, v = d->v, q = h / 10;
        rates(s, a);
        set_real(s, X, x + q * a[0]); set_real(s, V, v + q * a[1]);
        if (HAS(START_IGNORED)) d->x = x + q * a[0];
        rates(s, b);
        d->x = x + q / 2 * (a[0] + b[0]); d->v = v + q / 2 * (a[1] + b[1]);
        share(s);
    }
    d->time = t + h;
    if (HAS(STATE_STANDS)) d->x = 1;
    events(s);
    return 0;
}

static int output_derivative(Subject *s, unsigned reference, int order, double *out) {
    double r[2];
    rates(s, r);
    if (HAS(NO_OUTPUT_DERIVATIVES) || order != 1) return 3;
    *out = reference == W ? r[1] : r[0];
    if (HAS(ZERO_OUTPUT_DERIVATIVES)) *out = 0;
    if (HAS(WRONG_OUTPUT_DERIVATIVES)) *out *= -1;
    if (HAS(NAN_OUTPUT_DERIVATIVES)) *out = NAN;
    return reference == Y || reference == W ? 0 : 3;
}

static int directional(Subject *s, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                       const double *seed, double *out) {
    double u = 0, x = 0, v = 0;
    for (size_t j = 0; j < knowns; j++) {
        if (known[j] == U) u = seed[j];
        else if (known[j] == X) x = seed[j];
        else if (known[j] == V) v = seed[j];
        else if (known[j] != K && known[j] != U_HELD) return 3;
    }
    if (HAS(DERIVATIVE_MISSING)) return 3;
    for (size_t i = 0; i < unknowns; i++) {
        switch (unknown[i]) {
            case DER_X: out[i] = v; break;
            case DER_V: out[i] = (HAS(DERIVATIVE_SIGN) ? s->d.k : -s->d.k) * x - s->d.d * v + s->d.g * u; break;
            case Y: out[i] = x + (HAS(DERIVATIVE_FACTOR) ? 1.9 : 2) * u; break;
            case W: out[i] = HAS(DERIVATIVE_NAN) ? NAN : v; break;
            case X: out[i] = x; break;
            case V: out[i] = v; break;
            default: out[i] = 0;
        }
        if (HAS(DERIVATIVE_WITHOUT_SEED) && u != 0) out[i] /= u;
        if (HAS(CURVED) && unknown[i] == DER_V) out[i] -= 3 * s->d.x * s->d.x * x;
    }
    return 0;
}

static int set_states(Subject *s, const double *x, size_t count) {
    if (count != 2) return 3;
    int first = HAS(SWAPPED_STATES) || HAS(SWAPPED_SETTER);
    data(s)->x = x[first];
    s->d.v = x[1 - first];
    if (HAS(STATE_NOT_SET)) s->d.v = 0;
    share(s);
    return 0;
}

static int get_states(Subject *s, double *x, size_t count) {
    if (count != 2) return 3;
    int first = HAS(SWAPPED_STATES) || HAS(SWAPPED_GETTER);
    x[first] = data(s)->x;
    x[1 - first] = s->d.v;
    return 0;
}

static int get_rates(Subject *s, double *out, size_t count) {
    double r[2];
    if (count != 2) return 3;
    crash(s, "derivatives");
    rates(s, r);
    int first = HAS(SWAPPED_RATES) || HAS(SWAPPED_STATES);
    out[first] = r[0];
    out[1 - first] = r[1];
    return 0;
}

static int get_indicators(Subject *s, double *z, size_t count) {
    if (count != 1) return 3;
    z[0] = data(s)->x - 0.25;
    if (HAS(NAN_INDICATOR)) z[0] = NAN;
    if (HAS(NAN_INDICATOR_LATER) && s->d.time > 0.05) z[0] = NAN;
    if (HAS(INFINITE_INDICATOR)) z[0] = INFINITY;
    return 0;
}

static int get_nominals(Subject *s, double *n, size_t count) {
    if (count != 2) return 3;
    n[0] = HAS(NEGATIVE_NOMINAL) ? -1 : HAS(ZERO_NOMINAL) ? 0 : 1;
    n[1] = HAS(NAN_NOMINAL) ? NAN : HAS(INFINITE_NOMINAL) ? INFINITY : 1;
    return 0;
}

static int get_state(Subject *s, Subject **state) {
    if (HAS(NO_STATE)) return 3;
    if (*state == NULL) *state = malloc(sizeof **state);
    **state = *s;
    if (HAS(LEAK_STATE)) { volatile char *lost = malloc(500); lost[0] = 1; }
    return 0;
}

static int set_state(Subject *s, Subject *state) {
    Data now = s->d;
    s->d = state->d;
    if (HAS(STATE_WITHOUT_X)) s->d.x = now.x;
    if (HAS(STATE_WITHOUT_COUNT)) s->d.beats = now.beats;
    if (HAS(STATE_WITHOUT_NEXT)) s->d.next = now.next;
    share(s);
    return 0;
}

static int free_state(Subject **state, Subject *s) {
    if (!HAS(LEAK_SAVED)) free(*state);
    *state = NULL;
    return 0;
}

static int serialize(Subject *s, Subject *state, void *bytes, size_t size) {
    if (size != sizeof *state) return 3;
    memcpy(bytes, state, size);
    if (HAS(SERIALIZED_WITHOUT_V)) ((Subject *)bytes)->d.v = 0;
    return HAS(SERIALIZE_FAILS) ? 3 : 0;
}

static int deserialize(Subject *s, const void *bytes, size_t size, Subject **state) {
    if (size != sizeof **state) return 3;
    if (*state == NULL) *state = malloc(sizeof **state);
    memcpy(*state, bytes, size);
    (void)s;
    return 0;
}

#ifdef FMI3
#include "subject_fmi3.h"
#else
#include "subject_fmi2.h"
#endif
