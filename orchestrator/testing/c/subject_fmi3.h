/* The functions of FMI 3.0 around subject.c. -DNO_RESET and -DVERSION="..." plant faults of the library. */
#ifndef VERSION
#define VERSION "3.0"
#endif
#define EXPORT __attribute__((visibility("default")))
typedef uint32_t Ref;
typedef void (*Logger)(void *, int, const char *, const char *);

EXPORT const char *fmi3GetVersion(void) { return VERSION; }
static Subject *made(const char *token, bool cs, void *environment, Logger log) {
    Subject *s = make(token, cs);
    if (s == NULL && log) log(environment, 3, "logStatusError", "wrong token");
    return s;
}
EXPORT Subject *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                             bool logging, void *environment, Logger log) {
    (void)name, (void)resources, (void)visible, (void)logging;
    return made(token, false, environment, log);
}
EXPORT Subject *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                            bool logging, bool event_mode, bool early, const Ref *intermediate, size_t n,
                                            void *environment, Logger log, void *update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early, (void)intermediate, (void)n, (void)update;
    return made(token, true, environment, log);
}
EXPORT void fmi3FreeInstance(Subject *s) { drop(s); }
EXPORT int fmi3SetDebugLogging(Subject *s, bool on, size_t n, const char **c) { return (void)s, (void)on, (void)n, (void)c, 0; }
EXPORT int fmi3EnterConfigurationMode(Subject *s) { return (void)s, 3; }
EXPORT int fmi3ExitConfigurationMode(Subject *s) { return (void)s, 3; }
EXPORT int fmi3EnterInitializationMode(Subject *s, bool a, double tolerance, double begin, bool b, double stop) {
    (void)a, (void)tolerance, (void)b, (void)stop;
    return enter_initialization(s, begin);
}
EXPORT int fmi3ExitInitializationMode(Subject *s) { return exit_initialization(s); }
EXPORT int fmi3EnterEventMode(Subject *s) { return (void)s, 0; }
EXPORT int fmi3EnterStepMode(Subject *s) { return (void)s, 0; }
EXPORT int fmi3Terminate(Subject *s) { return terminate(s); }
#ifndef NO_RESET
EXPORT int fmi3Reset(Subject *s) { return reset(s); }
#endif

#define ALL(NAME, TYPE, GET, SET)                                                                                      \
    EXPORT int fmi3Get##NAME(Subject *s, const Ref *r, size_t n, TYPE *v, size_t k) {                                  \
        for (size_t i = 0; i < n && n == k; i++) v[i] = GET(s, r[HAS(FIRST_OF_CALL) ? 0 : i]);                         \
        return n == k ? 0 : 3;                                                                                         \
    }                                                                                                                  \
    EXPORT int fmi3Set##NAME(Subject *s, const Ref *r, size_t n, const TYPE *v, size_t k) {                            \
        for (size_t i = 0; i < n && n == k; i++) if (!SET(s, r[i], v[HAS(FIRST_OF_SETTER) ? 0 : i])) return 3;         \
        return n == k ? 0 : 3;                                                                                         \
    }
ALL(Float64, double, real, set_real)
ALL(Int32, int32_t, integer, set_integer)
ALL(Int64, int64_t, integer, set_integer)
ALL(Boolean, bool, boolean, set_boolean)
#define NONE(NAME, TYPE)                                                                                               \
    EXPORT int fmi3Get##NAME(Subject *s, const Ref *r, size_t n, TYPE *v, size_t k) { return (void)s, (void)r, (void)v, (void)k, n ? 3 : 0; } \
    EXPORT int fmi3Set##NAME(Subject *s, const Ref *r, size_t n, const TYPE *v, size_t k) { return (void)s, (void)r, (void)v, (void)k, n ? 3 : 0; }
NONE(Float32, float) NONE(Int8, int8_t) NONE(UInt8, uint8_t) NONE(Int16, int16_t) NONE(UInt16, uint16_t) NONE(UInt32, uint32_t)
NONE(UInt64, uint64_t)
EXPORT int fmi3GetString(Subject *s, const Ref *r, size_t n, const char **v, size_t k) {
    for (size_t i = 0; i < n && n == k; i++) v[i] = string(s, r[i]);
    return n == k ? 0 : 3;
}
EXPORT int fmi3SetString(Subject *s, const Ref *r, size_t n, const char **v, size_t k) {
    for (size_t i = 0; i < n && n == k; i++) if (!set_string(s, r[i], v[i])) return 3;
    return n == k ? 0 : 3;
}

EXPORT int fmi3GetFMUState(Subject *s, Subject **state) { return get_state(s, state); }
EXPORT int fmi3SetFMUState(Subject *s, Subject *state) { return set_state(s, state); }
EXPORT int fmi3FreeFMUState(Subject *s, Subject **state) { return free_state(state, s); }
EXPORT int fmi3SerializedFMUStateSize(Subject *s, Subject *state, size_t *size) { return (void)s, *size = sizeof *state, 0; }
EXPORT int fmi3SerializeFMUState(Subject *s, Subject *state, uint8_t *bytes, size_t size) { return serialize(s, state, bytes, size); }
EXPORT int fmi3DeserializeFMUState(Subject *s, const uint8_t *bytes, size_t size, Subject **state) { return deserialize(s, bytes, size, state); }
EXPORT int fmi3GetDirectionalDerivative(Subject *s, const Ref *unknown, size_t unknowns, const Ref *known, size_t knowns,
                                        const double *seed, size_t seeds, double *out, size_t outs) {
    (void)seeds, (void)outs;
    return directional(s, unknown, unknowns, known, knowns, seed, out);
}

EXPORT int fmi3DoStep(Subject *s, double t, double h, bool no_set, bool *event, bool *end, bool *early, double *last) {
    (void)no_set;
    *event = *end = *early = false;
    *last = t + h;
    return do_step(s, t, h);
}
EXPORT int fmi3GetOutputDerivatives(Subject *s, const Ref *r, size_t n, const int32_t *order, double *v, size_t k) {
    for (size_t i = 0; i < n && n == k; i++) if (output_derivative(s, r[i], order[i], &v[i]) != 0) return 3;
    return n == k ? 0 : 3;
}
EXPORT int fmi3EnterContinuousTimeMode(Subject *s) { return (void)s, 0; }
EXPORT int fmi3UpdateDiscreteStates(Subject *s, bool *needed, bool *end, bool *nominals, bool *values, bool *defined, double *next) {
    crash(s, "event");
    *end = *nominals = false;
    *values = events(s);
    *needed = HAS(ENDLESS_EVENTS);
    *defined = !HAS(ME_FORGETS_EVENTS);
    *next = next_event(s);
    return HAS(EVENT_FAILS) ? 3 : 0;
}
EXPORT int fmi3CompletedIntegratorStep(Subject *s, bool no_set, bool *event, bool *end) {
    (void)no_set;
    *event = *end = false;
    return HAS(COMPLETED_FAILS) ? 3 : 0;
}
EXPORT int fmi3SetTime(Subject *s, double time) { return s->d.time = time, 0; }
EXPORT int fmi3SetContinuousStates(Subject *s, const double *x, size_t n) { return set_states(s, x, n); }
EXPORT int fmi3GetContinuousStates(Subject *s, double *x, size_t n) { return get_states(s, x, n); }
EXPORT int fmi3GetContinuousStateDerivatives(Subject *s, double *x, size_t n) { return get_rates(s, x, n); }
EXPORT int fmi3GetEventIndicators(Subject *s, double *z, size_t n) { return get_indicators(s, z, n); }
EXPORT int fmi3GetNominalsOfContinuousStates(Subject *s, double *x, size_t n) { return get_nominals(s, x, n); }
EXPORT int fmi3GetNumberOfContinuousStates(Subject *s, size_t *n) { return (void)s, *n = HAS(WRONG_NUMBER_OF_STATES) ? 3 : 2, 0; }
EXPORT int fmi3GetNumberOfEventIndicators(Subject *s, size_t *n) { return (void)s, *n = HAS(WRONG_NUMBER_OF_INDICATORS) ? 2 : 1, 0; }
