/* What an FMU can do wrong, in a call or around it: `fault` does what the environment variable HOSTILE says, as
 * `function:fault` or `function:fault:time`, where `load` and `unload` are functions, too, and a time [s] is that of the
 * instance. Included once, after a `Unit` (one instance: `time`, `real[4]`) and a macro SAY(unit, name, status, category,
 * text...) for its logger. */

#include <fcntl.h>
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

static volatile double never;

static void *idle(void *nothing) {
    for (;;) usleep(20000);
    return nothing;
}

static void *crash_later(void *nothing) {
    usleep(20000);
    *(volatile int *)8 = 1;
    return nothing;
}

static int deep(int n) {
    volatile char room[65536];
    room[0] = (char)n;
    return n < 0 ? room[0] : deep(n + 1) + room[0];
}

static void stay(int signal) { (void)signal; }

/* What HOSTILE asks for, read once. */
static char asked_function[64], asked_fault[64];
static double asked_time = -1e300;

static void read_wish(void) {
    const char *wish = getenv("HOSTILE");
    if (wish == NULL || sscanf(wish, "%63[^:]:%63[^:]:%lf", asked_function, asked_fault, &asked_time) < 2) asked_function[0] = 0;
}

/* Whether `function` of this instance is asked to do something wrong now. */
static int is_due(const char *function, const Unit *unit) {
    return strcmp(asked_function, function) == 0 && (unit == NULL || unit->time >= asked_time);
}

/* Whether `what` is the fault that `function` of this instance is asked for. */
static int asked(const char *function, const char *what, const Unit *unit) {
    return is_due(function, unit) && strcmp(asked_fault, what) == 0;
}

/* Does what is asked; the status for the function, 0 for none, -1: OK, but with the values that are there. */
static int fault(const char *function, Unit *unit, double *values, size_t count) {
#define IF(what) if (strcmp(asked_fault, what) == 0)
    if (!is_due(function, unit)) return 0;
    IF("segv") *(volatile int *)8 = 1;
    IF("abort") abort();
    IF("exit0") exit(0);
    IF("exit3") exit(3);
    IF("quick") quick_exit(0);
    IF("_exit") _exit(0);
    IF("loop") for (;;) never += 1;
    IF("copy") (void)!fork();
    IF("nowhere") { int none = open("/dev/null", O_WRONLY); for (int k = 3; k < 64; ++k) if (k != none) dup2(none, k); }
    IF("sleep") for (;;) pause();
    IF("sigtrap") raise(SIGTRAP);
    IF("stop") raise(SIGSTOP);
    IF("kill") raise(SIGKILL);
    IF("term") raise(SIGTERM);
    IF("trap") __builtin_trap();
    IF("fpe") raise(SIGFPE);
    IF("bus") raise(SIGBUS);
    IF("pipe") raise(SIGPIPE);
    IF("alarm") { alarm(1); for (;;) pause(); }
    IF("deaf") { for (int k = 1; k < 32; ++k) signal(k, stay); *(volatile int *)8 = 1; }
    IF("threadexit") pthread_exit(NULL);
    IF("later") { pthread_t one; pthread_create(&one, NULL, crash_later, NULL); usleep(100000); }
    IF("stack") return deep(1) == 0;
    IF("free") { free(unit); free(unit); }
    IF("heap") memset((char *)unit - 4096, 0x5a, 1 << 20);
    IF("memory") {
        char *much = malloc(8ul << 30);
        for (size_t k = 0; k < 8ul << 30; k += 4096) much[k] = 1;
    }
    IF("flood") for (int k = 0; k < 200000; ++k) printf("a line of a flood on the standard output\n");
    IF("binary") for (int k = 0; k < 100000; ++k) putchar(k * 7 & 255);
    IF("says") { fprintf(stderr, "the valve is stuck\n"); abort(); }
    IF("escape") { fprintf(stderr, "\033[31mred\033]0;title\a\n"); abort(); }
    IF("shared") { char junk[65536]; memset(junk, 0xff, sizeof junk); (void)!pwrite(3, junk, sizeof junk, 0); }
    IF("shrink") (void)!ftruncate(3, 0);
    IF("grow") (void)!ftruncate(3, 1l << 50);
    IF("close") for (int k = 0; k < 64; ++k) close(k);
    IF("descriptors") while (dup(0) >= 0 || dup(1) >= 0) {}
    IF("round") fesetround(FE_UPWARD);
#if defined(__SSE2__)
    IF("flush") _mm_setcsr(_mm_getcsr() | 0x8040); /* subnormal numbers are zero */
#endif
    IF("trapping") feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
    IF("locale") setlocale(LC_ALL, "de_DE.UTF-8");
    IF("chdir") (void)!chdir("/");
    IF("umask") umask(0777);
    IF("nice") setpriority(PRIO_PROCESS, 0, 19);
    IF("environment") clearenv();
    IF("thread") { pthread_t one; pthread_create(&one, NULL, idle, NULL); }
    IF("threads") for (int k = 0; k < 50; ++k) { pthread_t one; pthread_create(&one, NULL, idle, NULL); }
    IF("fork") if (fork() == 0) for (;;) pause();
    IF("session") if (fork() == 0) { setsid(); clearenv(); if (fork() == 0) for (;;) pause(); _exit(0); }
    IF("file") fclose(fopen("left_behind.txt", "w"));
    IF("logn") SAY(unit, "m", 0, "c", "a %n b");
    IF("logs") SAY(unit, "m", 3, "c", "%s %s %s %s %s %s %d");
    IF("lognull") SAY(unit, NULL, 9, NULL, NULL);
    IF("logflood") for (int k = 0; k < 3000; ++k) SAY(unit, "m", 0, "c", "a line of many");
    IF("loglong") { char *text = malloc(1 << 24); memset(text, 'x', 1 << 24); text[(1 << 24) - 1] = 0; SAY(unit, "m", 0, "c", text); free(text); }
    IF("logbytes") { SAY(unit, "m", 3, "\033[1mc", "\033[31mred \xff\xfe #r0# #r99# ## \r\n\t\a"); return 3; }
    if (values != NULL) {
        IF("over") for (size_t k = 0; k < count + 100000; ++k) values[k] = 1.0;
        IF("nan") { for (size_t k = 0; k < count; ++k) values[k] = 0.0 / never; return -1; }
        IF("inf") { for (size_t k = 0; k < count; ++k) values[k] = 1.0 / never; return -1; }
        IF("huge") { for (size_t k = 0; k < count; ++k) values[k] = 1e308; return -1; }
        IF("zero") { for (size_t k = 0; k < count; ++k) values[k] = 0.0; return -1; }
        IF("negative") { for (size_t k = 0; k < count; ++k) values[k] = -1.0; return -1; }
        IF("flip") { for (size_t k = 0; k < count; ++k) values[k] = (never += 1, fmod(never, 2.0) - 0.5); return -1; }
        IF("nothing") return -1;
    }
    IF("warning") return 1;
    IF("discard") return 2;
    IF("error") return 3;
    IF("fatal") return 4;
    IF("pending") return 5;
    IF("strange") return 77;
    IF("minus") return -1;
#undef IF
    return 0;
}

__attribute__((constructor)) static void load(void) {
    read_wish();
    fault("load", NULL, NULL, 0);
}
__attribute__((destructor)) static void unload(void) { fault("unload", NULL, NULL, 0); }

/* A text that is no text; NULL: none is asked for. */
static const char *strange_text(const char *function, const Unit *unit, int *is_null) {
    *is_null = asked(function, "null", unit);
    if (asked(function, "bytes", unit)) return "\xff\xfe\xc3(";
    if (asked(function, "control", unit)) return "\033[31mred\r\n\a";
    if (asked(function, "endless", unit)) {
        static char *text;
        size_t length = 64u << 20;
        if (text == NULL) { text = malloc(length + 1); memset(text, 'x', length); text[length] = 0; }
        return text;
    }
    if (asked(function, "wild", unit)) return (const char *)8;
    return NULL;
}

/* Saved states and derivatives, whose functions the versions name differently. */

static int save_state(const char *function, Unit *unit, void **state) {
    int status = fault(function, unit, NULL, 0);
    if (asked(function, "null", unit)) { *state = NULL; return 0; }
    if (status != 0) return status;
    if (*state == NULL) *state = malloc(sizeof *unit);
    memcpy(*state, unit, sizeof *unit);
    return 0;
}

static int free_state(const char *function, Unit *unit, void **state) {
    int status = fault(function, unit, NULL, 0);
    free(*state);
    *state = NULL;
    return status;
}

static int size_of_state(const char *function, Unit *unit, size_t *size) {
    *size = sizeof *unit;
    if (asked(function, "endless", unit)) *size = (size_t)-1;
    if (asked(function, "wide", unit)) *size = 1ul << 40;
    if (asked(function, "none", unit)) *size = 0;
    return fault(function, unit, NULL, 0);
}

static int write_state(const char *function, Unit *unit, const void *state, void *bytes, size_t size) {
    memcpy(bytes, state, size < sizeof *unit ? size : sizeof *unit);
    if (asked(function, "over", unit)) memset(bytes, 1, size + 1000000);
    return fault(function, unit, NULL, 0);
}

static int read_state(const char *function, Unit *unit, const void *bytes, size_t size, void **state) {
    int status = fault(function, unit, NULL, 0);
    if (status != 0 || size != sizeof *unit) return status != 0 ? status : 3;
    if (*state == NULL) *state = malloc(sizeof *unit);
    memcpy(*state, bytes, size);
    return 0;
}

/* dx/dt (reference 2) = u - x, and the outputs show x; u and x have the references 0 and 1. */
static int derivatives(const char *function, Unit *unit, const unsigned *unknowns, size_t rows, const unsigned *knowns,
                       size_t columns, const double *seed, double *out, size_t length) {
    int status = fault(function, unit, out, length);
    for (size_t i = 0; status == 0 && i < rows; ++i) {
        out[i] = 0.0;
        for (size_t k = 0; k < columns; ++k) {
            if (unknowns[i] == 2) out[i] += knowns[k] == 0 ? seed[k] : knowns[k] == 1 ? -seed[k] : 0.0;
            else out[i] += knowns[k] == 1 ? seed[k] : 0.0;
        }
    }
    return status < 0 ? 0 : status;
}
