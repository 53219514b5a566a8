/* The functions of FMI 2.0 around subject.c. -DNO_SET_TIME, -DNO_RESET and -DVERSION="..." plant faults of the library. */
#ifndef VERSION
#define VERSION "2.0"
#endif
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} Callbacks;
typedef struct {
    int needed, terminate, nominals, values, next_defined;
    double next;
} EventInfo;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return VERSION; }
Subject *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                         int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
#ifdef ANY_GUID
    guid = "subject";
#endif
    Subject *s = make(guid, type == 1);
    if (s == NULL) callbacks->logger(callbacks->environment, name, 3, "logStatusError", "wrong guid");
    return s;
}
void fmi2FreeInstance(Subject *s) { drop(s); }
int fmi2SetDebugLogging(Subject *s, int on, size_t n, const char *const *c) { return (void)s, (void)on, (void)n, (void)c, 0; }
int fmi2SetupExperiment(Subject *s, int a, double tolerance, double begin, int b, double stop) {
    (void)a, (void)tolerance, (void)b, (void)stop;
    s->d.time = begin;
    return 0;
}
int fmi2EnterInitializationMode(Subject *s) { return enter_initialization(s, s->d.time); }
int fmi2ExitInitializationMode(Subject *s) { return exit_initialization(s); }
int fmi2Terminate(Subject *s) { return terminate(s); }
#ifndef NO_RESET
int fmi2Reset(Subject *s) { return reset(s); }
#endif

int fmi2GetReal(Subject *s, const unsigned *r, size_t n, double *v) {
    for (size_t i = 0; i < n; i++) v[i] = real(s, r[HAS(FIRST_OF_CALL) ? 0 : i]);
    return 0;
}
int fmi2SetReal(Subject *s, const unsigned *r, size_t n, const double *v) {
    for (size_t i = 0; i < n; i++) if (!set_real(s, r[i], v[HAS(FIRST_OF_SETTER) ? 0 : i])) return 3;
    return 0;
}
int fmi2GetInteger(Subject *s, const unsigned *r, size_t n, int *v) {
    if (HAS(NO_INTEGERS) && n > 0) return 3;
    for (size_t i = 0; i < n; i++) v[i] = integer(s, r[HAS(FIRST_OF_INTEGERS) ? 0 : i]);
    return 0;
}
int fmi2SetInteger(Subject *s, const unsigned *r, size_t n, const int *v) {
    for (size_t i = 0; i < n; i++) if (!set_integer(s, r[i], v[i])) return 3;
    return 0;
}
int fmi2GetBoolean(Subject *s, const unsigned *r, size_t n, int *v) {
    for (size_t i = 0; i < n; i++) v[i] = boolean(s, r[i]);
    return 0;
}
int fmi2SetBoolean(Subject *s, const unsigned *r, size_t n, const int *v) {
    for (size_t i = 0; i < n; i++) if (!set_boolean(s, r[i], v[i])) return 3;
    return 0;
}
int fmi2GetString(Subject *s, const unsigned *r, size_t n, const char **v) {
    for (size_t i = 0; i < n; i++) v[i] = string(s, r[i]);
    return 0;
}
int fmi2SetString(Subject *s, const unsigned *r, size_t n, const char *const *v) {
    for (size_t i = 0; i < n; i++) if (!set_string(s, r[i], v[i])) return 3;
    return 0;
}

int fmi2GetFMUstate(Subject *s, Subject **state) { return get_state(s, state); }
int fmi2SetFMUstate(Subject *s, Subject *state) { return set_state(s, state); }
int fmi2FreeFMUstate(Subject *s, Subject **state) { return free_state(state, s); }
int fmi2SerializedFMUstateSize(Subject *s, Subject *state, size_t *size) { return (void)s, *size = sizeof *state, 0; }
int fmi2SerializeFMUstate(Subject *s, Subject *state, char *bytes, size_t size) { return serialize(s, state, bytes, size); }
int fmi2DeSerializeFMUstate(Subject *s, const char *bytes, size_t size, Subject **state) { return deserialize(s, bytes, size, state); }
int fmi2GetDirectionalDerivative(Subject *s, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                                 const double *seed, double *out) {
    return directional(s, unknown, unknowns, known, knowns, seed, out);
}

int fmi2DoStep(Subject *s, double t, double h, int no_set) { return (void)no_set, do_step(s, t, h); }
int fmi2SetRealInputDerivatives(Subject *s, const unsigned *r, size_t n, const int *order, const double *v) {
    (void)r, (void)n, (void)order, (void)v;
    return HAS(NO_INPUT_DERIVATIVES) ? 3 : 0;
}
int fmi2GetRealOutputDerivatives(Subject *s, const unsigned *r, size_t n, const int *order, double *v) {
    for (size_t i = 0; i < n; i++) if (output_derivative(s, r[i], order[i], &v[i]) != 0) return 3;
    return 0;
}
int fmi2CancelStep(Subject *s) { return (void)s, 3; }
int fmi2GetStatus(Subject *s, int k, int *v) { return (void)s, (void)k, (void)v, 2; }
int fmi2GetRealStatus(Subject *s, int k, double *v) { return (void)s, (void)k, (void)v, 2; }
int fmi2GetIntegerStatus(Subject *s, int k, int *v) { return (void)s, (void)k, (void)v, 2; }
int fmi2GetBooleanStatus(Subject *s, int k, int *v) { return (void)s, (void)k, (void)v, 2; }
int fmi2GetStringStatus(Subject *s, int k, const char **v) { return (void)s, (void)k, (void)v, 2; }

int fmi2EnterEventMode(Subject *s) { return (void)s, 0; }
int fmi2EnterContinuousTimeMode(Subject *s) { return (void)s, 0; }
int fmi2NewDiscreteStates(Subject *s, EventInfo *info) {
    crash(s, "event");
    memset(info, 0, sizeof *info);
    info->values = events(s);
    info->needed = HAS(ENDLESS_EVENTS) || (HAS(ENDLESS_EVENTS_LATER) && s->d.beats > 0);
    info->next_defined = !HAS(ME_FORGETS_EVENTS);
    info->next = next_event(s);
    return HAS(EVENT_FAILS) ? 3 : 0;
}
int fmi2CompletedIntegratorStep(Subject *s, int no_set, int *event, int *end) {
    (void)no_set;
    *event = *end = 0;
    return HAS(COMPLETED_FAILS) ? 3 : 0;
}
#ifndef NO_SET_TIME
int fmi2SetTime(Subject *s, double time) { return s->d.time = time, 0; }
#endif
int fmi2SetContinuousStates(Subject *s, const double *x, size_t n) { return set_states(s, x, n); }
int fmi2GetContinuousStates(Subject *s, double *x, size_t n) { return get_states(s, x, n); }
int fmi2GetDerivatives(Subject *s, double *x, size_t n) { return get_rates(s, x, n); }
int fmi2GetEventIndicators(Subject *s, double *z, size_t n) { return get_indicators(s, z, n); }
int fmi2GetNominalsOfContinuousStates(Subject *s, double *x, size_t n) { return get_nominals(s, x, n); }
